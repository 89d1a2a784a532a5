//! From reduced coordinates back to points: x-derivatives are constant ±1 combinations of those by differences.

use super::coordinates::Coordinates;
use crate::graph::{Graph, NodeId, symmetric_index};

impl Coordinates {
    /// With which sign coordinate vector `vector` contains `point`, if it does.
    fn sign(&self, vector: usize, point: usize) -> Option<bool> {
        self.vectors[vector].iter().find(|&&(p, _)| p == point).map(|&(_, positive)| positive)
    }

    /// Σ over the vectors that contain `point`, with its sign, of what `entry` gives for them.
    fn signed_sum(&self, g: &mut Graph, point: usize, mut entry: impl FnMut(&mut Graph, usize) -> NodeId) -> NodeId {
        let mut sum = g.constant(0.0);
        for vector in 0..self.vectors.len() {
            let Some(positive) = self.sign(vector, point) else { continue };
            let term = entry(g, vector);
            sum = if positive { g.add(sum, term) } else { g.sub(sum, term) };
        }
        sum
    }

    /// The derivative by one point, of its derivatives by the coordinates.
    pub fn expand(&self, g: &mut Graph, reduced: &[NodeId], point: usize) -> Vec<NodeId> {
        let n = self.components;
        (0..n).map(|axis| self.signed_sum(g, point, |_, vector| reduced[n * vector + axis])).collect()
    }

    /// The derivatives by all points.
    pub fn expand_all(&self, g: &mut Graph, reduced: &[NodeId], points: usize) -> Vec<NodeId> {
        (0..points).flat_map(|point| self.expand(g, reduced, point)).collect()
    }

    /// The blocks on and above the diagonal, each row by row, of the upper triangle in reduced coordinates.
    pub fn expand_triangle(&self, g: &mut Graph, reduced: &[NodeId], points: usize) -> Vec<NodeId> {
        let n = self.len();
        let entry = |i: usize, j: usize| reduced[symmetric_index(n, i, j)];
        let mut triangle = Vec::with_capacity(9 * points * (points + 1) / 2);
        for i in 0..points {
            for j in i..points {
                let start = triangle.len();
                for row in 0..3 {
                    for column in 0..3 {
                        let node = if i == j && column < row {
                            triangle[start + 3 * column + row]
                        } else {
                            self.block_entry(g, (i, row), (j, column), entry)
                        };
                        triangle.push(node);
                    }
                }
            }
        }
        triangle
    }

    /// All blocks, each row by row, of a square matrix in reduced coordinates.
    pub fn expand_square(&self, g: &mut Graph, reduced: &[NodeId], points: usize) -> Vec<NodeId> {
        let n = self.len();
        let mut square = Vec::with_capacity(9 * points * points);
        for i in 0..points {
            for j in 0..points {
                for row in 0..3 {
                    for column in 0..3 {
                        square.push(self.block_entry(g, (i, row), (j, column), |a, b| reduced[a * n + b]));
                    }
                }
            }
        }
        square
    }

    fn block_entry(
        &self,
        g: &mut Graph,
        (i, row): (usize, usize),
        (j, column): (usize, usize),
        entry: impl Fn(usize, usize) -> NodeId,
    ) -> NodeId {
        // The inner sum runs over the column's vectors, so that points in the same row share it.
        self.signed_sum(g, i, |g, a| self.signed_sum(g, j, |_, b| entry(3 * a + row, 3 * b + column)))
    }
}
