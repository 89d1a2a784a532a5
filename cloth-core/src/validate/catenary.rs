use super::equilibrium::Equilibrium;
use super::special::zero_between;
use super::strip::Strip;
use super::{Finding, ValidateError};
use crate::fabric::{self, Bending, Fabric, Material, Membrane, Surroundings};
use crate::mesh::SpringNetwork;
use energy_solve::System;

/// E h of the membrane over the strip's weight per width.
const MEMBRANE: f64 = 1e5;

/// Returns u = d/(2a) of the catenary y = a cosh(x/a) of span d and length S, from sinh u/u = S/d.
fn parameter(span: f64) -> f64 {
    zero_between(1e-6, 20.0, |u| u.sinh() / u - 1.0 / span)
}

/// Returns the sag over the length of an inextensible strip without bending stiffness, held at both ends.
fn sag(span: f64, segments: usize) -> Result<f64, ValidateError> {
    let strip = Strip::narrow(segments);
    let mesh = strip.mesh()?;
    let membrane = Membrane { stretch_stiffness: MEMBRANE, poisson_ratio: 0.0, bending: Bending::None };
    let fabric = Fabric::new(1.0, Material::Stvk(membrane));
    let surroundings = Surroundings { gravity: [0.0, 0.0, -1.0], drag: 0.0 };
    let garment = fabric::terms(&fabric, &mesh, &SpringNetwork::default(), &surroundings)?;
    let rest = mesh.vertices();
    let held: Vec<bool> = rest.iter().map(|p| p[0] < 1e-9 || p[0] > 1.0 - 1e-9).collect();
    let system = System::new(garment.terms, &held)?;
    // Start on the catenary: by arc length from the middle, x = a asinh(s/a), y = √(a² + s²).
    let a = 0.5 * span / parameter(span);
    let top = a.hypot(0.5);
    let start = rest.iter().map(|p| {
        let s = p[0] - 0.5;
        [a * (s / a).asinh(), p[1], a.hypot(s) - top]
    });
    let found = Equilibrium::find(system, start.collect(), garment.masses, strip.width)?;
    Ok(-found.x.iter().map(|x| x[2]).fold(0.0, f64::min))
}

pub(super) fn ask(quick: bool, report: &mut dyn FnMut(Finding)) -> Result<(), ValidateError> {
    let segments = if quick { 60 } else { 120 };
    for span in [0.5, 0.75, 0.9] {
        let u = parameter(span);
        let exact = 0.5 * (u.cosh() - 1.0) / u.sinh();
        let case = format!("span {span} of the length, {segments} segments: sag");
        report(Finding::relative("catenary", case, sag(span, segments)?, exact, 0.01));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_sags_match_the_table() {
        for (span, sag) in [(0.5, 0.398_194), (0.75, 0.294_334), (0.9, 0.190_709)] {
            let u = parameter(span);
            assert!((0.5 * (u.cosh() - 1.0) / u.sinh() - sag).abs() < 1e-6);
        }
    }
}
