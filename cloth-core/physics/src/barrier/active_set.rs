use std::cell::RefCell;

use energy_dsl::Vector3;
use energy_solve::threads::for_each;

use super::PART;
use super::law::{Barrier, Law, Order, evaluate};
use crate::collision::{Closest, Measured, MeasuredPart, Pair};

/// The pairs in contact, or close to it, in order. Only some of them have an energy where they are.
#[derive(Debug, Default)]
pub(super) struct ActiveSet {
    pub pairs: Vec<Pair>,
    pub laws: Vec<Law>,
    /// All pairs before those of some vertices were selected.
    unrestricted: Option<(Vec<Pair>, Vec<Law>)>,
    /// The pairs where they were last evaluated.
    measured: RefCell<Measured>,
}

/// The pairs of a part of the active set that have an energy where they are.
pub(super) struct ActivePart<'a> {
    /// The first pair of the part; `None` for the first part.
    pub first: Option<&'a Pair>,
    /// The first pair of the next part; `None` for the last part.
    pub end: Option<&'a Pair>,
    measured: MeasuredPart<'a>,
    /// Their numbers among the measured pairs.
    numbers: Vec<usize>,
    barriers: Vec<Barrier>,
}

impl ActiveSet {
    pub fn clear(&mut self) {
        self.pairs.clear();
        self.laws.clear();
        self.measured.get_mut().clear();
    }

    /// Adds pairs that are not yet here.
    pub fn extend(&mut self, mut added: Vec<(Pair, Law)>) {
        added.sort_unstable_by_key(|(pair, _)| *pair);
        let mut before = self.pairs.len();
        self.pairs.extend(added.iter().map(|(pair, _)| *pair));
        self.laws.extend(added.iter().map(|(_, law)| *law));
        // The last ones first, so that each active pair moves once at most.
        for (number, (pair, law)) in added.into_iter().enumerate().rev() {
            while before > 0 && self.pairs[before - 1] > pair {
                before -= 1;
                self.pairs[before + number + 1] = self.pairs[before];
                self.laws[before + number + 1] = self.laws[before];
            }
            (self.pairs[before + number], self.laws[before + number]) = (pair, law);
        }
        self.measured.get_mut().clear();
    }

    /// Keeps only the pairs with any of these vertices, until [`Self::release`].
    pub fn restrict(&mut self, vertices: &[bool]) {
        let (pairs, laws) = (std::mem::take(&mut self.pairs), std::mem::take(&mut self.laws));
        let chosen = pairs.iter().zip(&laws).filter(|(pair, _)| pair.has_any(vertices));
        (self.pairs, self.laws) = chosen.map(|(pair, law)| (*pair, *law)).unzip();
        self.unrestricted = Some((pairs, laws));
        self.measured.get_mut().clear();
    }

    /// Takes all pairs again, and keeps those that became active meanwhile.
    pub fn release(&mut self) {
        let Some((pairs, laws)) = self.unrestricted.take() else { return };
        let chosen = std::mem::replace(&mut self.pairs, pairs).into_iter();
        let mut chosen: Vec<_> = chosen.zip(std::mem::replace(&mut self.laws, laws)).collect();
        chosen.retain(|(pair, _)| !self.contains(pair));
        self.extend(chosen);
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
        of_part: impl Fn(&ActivePart<'_>) -> R + Sync,
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
            of_part(&ActivePart { first, end, measured, numbers, barriers })
        })
    }
}

impl ActivePart<'_> {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::barrier::spacing::Spacing;
    use crate::collision::PairKind;

    /// Pairs of vertices with these numbers, which determine their stiffnesses.
    fn numbered(numbers: impl Iterator<Item = u32>) -> Vec<(Pair, Law)> {
        let pair = |number| Pair { kind: PairKind::EdgeEdge, features: [number, 0], vertices: [number; 4] };
        let law = |number| Law::new(Spacing { thickness: 1e-3, gap: 2e-3 }, f64::from(number));
        numbers.map(|number| (pair(number), law(number))).collect()
    }

    fn assert_holds(set: &ActiveSet, numbers: impl Iterator<Item = u32>) {
        let (pairs, laws): (Vec<_>, Vec<_>) = numbered(numbers).into_iter().unzip();
        assert_eq!(set.pairs, pairs);
        let stiffnesses = |laws: &[Law]| laws.iter().map(|law| law.stiffness).collect::<Vec<_>>();
        assert_eq!(stiffnesses(&set.laws), stiffnesses(&laws));
    }

    #[test]
    fn pairs_stay_in_order_with_their_laws() {
        let mut set = ActiveSet::default();
        set.extend(numbered((0..30).rev().filter(|number| number % 3 == 1)));
        set.extend(numbered((0..40).filter(|number| number % 3 == 0)));
        set.extend(Vec::new());
        set.extend(numbered([32, 2].into_iter()));
        assert_holds(
            &set,
            (0..40).filter(|number| number % 3 == 0 || [2, 32].contains(number) || *number < 30 && number % 3 == 1),
        );
    }

    #[test]
    fn pairs_that_become_active_while_others_are_left_out_stay() {
        let mut set = ActiveSet::default();
        set.extend(numbered((0..40).filter(|number| number % 2 == 0)));
        let vertices: Vec<bool> = (0..40).map(|number| number % 4 < 2).collect();
        set.restrict(&vertices);
        assert_holds(&set, (0..40).filter(|number| number % 4 == 0));
        set.extend(numbered((0..40).filter(|number| number % 8 == 1)));
        set.release();
        assert_holds(&set, (0..40).filter(|number| number % 2 == 0 || number % 8 == 1));
        set.release();
        assert_holds(&set, (0..40).filter(|number| number % 2 == 0 || number % 8 == 1));
    }
}
