//! Flat sheets whose natural curvature κ₀ is the same in all directions.

use super::grid::{Grid, Material, Support, Vector};
use crate::geometry::{cross, norm, subtract};
use crate::validate::ValidateError;

/// Returns the curvature in the middle of a free sheet of length 1, over κ₀. A narrow one bends by κ₀ along and across.
/// A wide one cannot, as its area would stretch: it rolls up by (1 + ν) κ₀.
pub(super) fn curvature(width: f64, cells: [usize; 2]) -> Result<f64, ValidateError> {
    let (poisson_ratio, natural): (f64, f64) = (0.3, 0.5);
    let thickness = 2e-3_f64;
    let grid = Grid::new(cells, [1.0, width], |[x, y]| [x, y, 0.0]);
    let stretching = 12.0 * (1.0 - poisson_ratio * poisson_ratio) / (thickness * thickness);
    let material = Material { stretching, bending: 1.0, poisson_ratio };
    let (i, j) = (cells[0] / 2, cells[1] / 2);
    // One triangle keeps the sheet from moving as a rigid body.
    let fixed = vec![grid.point(i, j), grid.point(i + 1, j), grid.point(i, j + 1)];
    let support = Support { fixed, curvature: natural, ..Support::default() };
    // Rolled up at the start: a square has two ways to do so.
    let middle = grid.rest[grid.point(i, j)][0];
    let start: Vec<Vector> = grid.rest.iter().map(|&[x, y, _]| rolled([x, y], middle, natural)).collect();
    let (points, report) = grid.settle(material, &support, &start)?;
    if !report.converged() {
        return Err(ValidateError::NoRest(report));
    }
    let [a, b, c] = [i - 3, i, i + 3].map(|i| points[grid.point(i, j)]);
    Ok(circle_curvature(a, b, c) / natural)
}

/// Returns a point of a sheet that is rolled up along x. The line at `middle` stays where it is.
fn rolled([x, y]: [f64; 2], middle: f64, curvature: f64) -> Vector {
    let (sine, cosine) = (curvature * (x - middle)).sin_cos();
    [middle + sine / curvature, y, -(1.0 - cosine) / curvature]
}

/// Returns the curvature of the circle through three points: four times the area of their triangle over the product of
/// its sides.
fn circle_curvature(a: Vector, b: Vector, c: Vector) -> f64 {
    let sides = [subtract(b, a), subtract(c, b), subtract(a, c)];
    2.0 * norm(cross(sides[0], sides[1])) / sides.map(norm).iter().product::<f64>()
}
