//! Expands reduced derivatives to points: weighted sums of the derivatives with respect to linear functions of the
//! points. For differences, the weights are ±1.

use super::coordinates::{Coordinates, add_weighted};
use super::unknowns::Unknowns;
use crate::graph::{Graph, NodeId, symmetric_index, upper};
use energy_runtime::FieldKind;

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
        let n = self.unknowns[point].increments;
        (0..n).map(|axis| self.weighted_sum(g, point, |_, vector| reduced[self.number(vector, axis)])).collect()
    }

    /// Returns the derivatives with respect to all unknowns.
    pub fn expand_all(&self, g: &mut Graph, reduced: &[NodeId]) -> Vec<NodeId> {
        (0..self.unknowns.len()).flat_map(|unknown| self.expand(g, reduced, unknown)).collect()
    }

    /// Returns the second derivatives on and above the diagonal, given the reduced upper triangle: blocks of points, or
    /// numbers row by row for mixed unknowns.
    pub fn expand_symmetric(&self, g: &mut Graph, reduced: &[NodeId], is_mixed: bool) -> Vec<NodeId> {
        if !is_mixed {
            return self.expand_triangle(g, reduced);
        }
        let (n, places) = (self.len(), self.places());
        let entry = |i: usize, j: usize| reduced[symmetric_index(n, i, j)];
        upper(places.len()).map(|(i, j)| self.block_entry(g, places[i], places[j], entry)).collect()
    }

    /// Returns all second derivatives, given the reduced square matrix: blocks of points, or numbers row by row for
    /// mixed unknowns.
    pub fn expand_matrix(&self, g: &mut Graph, reduced: &[NodeId], is_mixed: bool) -> Vec<NodeId> {
        if !is_mixed {
            return self.expand_square(g, reduced);
        }
        let (n, places) = (self.len(), self.places());
        let pairs = places.iter().flat_map(|&row| places.iter().map(move |&column| (row, column)));
        pairs.map(|(row, column)| self.block_entry(g, row, column, |a, b| reduced[a * n + b])).collect()
    }

    /// Returns the plain derivatives of a gradient along the coordinates, row by row, given the second derivatives of its
    /// function (an upper triangle). For a rotation with the torque g they are H_ij + ½ ε_ijk g_k: turning by δ turns the
    /// axes of later increments, too.
    pub fn plain(&self, g: &mut Graph, unknowns: &Unknowns, hessian: &[NodeId], gradient: &[NodeId]) -> Vec<NodeId> {
        let n = self.len();
        let mut square: Vec<NodeId> =
            (0..n * n).map(|entry| hessian[symmetric_index(n, entry / n, entry % n)]).collect();
        let half = g.constant(0.5);
        for (vector, of) in self.vectors.iter().enumerate() {
            if !of.iter().any(|&(unknown, _)| unknowns.list[unknown].kind == FieldKind::Rotation) {
                continue;
            }
            for (i, j, k) in [(0, 1, 2), (1, 2, 0), (2, 0, 1)] {
                let [i, j, k] = [i, j, k].map(|axis| self.number(vector, axis));
                let torque = g.mul(half, gradient[k]);
                square[i * n + j] = g.add(square[i * n + j], torque);
                square[j * n + i] = g.sub(square[j * n + i], torque);
            }
        }
        square
    }

    /// Returns the unknown and the component of each coordinate in which the unknowns move.
    fn places(&self) -> Vec<(usize, usize)> {
        let list = self.unknowns.iter().enumerate();
        list.flat_map(|(number, unknown)| (0..unknown.increments).map(move |axis| (number, axis))).collect()
    }

    /// Returns the blocks on and above the diagonal, row by row, given the reduced upper triangle.
    fn expand_triangle(&self, g: &mut Graph, reduced: &[NodeId]) -> Vec<NodeId> {
        let (n, points) = (self.len(), self.unknowns.len());
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
    fn expand_square(&self, g: &mut Graph, reduced: &[NodeId]) -> Vec<NodeId> {
        let (n, points) = (self.len(), self.unknowns.len());
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
        self.weighted_sum(g, i, |g, a| {
            self.weighted_sum(g, j, |_, b| entry(self.number(a, row), self.number(b, column)))
        })
    }
}
