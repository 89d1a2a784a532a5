use std::cell::RefCell;

use energy_dsl::Vector3;
use energy_solve::threads::for_each;

use super::PART;
use super::law::{Barrier, Law, Order, evaluate};
use crate::collision::{Closest, Measured, MeasuredPart, Pair};

/// The pairs in contact, or close to it, in order.
#[derive(Debug, Default)]
pub(super) struct Joined {
    pub pairs: Vec<Pair>,
    pub laws: Vec<Law>,
    /// The pairs where they were last evaluated.
    measured: RefCell<Measured>,
}

/// Pairs that have an energy where they are.
pub(super) struct Active<'a> {
    /// The first pair of the part; `None` for the first part.
    pub first: Option<&'a Pair>,
    /// The first pair of the next part; `None` for the last part.
    pub end: Option<&'a Pair>,
    measured: MeasuredPart<'a>,
    /// Their numbers among the measured pairs.
    numbers: Vec<usize>,
    barriers: Vec<Barrier>,
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

    /// Removes the pairs that have none of these vertices, and returns them with their laws.
    pub fn split_off_others(&mut self, vertices: &[bool]) -> Vec<(Pair, Law)> {
        self.measured.get_mut().clear();
        let all = std::mem::take(&mut self.pairs).into_iter().zip(std::mem::take(&mut self.laws));
        let (kept, others): (Vec<_>, Vec<_>) = all.partition(|(pair, _)| pair.has_any(vertices));
        (self.pairs, self.laws) = kept.into_iter().unzip();
        others
    }

    pub fn contains(&self, pair: &Pair) -> bool {
        self.pairs.binary_search(pair).is_ok()
    }

    /// Evaluates the pairs that have an energy at x. Returns what `of_part` makes of consecutive ones, in order.
    pub fn evaluate<R: Send>(
        &self,
        x: &[Vector3<f64>],
        order: Order,
        threads: usize,
        of_part: impl Fn(&Active<'_>) -> R + Sync,
    ) -> Vec<R> {
        let (pairs, mut measured) = (&self.pairs, self.measured.borrow_mut());
        let parts = measured.at(pairs, x, PART).zip(self.laws.chunks(PART)).enumerate().collect();
        for_each(threads, parts, |(number, (part, laws))| {
            let measured = part.measured();
            let is_active = |&number: &usize| laws[number].is_active(measured.distance(number));
            let numbers: Vec<usize> = (0..laws.len()).filter(is_active).collect();
            let barriers = evaluate(order, laws, measured, &numbers);
            let first = if number == 0 { None } else { measured.pairs.first() };
            let end = pairs.get((number + 1) * PART);
            of_part(&Active { first, end, measured, numbers, barriers })
        })
    }
}

impl Active<'_> {
    /// The number of pairs.
    pub fn len(&self) -> usize {
        self.numbers.len()
    }

    /// The barrier of each pair.
    pub fn barriers(&self) -> &[Barrier] {
        &self.barriers
    }

    /// Each pair with its closest points and its barrier.
    pub fn iter(&self) -> impl Iterator<Item = (&Pair, Closest, &Barrier)> {
        let pair = |&number: &usize| (&self.measured.pairs[number], self.measured.closest(number));
        self.numbers.iter().map(pair).zip(&self.barriers).map(|((pair, closest), barrier)| (pair, closest, barrier))
    }
}
