//! Pairs of items whose boxes overlap, in one tree or two.

use energy_dsl::{Kernel, Level, dispatch};

use super::hierarchy::Node;
use super::rounded_boxes::LANES;
use super::{Hierarchy, RoundedMovingBounds, Volume};

impl<B: Volume> Hierarchy<B> {
    /// Calls `found` with each pair of items of two trees whose boxes overlap, in any order, among some pairs of groups
    /// of these trees. Boxes are rounded outwards to single precision.
    pub fn overlaps_with(
        &self,
        other: &Self,
        groups: impl IntoIterator<Item = [usize; 2]>,
        found: impl FnMut(usize, usize),
    ) {
        let waiting = groups.into_iter().filter_map(|[a, b]| Some((self.root(a)?, other.root(b)?))).collect();
        dispatch(Overlaps { first: self, second: other, is_one_tree: false, waiting, found });
    }

    /// Calls `found` with each pair of different items whose boxes overlap, once and in any order, among some pairs of
    /// groups. Boxes are rounded outwards to single precision.
    pub fn overlaps_within(&self, groups: impl IntoIterator<Item = [usize; 2]>, found: impl FnMut(usize, usize)) {
        let waiting = groups.into_iter().filter_map(|[a, b]| Some((self.root(a)?, self.root(b)?))).collect();
        dispatch(Overlaps { first: self, second: self, is_one_tree: true, waiting, found });
    }
}

/// Finds all pairs below some pairs of nodes.
struct Overlaps<'a, B, F> {
    first: &'a Hierarchy<B>,
    second: &'a Hierarchy<B>,
    is_one_tree: bool,
    waiting: Vec<(usize, usize)>,
    found: F,
}

impl<B: Volume, F: FnMut(usize, usize)> Kernel for Overlaps<'_, B, F> {
    type Output = ();

    #[inline(always)]
    fn run<L: Level>(mut self) {
        let mut waiting = std::mem::take(&mut self.waiting);
        while let Some((a, b)) = waiting.pop() {
            let (one, other) = (&self.first.nodes[a], &self.second.nodes[b]);
            let is_same = self.is_one_tree && a == b;
            if !is_same && !one.bounds.overlaps(&other.bounds) {
                continue;
            }
            // Nodes whose items fit the lanes are not divided further.
            match (one.branches(LANES), other.branches(LANES)) {
                (None, None) => self.compare::<L>(one, other, is_same),
                (Some(right), _) if is_same => waiting.extend([(a + 1, a + 1), (a + 1, right), (right, right)]),
                (Some(right), None) => waiting.extend([(a + 1, b), (right, b)]),
                (Some(right), Some(_)) if one.bounds.at(0).is_longer_than(other.bounds.at(0)) => {
                    waiting.extend([(a + 1, b), (right, b)]);
                }
                (_, Some(right)) => waiting.extend([(a, b + 1), (a, right)]),
            }
        }
    }
}

impl<B: Volume, F: FnMut(usize, usize)> Overlaps<'_, B, F> {
    /// Compares each box of one node with all of another, or with those after it in the same node.
    #[inline(always)]
    fn compare<L: Level>(&mut self, one: &Node<B>, other: &Node<B>, is_same: bool) {
        let Self { first, second, found, .. } = self;
        let around = RoundedMovingBounds::around(&other.bounds);
        for number in first.rounded.overlapping::<L, B>(one.from, one.to, &around) {
            let from = if is_same { number + 1 } else { other.from };
            for with in
                second.rounded.overlapping::<L, B>(from, other.to, &RoundedMovingBounds::around(&first.boxes[number]))
            {
                found(first.items[number], second.items[with]);
            }
        }
    }
}
