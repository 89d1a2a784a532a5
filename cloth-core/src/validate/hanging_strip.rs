use super::equilibrium::Equilibrium;
use super::special::zero_between;
use super::strip::Strip;
use super::{Finding, ValidateError};
use crate::fabric::{self, Arap, BaraffWitkin, Bending, Fabric, Material, Membrane, Surroundings, Woven};
use crate::mesh::SpringNetwork;
use energy_solve::System;

/// Energy per area as a function of λ, μ and the principal stretches s₁, s₂.
type Density = fn(f64, f64, f64, f64) -> f64;

/// A material with its name and density.
struct Sample {
    name: &'static str,
    material: Material,
    density: Density,
}

/// E h over the strip's weight per width; the strip stretches by about 5 %.
const STIFFNESS: f64 = 10.0;

fn samples() -> Vec<Sample> {
    let membrane = |poisson_ratio| Membrane { stretch_stiffness: STIFFNESS, poisson_ratio, bending: Bending::None };
    let stvk: Density = |lambda, mu, a, b| {
        let (e, f) = (0.5 * (a * a - 1.0), 0.5 * (b * b - 1.0));
        mu * (e * e + f * f) + 0.5 * lambda * (e + f).powi(2)
    };
    let neo_hookean: Density = |lambda, mu, a, b| {
        let j = (a * b).ln();
        0.5 * mu * (a * a + b * b - 2.0) - mu * j + 0.5 * lambda * j * j
    };
    let stable: Density = |lambda, mu, a, b| {
        let j = a * b - 1.0;
        0.5 * mu * (a * a + b * b - 2.0) - mu * j + 0.5 * (lambda + mu) * j * j
    };
    let stable_log: Density = |lambda, mu, a, b| {
        // The constants of the source for Hooke's λ and μ.
        let (lambda, mu) = (lambda + 2.0 / 3.0 * mu, 1.5 * mu);
        let i = a * a + b * b;
        let alpha = 1.0 + 2.0 / 3.0 * mu / lambda;
        0.5 * mu * (i - 2.0) - 0.5 * mu * ((i + 1.0) / 3.0).ln()
            + 0.5 * lambda * ((a * b - alpha).powi(2) - (1.0 - alpha).powi(2))
    };
    let arap: Density = |_, mu, a, b| mu * ((a - 1.0).powi(2) + (b - 1.0).powi(2));
    let sample = |name, material, density| Sample { name, material, density };
    vec![
        sample("StVK, ν = 0", Material::Stvk(membrane(0.0)), stvk),
        sample("StVK, ν = 0.3", Material::Stvk(membrane(0.3)), stvk),
        sample("neo-Hookean, ν = 0.3", Material::NeoHookean(membrane(0.3)), neo_hookean),
        sample("stable neo-Hookean, ν = 0.3", Material::StableNeoHookean(membrane(0.3)), stable),
        sample("stable neo-Hookean with log, ν = 0.3", Material::StableNeoHookeanLog(membrane(0.3)), stable_log),
        sample(
            "as rigid as possible (Hooke)",
            Material::Arap(Arap { stretch_stiffness: STIFFNESS, bending: Bending::None }),
            arap,
        ),
        sample(
            "Baraff-Witkin (Hooke)",
            Material::BaraffWitkin(BaraffWitkin {
                stretch: STIFFNESS,
                shear: 3.0,
                rest_stretch: [1.0; 2],
                bending: Bending::None,
            }),
            arap,
        ),
        sample(
            "orthotropic StVK along the warp",
            Material::OrthotropicStvk(Woven {
                warp: STIFFNESS,
                weft: 4.0,
                bias: 3.0,
                poisson_ratio: 0.0,
                bending: Bending::None,
            }),
            stvk,
        ),
    ]
}

/// Returns the exact ΔL/L of a narrow strip of length 1 under its own weight; its tension at X is 1 − X.
fn exact(density: Density, lambda: f64, mu: f64) -> f64 {
    let derivative = |f: &dyn Fn(f64) -> f64, at: f64| (f(at + 1e-5) - f(at - 1e-5)) / 2e-5;
    let narrowed = |a: f64| zero_between(0.3, 2.0, |b| derivative(&|b| density(lambda, mu, a, b), b));
    let tension = |a: f64| {
        let b = narrowed(a);
        derivative(&|a| density(lambda, mu, a, b), a)
    };
    let stretch = |pull: f64| zero_between(0.9, 1.6, |a| tension(a) - pull);
    // Simpson's rule.
    let n = 20;
    let weight = |k: usize| if k == 0 || k == n { 1.0 } else { 2.0 + 2.0 * (k % 2) as f64 };
    (0..=n).map(|k| weight(k) * (stretch(k as f64 / n as f64) - 1.0)).sum::<f64>() / (3.0 * n as f64)
}

fn measured(material: Material, segments: usize) -> Result<f64, ValidateError> {
    let strip = Strip::narrow(segments);
    let mesh = strip.mesh()?;
    let surroundings = Surroundings { gravity: [1.0, 0.0, 0.0], drag: 0.0 };
    let garment = fabric::terms(&Fabric::new(1.0, material), &mesh, &SpringNetwork::default(), &surroundings)?;
    let rest = mesh.vertices();
    let held: Vec<bool> = rest.iter().map(|p| p[0] < 1e-9).collect();
    let system = System::new(garment.terms, &held)?;
    // A small initial stretch puts the strip in tension from the start.
    let start = rest.iter().map(|p| [p[0] + 0.1 * (p[0] - 0.5 * p[0] * p[0]), p[1], 0.0]);
    let found = Equilibrium::find(system, start.collect(), garment.masses, strip.width)?;
    let end: Vec<f64> = rest.iter().zip(&found.x).filter(|(p, _)| p[0] > 1.0 - 1e-9).map(|(_, x)| x[0] - 1.0).collect();
    Ok(end.iter().sum::<f64>() / end.len() as f64)
}

pub(super) fn ask(quick: bool, report: &mut dyn FnMut(Finding)) -> Result<(), ValidateError> {
    let segments = if quick { 40 } else { 80 };
    for Sample { name, material, density } in samples() {
        let (lambda, mu) = match &material {
            Material::Stvk(membrane)
            | Material::NeoHookean(membrane)
            | Material::StableNeoHookean(membrane)
            | Material::StableNeoHookeanLog(membrane) => membrane.lame(),
            _ => (0.0, 0.5 * STIFFNESS),
        };
        let case = format!("{name}, {segments} segments: ΔL/L");
        let exact = exact(density, lambda, mu);
        report(Finding::relative("hanging strip", case, measured(material, segments)?, exact, 0.01));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_stretches_match_the_table() {
        let found = |name: &str| {
            let sample = samples().into_iter().find(|sample| sample.name == name).unwrap();
            exact(sample.density, 0.0, 0.5 * STIFFNESS)
        };
        assert!((found("StVK, ν = 0") - 0.045_797_7).abs() < 1e-6, "{}", found("StVK, ν = 0"));
        assert!((found("as rigid as possible (Hooke)") - 0.05).abs() < 1e-9);
        // Incompressible neo-Hookean rubber in three dimensions: ⅙ E (a² + 2/a − 3) per length.
        let rubber: Density = |_, mu, a, b| mu / 3.0 * (a * a + 2.0 / a - 3.0) + (b - 1.0).powi(2);
        assert!((exact(rubber, 0.0, 0.5 * STIFFNESS) - 0.053_498_8).abs() < 1e-6);
    }
}
