//! Plates and roofs under small loads.

use super::grid::{Grid, Material, Support, Vector};
use crate::validate::ValidateError;

/// Returns w D/(q a⁴) in the middle of a square plate with ν = 0.3 (Timoshenko and Woinowsky-Krieger 1959).
pub(super) fn deflection(clamped: bool, cells: usize) -> Result<f64, ValidateError> {
    let grid = Grid::new([cells; 2], [1.0; 2], |[x, y]| [x, y, 0.0]);
    let material = Material { stretching: 1e3, bending: 1.0, poisson_ratio: 0.3 };
    // The deflection is a millionth of the size: without tension in the plate.
    let load = 1e-3;
    let support = Support { fixed: grid.border(), clamped, load: [0.0, 0.0, load], ..Support::default() };
    let (points, report) = grid.settle(material, &support, &grid.rest)?;
    if !report.converged() {
        return Err(ValidateError::NoRest(report));
    }
    Ok(points[grid.point(cells / 2, cells / 2)][2] / load)
}

/// Returns how far the free edge of the roof of Scordelis and Lo sinks in its middle (MacNeal and Harder 1985): an arc
/// of 80° of a cylinder, on walls at both ends that hold their plane.
pub(super) fn roof(cells: usize) -> Result<f64, ValidateError> {
    const RADIUS: f64 = 25.0;
    const LENGTH: f64 = 50.0;
    const THICKNESS: f64 = 0.25;
    const MODULUS: f64 = 4.32e8;
    const WEIGHT: f64 = 90.0;
    let angle: f64 = 80_f64.to_radians();
    let place = |[along, around]: [f64; 2]| -> Vector {
        let (sine, cosine) = (around / RADIUS - 0.5 * angle).sin_cos();
        [along, RADIUS * sine, RADIUS * cosine]
    };
    let grid = Grid::new([cells; 2], [LENGTH, RADIUS * angle], place);
    let stretching = MODULUS * THICKNESS;
    let material = Material { stretching, bending: stretching * THICKNESS * THICKNESS / 12.0, poisson_ratio: 0.0 };
    let walls = [0, cells].into_iter().flat_map(|i| (0..=cells).map(move |j| (i, j)));
    let mut held: Vec<(usize, Vector)> =
        walls.map(|(i, j)| (grid.point(i, j), [0.0, 1e3 * stretching, 1e3 * stretching])).collect();
    // Nothing else keeps the roof from sliding along its axis.
    held.push((grid.point(cells / 2, cells / 2), [stretching, 0.0, 0.0]));
    // The answer is that of linear theory.
    let part = 1e-4;
    let support = Support { held, load: [0.0, 0.0, -part * WEIGHT], ..Support::default() };
    let (points, report) = grid.settle(material, &support, &grid.rest)?;
    if !report.converged() {
        return Err(ValidateError::NoRest(report));
    }
    let edge = grid.point(cells / 2, 0);
    Ok((grid.rest[edge][2] - points[edge][2]) / part)
}
