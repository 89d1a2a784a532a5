use std::cell::RefCell;

use energy_dsl::Vector3;

use super::law::{Barrier, Law, Order, evaluate};
use crate::collision::{Closest, Measured, Pair};

/// The pairs in contact, or close to it, in order.
#[derive(Debug, Default)]
pub(super) struct Joined {
    pub pairs: Vec<Pair>,
    pub laws: Vec<Law>,
    /// The pairs where they were last evaluated.
    measured: RefCell<Measured>,
}

impl Joined {
    pub fn clear(&mut self) {
        self.pairs.clear();
        self.laws.clear();
        self.measured.get_mut().clear();
    }

    /// Adds pairs that are not yet here.
    pub fn extend(&mut self, added: impl Iterator<Item = (Pair, Law)>) {
        let known = std::mem::take(&mut self.pairs).into_iter().zip(std::mem::take(&mut self.laws));
        let mut all: Vec<(Pair, Law)> = known.chain(added).collect();
        // Two runs in order are merged in linear time.
        all.sort_by_key(|(pair, _)| *pair);
        (self.pairs, self.laws) = all.into_iter().unzip();
        self.measured.get_mut().clear();
    }

    pub fn contains(&self, pair: &Pair) -> bool {
        self.pairs.binary_search(pair).is_ok()
    }

    /// Calls `found` with each pair that has an energy at x, its closest points and its barrier.
    pub fn for_each_active(&self, x: &[Vector3<f64>], order: Order, mut found: impl FnMut(&Pair, &Closest, Barrier)) {
        let mut measured = self.measured.borrow_mut();
        measured.measure(&self.pairs, x, 1);
        let is_active = |&number: &usize| self.laws[number].is_active(measured.distance(number));
        let active: Vec<usize> = (0..self.pairs.len()).filter(is_active).collect();
        for (&number, barrier) in active.iter().zip(evaluate(order, &self.laws, &measured, &active)) {
            found(&self.pairs[number], &measured.closest(number), barrier);
        }
    }
}
