//! A strip folded between two plates. It lies flat beyond the lines of contact, so the curvature begins there at 0.
//! With θ the angle to the plates, D θ′²/2 = P sin θ, where P is the force per width. The distance H of the plates is
//! H = 2 ∫ sin θ ds = 2 √(D/2P) ∫₀^{π/2} √(sin θ) dθ, and P H²/D = 2.8711, κ_max H = 2.3963.

use std::f64::consts::PI;

use energy_dsl::Vector3;

use super::contact::{advance, contact_forces, placed};
use super::{Finding, ValidateError};
use crate::geometry::{norm, subtract};
use crate::simulation::Simulation;

/// Distance of the plates, in m, measured between the middles of the strip's legs.
const HEIGHT: f64 = 0.1;
/// Length of the strip, in m: each leg lies flat for about one height.
const LENGTH: f64 = 0.42;
/// D, in N m.
const RIGIDITY: f64 = 1e-2;
/// Distance at which contact with a plate begins, in m.
const REACH: f64 = 2e-4;
/// Cells across the strip.
const ACROSS: usize = 2;

fn strip(segments: usize) -> Result<Simulation, ValidateError> {
    let width = width(segments);
    let text = format!(
        "dt = 0.01\nduration = 1.0\nintegrator = \"newton\"\ncontact = \"obstacles\"\nadaptive = true\n\
         tolerances = {{ velocity = 1e-7, linear = 1e-3 }}\n\
         gravity = [0.0, 0.0, 0.0]\ndrag = 20.0\n\
         [mesh.sheet]\ncells = [{segments}, {ACROSS}]\nsize = [{LENGTH:?}, {width:?}]\ndiagonals = \"alternating\"\n\
         [fabric]\ndensity = 0.1\nmaterial.stvk = {{ stretch_stiffness = 1e4, poisson_ratio = 0.0, \
         bending.plate.flexural = {{ rigidity = {RIGIDITY:?}, poisson_ratio = 0.0 }} }}\n\
         [[obstacles]]\nplane = {{ point = [0.0, 0.0, {:?}] }}\nthickness = {REACH:?}\n\
         [[obstacles]]\nplane = {{ point = [0.0, 0.0, {:?}], normal = [0.0, 0.0, -1.0] }}\nthickness = {REACH:?}\n",
        -0.8 * REACH,
        HEIGHT + 0.8 * REACH,
    );
    placed(&text, |_, x| folded(x))
}

fn width(segments: usize) -> f64 {
    LENGTH / segments as f64 * ACROSS as f64
}

/// Lays a point of the flat strip onto two straight legs and a half circle.
fn folded([along, y, _]: Vector3<f64>) -> Vector3<f64> {
    let (radius, beyond) = (0.5 * HEIGHT, along.abs() - 0.25 * PI * HEIGHT);
    if beyond > 0.0 {
        return [-beyond, y, radius * (1.0 + along.signum())];
    }
    let angle = along / radius;
    [radius * angle.cos(), y, radius * (1.0 + angle.sin())]
}

/// Returns P H²/D and κ_max H.
fn measured(simulation: &Simulation, segments: usize) -> [f64; 2] {
    let x = simulation.positions();
    let middle: Vec<Vector3<f64>> = x[segments + 1..2 * (segments + 1)].to_vec();
    let extreme = |best: fn(f64, f64) -> f64, from: f64| middle.iter().map(|x| x[2]).fold(from, best);
    let height = extreme(f64::max, f64::NEG_INFINITY) - extreme(f64::min, f64::INFINITY);
    // Both plates push with the same force.
    let push: f64 = contact_forces(simulation).iter().map(|force| 0.5 * force[2].abs()).sum();
    let bend = |corner: &[Vector3<f64>]| {
        let (before, after) = (subtract(corner[1], corner[0]), subtract(corner[2], corner[1]));
        let turn = before[0] * after[2] - before[2] * after[0];
        let along = before[0] * after[0] + before[2] * after[2];
        turn.atan2(along) / (0.5 * (norm(before) + norm(after)))
    };
    let sharpest = middle.windows(3).map(bend).fold(0.0, f64::max);
    [push / width(segments) * height * height / RIGIDITY, sharpest * height]
}

pub(super) fn ask(quick: bool, report: &mut dyn FnMut(Finding)) -> Result<(), ValidateError> {
    if quick {
        return Ok(());
    }
    for segments in [40, 80] {
        let mut simulation = strip(segments)?;
        advance(&mut simulation, 300)?;
        let [push, bend] = measured(&simulation, segments);
        let limit = if segments < 80 { 0.03 } else { 0.01 };
        let case = |what: &str| format!("fold between plates, {segments} segments: {what}");
        report(Finding::relative("contact", case("P H²/D"), push, 2.871_1, limit));
        report(Finding::relative("contact", case("κ H"), bend, 2.396_3, limit));
    }
    Ok(())
}
