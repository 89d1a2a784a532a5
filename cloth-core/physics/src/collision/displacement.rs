//! Displacements relative to their mean. Distances do not change if all vertices are translated.

use energy_dsl::Vector3;

use crate::geometry::{add_scaled, norm, subtract};

/// Returns the length of each displacement relative to their mean, in m. A rounding error of the mean moves all
/// vertices equally, so it changes no distance.
pub(super) fn excursions(from: &[Vector3<f64>], to: &[Vector3<f64>], mean: Vector3<f64>) -> Vec<f64> {
    let excursion = |(from, to): (&Vector3<f64>, &Vector3<f64>)| norm(subtract(subtract(*to, *from), mean));
    from.iter().zip(to).map(excursion).collect()
}

/// Returns the mean of some positions.
pub(super) fn mean(x: &[Vector3<f64>]) -> Vector3<f64> {
    // Four sums at a time do not wait for each other.
    let (fours, rest) = x.as_chunks::<4>();
    let mut sums = [[0.0; 3]; 4];
    for four in fours {
        for (sum, x) in sums.iter_mut().zip(four) {
            *sum = add_scaled(*sum, 1.0, *x);
        }
    }
    let sum = sums.iter().chain(rest).fold([0.0; 3], |sum, x| add_scaled(sum, 1.0, *x));
    sum.map(|component| component / x.len().max(1) as f64)
}

/// Returns the largest absolute value of a coordinate.
pub(super) fn largest_coordinate(x: &[Vector3<f64>]) -> f64 {
    let larger = |a: f64, b: f64| if b > a { b } else { a };
    let (eights, rest) = x.as_flattened().as_chunks::<8>();
    let mut largest = [0.0; 8];
    for eight in eights {
        for (largest, coordinate) in largest.iter_mut().zip(eight) {
            *largest = larger(*largest, coordinate.abs());
        }
    }
    largest.iter().chain(rest).fold(0.0, |largest, coordinate| larger(largest, coordinate.abs()))
}
