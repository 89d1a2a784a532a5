//! Displacements relative to their mean. Distances do not change if all vertices are translated.

use energy_dsl::Vector3;

use crate::geometry::{add_scaled, norm, subtract};

/// Returns the length of each displacement relative to their mean, in m.
pub(crate) fn excursions(from: &[Vector3<f64>], to: &[Vector3<f64>]) -> Vec<f64> {
    let mean = mean_displacement(from, to);
    let excursion = |(from, to): (&Vector3<f64>, &Vector3<f64>)| norm(subtract(subtract(*to, *from), mean));
    from.iter().zip(to).map(excursion).collect()
}

/// Returns the mean of to − from. Its rounding error moves all vertices alike, so it changes no distance.
pub(super) fn mean_displacement(from: &[Vector3<f64>], to: &[Vector3<f64>]) -> Vector3<f64> {
    subtract(mean(to), mean(from))
}

/// Returns the mean of some positions.
pub(super) fn mean(x: &[Vector3<f64>]) -> Vector3<f64> {
    let sum = x.iter().fold([0.0; 3], |sum, x| add_scaled(sum, 1.0, *x));
    sum.map(|component| component / x.len().max(1) as f64)
}
