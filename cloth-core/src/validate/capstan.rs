//! A strip that is pulled over a rail: friction lets the tension grow by e^{μφ} along the angle φ (Euler 1769).

use super::contact::{advance, simulation};
use super::{Finding, ValidateError};
use crate::geometry::{norm, subtract};
use crate::simulation::Simulation;

/// Half the length of the strip, in m.
const HALF: f64 = 0.36;
/// The length at either end over which the tension is measured, in m.
const FREE: f64 = 0.1;

/// The strip is laid over the rail, and then its right end is pulled on.
fn strip(friction: f64) -> Result<Simulation, ValidateError> {
    let pin = |low: f64, high: f64, keys: &str| {
        format!(
            "[[pins]]\nbox = {{ min = [{low:?}, -1.0, -1.0], max = [{high:?}, 1.0, 1.0] }}\nmotion.keys = [{keys}]\n"
        )
    };
    let laid = |side: f64| format!("{{ time = 0.0 }}, {{ time = 0.6, translate = [{:?}, 0.0, -0.256] }}", side * 0.11);
    let pulled = format!(
        "{}, {{ time = 0.8, translate = [-0.11, 0.0, -0.256] }}, {{ time = 2.0, translate = [-0.098, 0.0, -0.278] }}",
        laid(-1.0)
    );
    let ends = pin(-1.0, 1e-4 - HALF, &laid(1.0)) + &pin(HALF - 1e-4, 1.0, &pulled);
    simulation(&format!(
        "dt = 0.01\nduration = 2.0\nintegrator = \"newton\"\ncontact = \"obstacles\"\nadaptive = true\n\
         tolerances.velocity = 1e-5\ngravity = [0.0, 0.0, 0.0]\ndrag = 2.0\n\
         [[garment]]\nplacement.translate = [0.0, 0.0, 0.106]\n\
         mesh.strip = {{ length = {:?}, width = 0.03, segments = 72 }}\n\
         fabric = {{ density = 0.2, material.stvk = {{ stretch_stiffness = 40.0, poisson_ratio = 0.0, \
         bending.flat.stiffness = 1e-6 }} }}\n\
         {ends}[[obstacles]]\ncapsule = {{ from = [0.0, -0.3, 0.0], to = [0.0, 0.3, 0.0], radius = 0.1 }}\n\
         friction = {friction:?}\n",
        2.0 * HALF
    ))
}

/// Returns the tension over the stiffness, λ (λ² − 1)/2 of the stretch λ, and the angle between two columns of
/// vertices, given their places along the strip at rest.
fn tension(rest: &[[f64; 3]], x: &[[f64; 3]], from: f64, to: f64) -> [f64; 2] {
    let column = |at: f64| {
        let vertices: Vec<usize> = (0..x.len()).filter(|&vertex| (rest[vertex][0] - at).abs() < 1e-6).collect();
        let sum = |axis: usize| vertices.iter().map(|&vertex| x[vertex][axis]).sum::<f64>();
        [0, 1, 2].map(|axis| sum(axis) / vertices.len() as f64)
    };
    let along = subtract(column(to), column(from));
    let stretch = norm(along) / (to - from);
    [0.5 * stretch * (stretch * stretch - 1.0), along[2].atan2(along[0])]
}

pub(super) fn ask(friction: f64, report: &mut dyn FnMut(Finding)) -> Result<(), ValidateError> {
    let mut simulation = strip(friction)?;
    let rest = simulation.positions().to_vec();
    let steps = simulation.steps();
    advance(&mut simulation, steps)?;
    let x = simulation.positions();
    let ([held, start], [pulled, end]) = (tension(&rest, x, -HALF, FREE - HALF), tension(&rest, x, HALF - FREE, HALF));
    let angle = start - end;
    let case = format!("capstan, μ {friction}, φ {:.1}°: ratio of tensions", angle.to_degrees());
    report(Finding::relative("contact", case, pulled / held, (friction * angle).exp(), 0.02));
    Ok(())
}
