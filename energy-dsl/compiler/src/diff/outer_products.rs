//! Sums of outer products, which second derivatives are.

use std::collections::BTreeMap;

use super::accumulate;
use super::forward::{Sparse, combine, products};
use crate::graph::{Graph, NodeId};

/// A way to add up sums of products, and the sums of the entries of an upper triangle.
pub(super) trait Summation {
    /// Returns Σ factorᵢ · partsᵢ.
    fn combine(&self, g: &mut Graph, terms: &[(NodeId, &Sparse)]) -> Sparse;

    /// Begins the terms of another origin.
    fn next(&mut self);

    /// Adds Σ weights · a aᵀ; or Σ weights · a bᵀ + Σ weights · b aᵀ, where the latter has the weights in reverse order.
    fn add(&mut self, g: &mut Graph, weights: &[NodeId], of: (&Sparse, &Sparse), same: bool);

    /// Adds x · y to an entry.
    fn add_to_entry(&mut self, g: &mut Graph, place: (usize, usize), x: NodeId, y: NodeId);

    /// Returns the entries; (i, j) is at i · n + j.
    fn entries(self, g: &mut Graph) -> BTreeMap<usize, NodeId>;
}

/// Terms are added as they come.
#[derive(Default)]
pub(super) struct AsTheyCome {
    n: usize,
    sums: BTreeMap<usize, NodeId>,
}

impl AsTheyCome {
    pub(super) fn new(n: usize) -> Self {
        Self { n, sums: BTreeMap::new() }
    }
}

impl Summation for AsTheyCome {
    fn combine(&self, g: &mut Graph, terms: &[(NodeId, &Sparse)]) -> Sparse {
        combine(g, terms)
    }

    fn next(&mut self) {}

    fn add(&mut self, g: &mut Graph, weights: &[NodeId], (a, b): (&Sparse, &Sparse), same: bool) {
        let weight = g.sum(weights.to_vec());
        // Weights the shorter factor, which takes fewer products.
        let (shorter, longer) = if a.len() <= b.len() { (a, b) } else { (b, a) };
        let weighted: Sparse = shorter.iter().map(|&(c, part)| (c, g.mul(weight, part))).collect();
        for (place, term) in products(g, &weighted, longer, same, self.n) {
            accumulate(g, &mut self.sums, place, term);
        }
    }

    fn add_to_entry(&mut self, g: &mut Graph, (i, j): (usize, usize), x: NodeId, y: NodeId) {
        let term = g.mul(x, y);
        accumulate(g, &mut self.sums, i * self.n + j, term);
    }

    fn entries(self, _: &mut Graph) -> BTreeMap<usize, NodeId> {
        self.sums
    }
}
