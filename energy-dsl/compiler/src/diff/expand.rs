//! Expands reduced derivatives to points: weighted sums of the derivatives with respect to linear functions of the
//! points. For differences, the weights are ±1.

use super::coordinates::{Coordinates, add_weighted};
use crate::graph::{Graph, NodeId, symmetric_index};

impl Coordinates {
    /// Returns the weight of `point` in a coordinate vector; `None` if it is not part of it.
    fn weight(&self, vector: usize, point: usize) -> Option<f64> {
        self.vectors[vector].iter().find(|&&(p, _)| p == point).map(|&(_, weight)| weight)
    }

    /// Returns the weighted sum of `entry` over the vectors that contain `point`.
    fn weighted_sum(&self, g: &mut Graph, point: usize, mut entry: impl FnMut(&mut Graph, usize) -> NodeId) -> NodeId {
        let mut sum = g.constant(0.0);
        for vector in 0..self.vectors.len() {
            let Some(weight) = self.weight(vector, point) else { continue };
            let term = entry(g, vector);
            sum = add_weighted(g, sum, weight, term);
        }
        sum
    }

    /// Returns the derivative with respect to one point, given those with respect to the coordinates.
    pub fn expand(&self, g: &mut Graph, reduced: &[NodeId], point: usize) -> Vec<NodeId> {
        let n = self.components;
        (0..n).map(|axis| self.weighted_sum(g, point, |_, vector| reduced[n * vector + axis])).collect()
    }

    /// Returns the derivatives with respect to all points.
    pub fn expand_all(&self, g: &mut Graph, reduced: &[NodeId], points: usize) -> Vec<NodeId> {
        (0..points).flat_map(|point| self.expand(g, reduced, point)).collect()
    }

    /// Returns the blocks on and above the diagonal, row by row, given the reduced upper triangle.
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

    /// Returns all blocks, row by row, given the reduced square matrix.
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
        // The inner sum runs over the vectors of the column, so that points in the same row share it.
        self.weighted_sum(g, i, |g, a| self.weighted_sum(g, j, |_, b| entry(3 * a + row, 3 * b + column)))
    }
}
