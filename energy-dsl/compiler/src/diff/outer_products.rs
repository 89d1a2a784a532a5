//! Sums of outer products, which second derivatives are.

use std::collections::BTreeMap;

use super::accumulate;
use super::forward::{Sparse, combine, products};
use crate::graph::{Graph, NodeId, Product, upper};

/// A way to add up sums of products, and the sums of the entries of an upper triangle.
pub(super) trait Summation {
    /// Returns Σ factorᵢ · partsᵢ.
    fn combine(&self, g: &mut Graph, terms: &[(NodeId, &Sparse)]) -> Sparse;

    /// Begins the terms of another origin.
    fn next(&mut self);

    /// Adds weight · a aᵀ, or weight · (a bᵀ + b aᵀ).
    fn add(&mut self, g: &mut Graph, weight: NodeId, of: (&Sparse, &Sparse), same: bool);

    /// Adds Σ wᵢⱼ aᵢ aⱼᵀ for a symmetric matrix w, each entry a sum of products.
    fn add_form(&mut self, g: &mut Graph, form: &[Vec<Product>], of: &[&Sparse]);

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

    fn add_form(&mut self, g: &mut Graph, form: &[Vec<Product>], of: &[&Sparse]) {
        for (i, j) in upper(of.len()) {
            let products: Vec<NodeId> = form[i * of.len() + j].iter().map(|product| g.product(None, product)).collect();
            let weight = g.sum(products);
            self.add(g, weight, (of[i], of[j]), i == j);
        }
    }

    fn add(&mut self, g: &mut Graph, weight: NodeId, (a, b): (&Sparse, &Sparse), same: bool) {
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
