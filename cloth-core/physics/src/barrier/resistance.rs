use energy_solve::Resistance;

use crate::collision::{Closest, Pair};
use crate::geometry::dot;

/// The resistance of a pair to a displacement along its normal, in N/m: the mean over free vertices by the squares of
/// c. The small constant keeps the mean defined while the closest points depend on pinned vertices only.
pub(super) fn along_normal(resistance: &Resistance, pair: &Pair, closest: &Closest) -> f64 {
    let (mut sum, mut weights) = (0.0, 0.0);
    for (vertex, c) in pair.vertices.iter().zip(closest.weights) {
        let vertex = *vertex as usize;
        if let Some(block) = &resistance.blocks[vertex] {
            let n = closest.normal;
            let along = dot(n, block.map(|row| dot(row, n))).max(resistance.inertia[vertex]);
            let weight = c * c + 1e-3;
            sum += weight * along;
            weights += weight;
        }
    }
    if weights > 0.0 { sum / weights } else { 0.0 }
}
