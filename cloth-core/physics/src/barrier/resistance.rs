use energy_dsl::Block;

use crate::collision::{Closest, Pair};
use crate::geometry::dot;

/// The resistance of vertices to displacement, in N/m.
#[derive(Debug, Default)]
pub(super) struct Resistance {
    /// Diagonal blocks of M/h² + ∂²U/∂x² by vertex; `None` for a pinned one.
    pub blocks: Vec<Option<Block<f64>>>,
    /// m/h² by vertex, the least resistance.
    pub inertia: Vec<f64>,
}

impl Resistance {
    /// The resistance of a pair to a displacement along its normal: the mean over free vertices by the squares of c.
    /// The small constant keeps the mean defined while the closest points depend on pinned vertices only.
    pub fn of(&self, pair: &Pair, closest: &Closest) -> f64 {
        let (mut sum, mut weights) = (0.0, 0.0);
        for (vertex, c) in pair.vertices.iter().zip(closest.weights) {
            let vertex = *vertex as usize;
            if let Some(block) = &self.blocks[vertex] {
                let n = closest.normal;
                let along = dot(n, block.map(|row| dot(row, n))).max(self.inertia[vertex]);
                let weight = c * c + 1e-3;
                sum += weight * along;
                weights += weight;
            }
        }
        if weights > 0.0 { sum / weights } else { 0.0 }
    }
}
