//! Rods that bend far: hanging curls, a bent cantilever, and a rod that a moment closes to a circle.

use super::ValidateError;
use super::rod::{Ends, Rod, Vector, arc, weights};
use crate::geometry::{norm, subtract};

/// Returns how far a naturally curved rod that hangs from a clamp reaches sideways and down, over its length L = 1.
pub(super) fn hanging_curl(weight: f64, curvature: f64, segments: usize) -> Result<[f64; 2], ValidateError> {
    // The clamp points down. The weight straightens the curl, so the search starts with a straight rod.
    let points: Vec<Vector> = arc(1.0, 0.0, segments).into_iter().map(|[x, _, z]| [z, 0.0, -x]).collect();
    // Stiff against leaving the plane, as a tape is: a round rod would.
    let mut rod = Rod::new(points, [0.0, 1.0, 0.0], Ends::Clamped, [1.0, 100.0], 100.0);
    rod.curvature = -curvature;
    rod.loads = weights(segments + 2, 1.0 / segments as f64, [0.0, 0.0, -weight]);
    let mut loaded = rod.at_rest()?;
    loaded.raise(1)?;
    let [x, _, z] = loaded.tip();
    Ok([x, -z])
}

/// Returns the displacement of the tip of Bathe and Bolourchi's bend: an eighth of a circle, with a load across its
/// plane.
pub(super) fn bent_cantilever(segments: usize) -> Result<Vector, ValidateError> {
    const RADIUS: f64 = 100.0;
    let modulus: f64 = 1e7;
    let points = arc(RADIUS * std::f64::consts::FRAC_PI_4, 1.0 / RADIUS, segments);
    let (bending, twisting) = ([modulus / 12.0; 2], 0.1406 * modulus / 2.0);
    let mut rod = Rod::new(points.clone(), [0.0, 1.0, 0.0], Ends::Clamped, bending, twisting);
    rod.curvature = -1.0 / RADIUS;
    // The load would stretch the rod by 10⁻⁴ otherwise.
    rod.stretching *= 1e3;
    rod.loads[segments + 1] = [0.0, 600.0, 0.0];
    let mut loaded = rod.at_rest()?;
    loaded.raise(10)?;
    Ok(subtract(loaded.tip(), points[segments + 1]))
}

/// Returns the distance between the ends of a rod of length 1 that the moment 2π B/L at its tip bends to a circle.
pub(super) fn closed_circle(segments: usize) -> Result<f64, ValidateError> {
    // Stiff against leaving the plane: under a moment about a fixed axis, a round rod does.
    let rod = Rod::new(arc(1.0, 0.0, segments), [0.0, 1.0, 0.0], Ends::Clamped, [1.0, 100.0], 100.0);
    let moment = rod.moments(&[(segments, std::f64::consts::TAU, [0.0, 1.0, 0.0])])?;
    let mut loaded = rod.at_rest_with(vec![moment])?;
    loaded.raise(20)?;
    Ok(norm(loaded.tip()))
}
