//! Pure bending as the tester of KES-F does it: a strip of 1 cm between clamps that turn it along arcs.

use energy_dsl::Vector3;

use super::curve::Curve;
use super::scene::{Keys, SceneText, key, pin};
use super::{TestedFabric, TesterError, Threads};
use crate::geometry::{cross, subtract};
use crate::measure::{Measurements, Reading};
use crate::simulation::Simulation;

/// Length between the clamps, and width, in m. It counts from the middle of the clamped cells.
const LENGTH: f64 = 0.01;
/// Lines at which the strip bends: cells between the middles of the two clamped ones.
const FOLDS: usize = 16;
/// Length of a cell, in m.
const CELL: f64 = LENGTH / FOLDS as f64;
/// Largest curvature, in 1/m.
const CURVATURE: f64 = 250.0;
/// Steps from 0 to the largest curvature.
const QUARTER: i32 = 25;
/// Time of a step, in s.
const STEP: f64 = 0.1;

/// The polygon of a strip that turns by the same angle at every fold: the way from the middle of the first cell to that
/// of the last, and the mean position along it. Its cells keep their length, so that nothing but bending resists.
fn arc(curvature: f64) -> [[f64; 2]; 2] {
    let turn = curvature * CELL;
    let (mut end, mut sum) = ([0.0; 2], [0.0; 2]);
    for cell in 0..=FOLDS {
        let part = if cell == 0 || cell == FOLDS { 0.5 * CELL } else { CELL };
        let (sine, cosine) = (turn * cell as f64).sin_cos();
        let way = [part * cosine, part * sine];
        for axis in 0..2 {
            sum[axis] += part * (end[axis] + 0.5 * way[axis]);
            end[axis] += way[axis];
        }
    }
    [end, sum.map(|sum| sum / LENGTH)]
}

/// The curvature after a number of steps, in 1/m: 0, 250, −250, 0.
fn curvature(step: i32) -> f64 {
    let place = if step <= QUARTER { step } else { (2 * QUARTER - step).max(step - 4 * QUARTER) };
    CURVATURE * f64::from(place) / f64::from(QUARTER)
}

/// Returns the bending test.
pub(super) fn scene(threads: Threads) -> SceneText {
    let key_of = |step: i32| {
        let [[along, up], _] = arc(curvature(step));
        let degrees = (curvature(step) * LENGTH).to_degrees();
        super::scene::Key { angle: degrees, ..key(STEP * f64::from(step), [along - LENGTH, 0.0, up]) }
    };
    let motion = Keys {
        axis: [0.0, -1.0, 0.0],
        centre: [0.5 * LENGTH, 0.0, 0.0],
        keys: (0..=4 * QUARTER).map(key_of).collect(),
    };
    let clamp = |name: &str, sign: f64, motion: &str| {
        let ends = [sign * 0.5 * (LENGTH - 1.2 * CELL), sign * 0.5 * (LENGTH + 1.2 * CELL)];
        pin(name, [ends[0].min(ends[1]), ends[0].max(ends[1])], LENGTH, motion)
    };
    let duration = STEP * f64::from(4 * QUARTER);
    SceneText {
        head: format!(
            "dt = {STEP:?}\nduration = {duration:?}\nframes_per_second = 10\ngravity = [0.0, 0.0, 0.0]\n\
             integrator = \"newton\"\ncontact = \"off\"\ntolerances.velocity = 1e-8\n"
        ),
        mesh: format!(
            "warp = {:?}\n[garment.mesh.sheet]\ncells = [{}, {FOLDS}]\nsize = [{:?}, {LENGTH:?}]\n\
             diagonals = \"alternating\"\n",
            threads.across_clamps(),
            FOLDS + 1,
            LENGTH + CELL,
        ),
        tail: [clamp("fixed clamp", -1.0, ""), clamp("turning clamp", 1.0, &motion.toml())].concat(),
    }
}

/// Returns curvature in 1/m and moment per width in N of a bending test: the mean moment along the strip. Where the
/// clamps also pull, the moment differs from section to section, and the turning is resisted by its mean.
pub(super) fn curve(measured: &Measurements) -> Curve {
    let point = |(step, reading): (usize, &Reading)| {
        let curvature = curvature(step as i32);
        let [_, [along, up]] = arc(curvature);
        let clamp = reading.pins[1];
        let middle = [along - 0.5 * LENGTH, 0.0, up];
        // The moment on the turning clamp about the middle; the clamp turns about −y, so that its own is along +y.
        let lever = cross(subtract(clamp.position, middle), clamp.force);
        [curvature, (clamp.moment[1] + lever[1]) / LENGTH]
    };
    measured.readings.iter().enumerate().map(point).collect()
}

/// Returns curvature in 1/m and moment per width in N of the declared material on the polygon: M = (1/b) dE/dθ, with
/// the stored energy E, the angle θ between the clamps and the width b.
pub(super) fn input(fabric: &TestedFabric, threads: Threads) -> Result<Curve, TesterError> {
    let mut simulation = Simulation::new(&fabric.scene(&scene(threads))?)?;
    let rest = simulation.positions().to_vec();
    let mut energy = |curvature: f64| -> Result<f64, TesterError> {
        let x: Vec<Vector3<f64>> = rest.iter().map(|x| bent(*x, curvature)).collect();
        simulation.set_positions(&x)?;
        Ok(simulation.summary()?.terms.iter().filter_map(|term| term.energy).sum())
    };
    let nudge = 1e-3 * CURVATURE;
    let mut point = |step: i32| {
        let curvature = CURVATURE * f64::from(step) / f64::from(QUARTER);
        let difference = energy(curvature + nudge)? - energy(curvature - nudge)?;
        Ok([curvature, difference / (2.0 * nudge * LENGTH * LENGTH)])
    };
    (-QUARTER..=QUARTER).map(&mut point).collect()
}

/// Places a vertex of the flat strip on the polygon.
fn bent(x: Vector3<f64>, curvature: f64) -> Vector3<f64> {
    let turn = curvature * CELL;
    // The distance from the start of the first cell, in cells.
    let place = (x[0] + 0.5 * (LENGTH + CELL)) / CELL;
    let (mut at, mut rest, mut cell) = ([-0.5, 0.0], place, 0);
    while rest > 1e-9 {
        let (part, (sine, cosine)) = (rest.min(1.0), (turn * f64::from(cell)).sin_cos());
        at = [at[0] + part * cosine, at[1] + part * sine];
        rest -= part;
        cell += 1;
    }
    [at[0] * CELL - 0.5 * LENGTH, x[1], x[2] + at[1] * CELL]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_polygon_keeps_its_length_and_nears_the_arc() {
        let [end, mean] = arc(0.0);
        assert!((end[0] - LENGTH).abs() < 1e-15 && (mean[0] - 0.5 * LENGTH).abs() < 1e-15 && end[1] == 0.0);
        let angle = CURVATURE * LENGTH;
        let [end, mean] = arc(CURVATURE);
        let exact = [angle.sin() / CURVATURE, (1.0 - angle.cos()) / CURVATURE];
        assert!((0..2).all(|axis| (end[axis] - exact[axis]).abs() < 2e-5), "{end:?} {exact:?}");
        // The centroid of an arc lies at (sin(θ/2)/(θ/2)) r from its centre, in the direction of the middle.
        let reach = (0.5 * angle).sin() / (0.5 * angle) / CURVATURE;
        let exact = [reach * (0.5 * angle).sin(), 1.0 / CURVATURE - reach * (0.5 * angle).cos()];
        assert!((0..2).all(|axis| (mean[axis] - exact[axis]).abs() < 2e-5), "{mean:?} {exact:?}");
        let last = bent([0.5 * LENGTH, 0.3, 0.0], CURVATURE);
        assert!(
            (last[0] + 0.5 * LENGTH - end[0]).abs() < 1e-12 && (last[2] - end[1]).abs() < 1e-12,
            "{last:?} {end:?}"
        );
    }
}
