//! A weightless strip that hangs from a clamp onto the floor, its tip directly below. The clamp is lowered by ε times
//! the length of the strip, which buckles. The tip sticks until the force on it leaves the cone of friction, at ε_c.

use energy_dsl::Vector3;

use super::contact::{advance, placed};
use super::{Finding, ValidateError};
use crate::simulation::Simulation;

/// Length between the tip and the midpoint of the two clamped rows, in m.
const LENGTH: f64 = 0.3;
/// Distance at which contact with the floor begins, in m.
const REACH: f64 = 1e-4;
/// Way of the tip by which it has slipped, in m: many bristles.
const SLIPPED: f64 = 5e-4;
/// Steps in which the clamp is lowered to 1.1 ε_c.
const STEPS: u64 = 600;
const DT: f64 = 0.01;

/// μ with ε_c.
const ANSWERS: [(f64, f64); 3] = [(0.1, 0.046_874), (0.2, 0.154_867), (0.3, 0.271_563)];

fn strip(segments: usize, friction: f64, lowered: f64) -> Result<Simulation, ValidateError> {
    let cell = LENGTH / (segments as f64 - 0.5);
    let whole = cell * segments as f64;
    let time = STEPS as f64 * DT;
    let text = format!(
        "dt = {DT:?}\nduration = {time:?}\nintegrator = \"newton\"\ncontact = \"obstacles\"\nadaptive = true\n\
         tolerances.velocity = 1e-6\ngravity = [0.0, 0.0, 0.0]\ndrag = 20.0\n\
         [[garment]]\nname = \"strip\"\nplacement.translate = [0.0, 0.0, {:?}]\n\
         mesh.sheet = {{ cells = [2, {segments}], size = [{:?}, {whole:?}], diagonals = \"alternating\", \
         plane = \"vertical\" }}\nfabric = {{ density = 0.1, material.stvk = {{ stretch_stiffness = 1e4, \
         poisson_ratio = 0.0, bending.plate.flexural = {{ rigidity = 1e-2, poisson_ratio = 0.0 }} }} }}\n\
         [[pins]]\nbox = {{ min = [-1.0, -1.0, {:?}], max = [1.0, 1.0, 1.0] }}\n\
         motion.keys = [{{ time = 0.0 }}, {{ time = {time:?}, translate = [0.0, 0.0, {:?}] }}]\n\
         [[obstacles]]\nplane = {{ point = [0.0, 0.0, {:?}] }}\nthickness = {REACH:?}\nfriction = {friction:?}\n",
        0.5 * whole,
        2.0 * cell,
        whole - 1.5 * cell,
        -lowered * LENGTH,
        -0.9 * REACH,
    );
    // A small bow decides to which side the strip buckles.
    let bow = move |x: Vector3<f64>| {
        let part = (x[2] / (whole - cell)).clamp(0.0, 1.0);
        [x[0], 1e-3 * LENGTH * (part * (1.0 - part)).powi(2) * 16.0, x[2]]
    };
    placed(&text, move |_, x| bow(x))
}

/// Returns the lowering over the length at which the tip slips; NaN if it does not.
fn slips(segments: usize, friction: f64, exact: f64) -> Result<f64, ValidateError> {
    let mut simulation = strip(segments, friction, 1.1 * exact)?;
    let top = simulation.positions().len() - 1;
    // The distance of the tip from the midpoint of the clamp, in m.
    let height = |simulation: &Simulation| {
        let x = simulation.positions();
        0.5 * (x[top][2] + x[top - 3][2]) - x[1][2]
    };
    for _ in 0..STEPS {
        let before = height(&simulation);
        advance(&mut simulation, 1)?;
        if simulation.positions()[1][1].abs() > SLIPPED {
            return Ok(1.0 - before / LENGTH);
        }
    }
    Ok(f64::NAN)
}

pub(super) fn ask(quick: bool, report: &mut dyn FnMut(Finding)) -> Result<(), ValidateError> {
    if quick {
        return Ok(());
    }
    for (friction, exact) in ANSWERS {
        let case = format!("strip buckled onto the floor, μ {friction}: tip slips at ε");
        report(Finding::relative("contact", case, slips(40, friction, exact)?, exact, 0.02));
    }
    Ok(())
}
