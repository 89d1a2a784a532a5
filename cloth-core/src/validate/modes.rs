use energy_elements::{Gravity, HookeSpring};
use energy_solve::{ElementList, PotentialTerm, System};

use super::critical_load::{Symmetry, critical_load};
use super::equilibrium::Equilibrium;
use super::special::{bessel_core, laguerre, zero_between};
use super::strip::{MeshKind, Strip};
use super::{Finding, ValidateError};
use crate::fabric::{self, Bending, Fabric, Material, Membrane, Rigidity, Surroundings};
use crate::mesh::SpringNetwork;

/// E h of membranes over the strip's weight per width.
const MEMBRANE: f64 = 1e5;

/// Returns ω₁ √(L/g) of a chain of equal masses, one at the end of each link.
fn chain(links: usize) -> Result<f64, ValidateError> {
    let n = links as f64;
    let mass = 1.0 / n;
    let (stretched, stiffness) = (1.0 / n, 1e7 * n);
    // Shorten each link by its elongation under load, so that all links have equal lengths at equilibrium.
    let springs: Vec<HookeSpring> = (0..links)
        .map(|link| HookeSpring::new(stiffness, stretched - mass * (links - link) as f64 / stiffness))
        .collect();
    let pairs: Vec<[usize; 2]> = (0..links).map(|link| [link, link + 1]).collect();
    let vertices: Vec<[usize; 1]> = (1..=links).map(|vertex| [vertex]).collect();
    let weights = vec![Gravity::new(mass, [0.0, 0.0, -1.0]); links];
    let mut held = vec![false; links + 1];
    held[0] = true;
    let system = System::new(
        vec![
            Box::new(PotentialTerm::new(ElementList::new("links", springs, &pairs)?)),
            Box::new(PotentialTerm::new(ElementList::new("weights", weights, &vertices)?)),
        ],
        &held,
    )?;
    let start = (0..=links).map(|vertex| [0.0, 0.0, -(vertex as f64) / n]).collect();
    let mut found = Equilibrium::find(system, start, vec![mass; links + 1], 1.0)?;
    Ok(found.lowest_mode().unwrap_or(f64::NAN).sqrt())
}

/// Returns ω₁ √(L/g) of a strip that hangs from its end (gravity along it) or stands on it (gravity against it),
/// `clamped` or hinged there.
fn strip(bending: Bending, gravity: f64, clamped: bool, segments: usize) -> Result<Option<f64>, ValidateError> {
    let spacing = if clamped { 1.0 / (segments as f64 - 0.5) } else { 1.0 / segments as f64 };
    let length = if clamped { 1.0 + 0.5 * spacing } else { 1.0 };
    let width = 4.0 * spacing;
    let shape = Strip { kind: MeshKind::Diagonal, orientation: 0.0, length, width, spacing, clamped };
    let mesh = shape.mesh()?;
    let fabric =
        Fabric::new(1.0, Material::Stvk(Membrane { stretch_stiffness: MEMBRANE, poisson_ratio: 0.0, bending }));
    let surroundings = Surroundings { gravity: [gravity, 0.0, 0.0], drag: 0.0 };
    let garment = fabric::terms(&fabric, &mesh, &SpringNetwork::default(), &surroundings)?;
    let rest = mesh.vertices();
    let reach = if clamped { 1.2 * spacing } else { 1e-9 };
    let held: Vec<bool> = rest.iter().map(|p| p[0] < reach).collect();
    let system = System::new(garment.terms, &held)?;
    let start = rest.iter().map(|p| [p[0] + gravity / MEMBRANE * p[0] * (1.0 - 0.5 * p[0]), p[1], 0.0]).collect();
    let mut found = Equilibrium::find(system, start, garment.masses, width)?;
    Ok(found.lowest_mode().map(f64::sqrt))
}

fn plate(rigidity: f64) -> Bending {
    Bending::Plate(Rigidity::Flexural { rigidity, poisson_ratio: 0.0 })
}

pub(super) fn ask(quick: bool, report: &mut dyn FnMut(Finding)) -> Result<(), ValidateError> {
    let segments = if quick { 60 } else { 120 };
    for links in [1, 3, 20] {
        let x = zero_between(0.0, 2.5 / links as f64, |x| laguerre(links, x));
        let exact = (links as f64 * x).sqrt();
        let case = format!("chain of {links} masses: ω₁ √(L/g)");
        report(Finding::relative("modes", case, chain(links)?, exact, 1e-4));
    }
    let exact = 0.5 * zero_between(2.0, 3.0, |x| bessel_core(0.0, x));
    let measured = strip(Bending::None, 1.0, false, segments)?.unwrap_or(f64::NAN);
    let case = format!("hanging sheet, {segments} segments: ω₁ √(L/g)");
    report(Finding::relative("modes", case, measured, exact, 0.01));

    let exact = std::f64::consts::TAU * (2.0_f64 / 3.0).sqrt();
    let measured = std::f64::consts::TAU / strip(plate(1e3), 1.0, false, segments)?.unwrap_or(f64::NAN);
    let case = format!("rigid hinged sheet, {segments} segments: T √(g/L)");
    report(Finding::relative("modes", case, measured, exact, 0.01));

    let root = zero_between(1.5, 2.2, |x| bessel_core(-1.0 / 3.0, x));
    let measured = critical_load("the standing strip", Symmetry::None, 4.0, |gamma| {
        Ok(strip(plate(1.0 / gamma), -1.0, true, segments)?.map(|omega| gamma * omega * omega))
    })?;
    let case = format!("standing strip, {segments} segments: Γ*");
    report(Finding::relative("modes", case, measured, 2.25 * root * root, 0.01));
    Ok(())
}
