//! Folds of stiff cloth whose shape is known: a corrugation that is held at its edges, and Peirce's cantilever.
//!
//! * **held corrugation**: the edges of a sheet are held on a cylinder of curvature 60/m cos(2πu/90 mm), where u is the
//!   distance along the sheet at 22.5° to the warp. The rest of the sheet can take the shape of the cylinder without
//!   stretching. What its energy has above the plate's on that shape, as a share of the exact ½ D ∫κ², comes from the
//!   membrane. The goal is 0.02. Nodal averages miss it by far: the limit is near what this very irregular mesh has today.
//! * **tip**: a strip of 60 × 25 mm with a bending length of 15 mm, clamped at one end, on a lattice at 22.5° to it. Its
//!   tip drops as that of an elastica.

use std::f64::consts::TAU;

use energy_dsl::Vector3;
use energy_solve::System;

use super::elastica::Elastica;
use super::equilibrium::Equilibrium;
use super::locking::{DENSITY, RIGIDITY, STIFF, plate, total};
use super::strip::{MeshKind, Strip};
use super::{Finding, ValidateError};
use crate::fabric::{self, Fabric, Material, Membrane, Strain, Surroundings};
use crate::mesh::{SpringNetwork, TriangleMesh};

/// Largest curvature of the corrugation, in 1/m, and its wave length, in m.
const CURVATURE: f64 = 60.0;
const WAVE: f64 = 0.09;
/// Angle between the folds and the mesh, in degrees.
const ANGLE: f64 = 22.5;

fn fabric(strain: Strain) -> Fabric {
    let membrane = Membrane { stretch_stiffness: STIFF, poisson_ratio: 0.0, bending: plate(0.0) };
    Fabric { strain, ..Fabric::new(DENSITY, Material::Stvk(membrane)) }
}

/// Returns the point of the corrugation at arc length u: ∫ (cos θ, sin θ) du with θ = ∫ κ du, by Simpson's rule.
fn corrugated(u: f64) -> [f64; 2] {
    let angle = |u: f64| CURVATURE * WAVE / TAU * (TAU * u / WAVE).sin();
    let steps = 40;
    let step = u / f64::from(steps);
    let mut sum = [0.0; 2];
    for number in 0..steps {
        let start = f64::from(number) * step;
        for (at, weight) in [(0.0, 1.0), (0.5, 4.0), (1.0, 1.0)] {
            let (sine, cosine) = angle(start + at * step).sin_cos();
            sum = [sum[0] + weight * step / 6.0 * cosine, sum[1] + weight * step / 6.0 * sine];
        }
    }
    sum
}

/// Returns the energy of a held corrugation above that of the plate alone, over the exact energy of the plate.
fn held(strain: Strain, spacing: f64) -> Result<f64, ValidateError> {
    let [length, width] = [0.15, 0.12];
    let strip = Strip { kind: MeshKind::Random, orientation: 0.0, length, width, spacing, clamped: false };
    let mesh = strip.mesh()?;
    let (sine, cosine) = ANGLE.to_radians().sin_cos();
    let bent = |x: &Vector3<f64>| {
        let (along, across) = (cosine * x[0] + sine * x[1], cosine * x[1] - sine * x[0]);
        let [u, height] = corrugated(along);
        [cosine * u - sine * across, sine * u + cosine * across, height]
    };
    let x: Vec<Vector3<f64>> = mesh.vertices().iter().map(bent).collect();
    let is_edge = |x: &Vector3<f64>| {
        let off = |at: f64, length: f64| at.min(length - at) < 1e-9;
        off(x[0], length) || off(x[1], width)
    };
    let pinned: Vec<bool> = mesh.vertices().iter().map(is_edge).collect();
    let surroundings = Surroundings { gravity: [0.0; 3], drag: 0.0 };
    let garment = fabric::terms(&fabric(strain), &mesh, &SpringNetwork::default(), &surroundings)?;
    let mut system = System::new(garment.terms, &pinned)?;
    let of_plate = system.energies(&x)?.iter().find(|term| term.term == "bending").and_then(|term| term.energy);
    let weight = 9.81 * DENSITY * length * width;
    let mut found = Equilibrium::find(system, x, garment.masses, weight)?;
    let exact = exact_bending(&mesh, cosine, sine);
    Ok((total(&mut found.system, &found.x.clone())? - of_plate.unwrap_or(f64::NAN)) / exact)
}

/// Returns ½ D ∫κ² over the mesh, by the midpoints of its edges.
fn exact_bending(mesh: &TriangleMesh, cosine: f64, sine: f64) -> f64 {
    let square = |[x, y, _]: Vector3<f64>| (CURVATURE * (TAU * (cosine * x + sine * y) / WAVE).cos()).powi(2);
    let of_triangle = |triangle: usize| {
        let [a, b, c] = mesh.corners(triangle);
        let area = 0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]));
        let middle = |p: Vector3<f64>, q: Vector3<f64>| square([0.5 * (p[0] + q[0]), 0.5 * (p[1] + q[1]), 0.0]);
        area / 3.0 * (middle(a, b) + middle(b, c) + middle(c, a))
    };
    0.5 * RIGIDITY * (0..mesh.triangles().len()).map(of_triangle).sum::<f64>()
}

/// Returns the drop of the tip of a cantilever over the exact drop.
fn drop_of_tip(strain: Strain, kind: MeshKind, orientation: f64) -> Result<f64, ValidateError> {
    let (length, width, edge) = (0.06_f64, 0.025, 7.5e-3);
    let spacing = length / ((length / edge).round() - 0.5);
    let origin = 0.5 * spacing;
    let strip = Strip { kind, orientation, length: length + origin, width, spacing, clamped: true };
    let mesh = strip.mesh()?;
    let surroundings = Surroundings { gravity: [0.0, 0.0, -9.81], drag: 0.0 };
    let garment = fabric::terms(&fabric(strain), &mesh, &SpringNetwork::default(), &surroundings)?;
    let pinned: Vec<bool> = mesh.vertices().iter().map(|x| x[0] < 1.2 * spacing).collect();
    let elastica = Elastica::new(9.81 * DENSITY * length.powi(3) / RIGIDITY);
    let bent = |(x, &pinned): (&Vector3<f64>, &bool)| {
        let at = (x[0] - origin) / length;
        let [reach, drop] = if pinned { [at, 0.0] } else { elastica.at(at) };
        [length * reach + origin, x[1], -length * drop]
    };
    let start = mesh.vertices().iter().zip(&pinned).map(bent).collect();
    let system = System::new(garment.terms, &pinned)?;
    let found = Equilibrium::find(system, start, garment.masses, 9.81 * DENSITY * length * width)?;
    let is_tip = |x: &Vector3<f64>| x[0] > strip.length - 1e-9;
    let tip: Vec<f64> =
        mesh.vertices().iter().zip(&found.x).filter(|(rest, _)| is_tip(rest)).map(|(_, x)| -x[2]).collect();
    Ok(tip.iter().sum::<f64>() / tip.len() as f64 / (length * elastica.at(1.0)[1]))
}

pub(super) fn ask(quick: bool, report: &mut dyn FnMut(Finding)) -> Result<(), ValidateError> {
    for &(kind, angle) in &[(MeshKind::Random, 0.0), (MeshKind::Diagonal, ANGLE), (MeshKind::Equilateral, ANGLE)] {
        let [nodal, plain] = [drop_of_tip(Strain::Nodal, kind, angle)?, drop_of_tip(Strain::PerTriangle, kind, angle)?];
        let case = format!("tip, {} {angle}° (triangles: {plain:.3})", kind.name());
        report(Finding::relative("locking", case, nodal, 1.0, 0.022));
    }
    for &spacing in if quick { &[7.5e-3][..] } else { &[7.5e-3, 5.5e-3] } {
        let [nodal, plain] = [held(Strain::Nodal, spacing)?, held(Strain::PerTriangle, spacing)?];
        let case = format!("held corrugation, {} mm (triangles: {plain:.2})", 1e3 * spacing);
        report(Finding::absolute("locking", case, nodal, 0.0, 4.5));
    }
    Ok(())
}
