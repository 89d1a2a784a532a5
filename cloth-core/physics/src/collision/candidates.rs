use std::ops::Range;

use energy_dsl::Vector3;
use energy_solve::threads::{for_each, ranges};

use super::{Closest, Near, PART, Pair, Search, Separations};

/// Candidate pairs, in order, and how far they are apart where they were last measured.
#[derive(Clone, Debug, Default)]
pub struct Candidates {
    pairs: Vec<Pair>,
    separations: Separations,
}

impl Candidates {
    /// Takes pairs, which are not yet measured.
    pub fn new(pairs: Vec<Pair>) -> Self {
        Self { pairs, separations: Separations::default() }
    }

    /// All candidate pairs, in order.
    pub fn pairs(&self) -> &[Pair] {
        &self.pairs
    }

    /// A lower bound of the distance of each pair where they were last measured; see [`Closest::separation`].
    pub fn separations(&self) -> &[f64] {
        &self.separations.all
    }

    /// The pairs that were within reach where they were last measured, with their closest points.
    pub fn within_reach(&self) -> impl Iterator<Item = (&Pair, &Closest)> {
        self.near().iter().map(|Near { number, closest }| (&self.pairs[*number], closest))
    }

    /// The numbers of these pairs, and their closest points.
    pub fn near(&self) -> &[Near] {
        &self.separations.near
    }

    /// Measures the pairs at x, unless they have been measured there.
    pub fn measure(&mut self, search: &Search, x: &[Vector3<f64>]) {
        self.separations.measure(&self.pairs, x, search.halves(), search.threads);
    }

    /// Measures the pairs at x, and drops those that cannot come within reach while no vertex goes farther than this
    /// from x: boxes of tilted features overlap long before the features do.
    pub fn keep_near(&mut self, search: &Search, x: &[Vector3<f64>], farthest: &[f64]) {
        self.measure(search, x);
        let kept = self.filtered(search.threads, |Entry { pair, separation, .. }| {
            separation - pair.approach(farthest) <= search.reach(pair)
        });
        *self = kept.at(std::mem::take(&mut self.separations.x));
    }

    /// Returns the pairs that have any of these vertices.
    pub fn with_any(&self, vertices: &[bool], threads: usize) -> Self {
        self.filtered(threads, |entry| entry.pair.has_any(vertices)).at(self.separations.x.clone())
    }

    /// Returns the pairs of both. The distances of the others must be the same where both were measured.
    pub fn joined_with(self, others: &Self, threads: usize) -> Self {
        if others.pairs.is_empty() {
            return self;
        }
        self.joined_with_some(others, |_| true, threads)
    }

    /// Returns these pairs, and those of the others without any of some vertices. The distances of the others must be
    /// the same where both were measured.
    pub fn joined_with_others(self, others: &Self, vertices: &[bool], threads: usize) -> Self {
        self.joined_with_some(others, |entry| !entry.pair.has_any(vertices), threads)
    }

    fn joined_with_some(self, others: &Self, is_one: impl Fn(&Entry<'_>) -> bool + Sync, threads: usize) -> Self {
        let longer = if self.pairs.len() > others.pairs.len() { &self.pairs } else { &others.pairs };
        let position_in = |pairs: &[Pair], number: usize| match number {
            0 => 0,
            _ if number == longer.len() => pairs.len(),
            _ => pairs.partition_point(|pair| *pair < longer[number]),
        };
        let parts = for_each(threads, ranges(threads, longer.len(), PART), |part| {
            let [own, other] = [&self, others].map(|list| {
                let part = position_in(&list.pairs, part.start)..position_in(&list.pairs, part.end);
                (part.len(), list.entries(part))
            });
            Self::collect(own.0 + other.0, merged(own.1, other.1.filter(&is_one)))
        });
        Self::concatenated(parts).at(self.separations.x)
    }

    /// Returns some of the pairs, not yet measured.
    fn filtered(&self, threads: usize, is_one: impl Fn(&Entry<'_>) -> bool + Sync) -> Self {
        let parts = for_each(threads, ranges(threads, self.pairs.len(), PART), |part| {
            Self::collect(part.len(), self.entries(part).filter(&is_one))
        });
        Self::concatenated(parts)
    }

    /// Collects pairs in order, not yet measured. `most` bounds their number.
    fn collect<'a>(most: usize, entries: impl Iterator<Item = Entry<'a>>) -> Self {
        let (mut pairs, mut all, mut near) = (Vec::with_capacity(most), Vec::with_capacity(most), Vec::new());
        for (number, Entry { pair, separation, closest }) in entries.enumerate() {
            pairs.push(*pair);
            all.push(separation);
            near.extend(closest.map(|closest| Near { number, closest: *closest }));
        }
        Self { pairs, separations: Separations { x: Vec::new(), all, near } }
    }

    /// Concatenates parts, not yet measured.
    fn concatenated(parts: Vec<Self>) -> Self {
        let mut parts = parts.into_iter();
        let mut whole = parts.next().unwrap_or_default();
        for Self { pairs, separations: Separations { all, near, .. } } in parts {
            let first = whole.pairs.len();
            whole.separations.near.extend(near.into_iter().map(|near| Near { number: first + near.number, ..near }));
            whole.separations.all.extend(all);
            whole.pairs.extend(pairs);
        }
        whole
    }

    /// Returns the pairs, measured at these positions.
    fn at(mut self, x: Vec<Vector3<f64>>) -> Self {
        self.separations.x = x;
        self
    }

    /// The pairs with these numbers.
    fn entries(&self, range: Range<usize>) -> impl Iterator<Item = Entry<'_>> {
        let first_near = self.near().partition_point(|near| near.number < range.start);
        let mut near = self.near()[first_near..].iter().peekable();
        let pairs = range.clone().zip(self.pairs[range.clone()].iter().zip(&self.separations.all[range]));
        pairs.map(move |(number, (pair, &separation))| {
            let closest = near.next_if(|near| near.number == number).map(|near| &near.closest);
            Entry { pair, separation, closest }
        })
    }
}

/// Returns the pairs of two sequences in order, and those of both once.
fn merged<'a>(
    own: impl Iterator<Item = Entry<'a>>,
    others: impl Iterator<Item = Entry<'a>>,
) -> impl Iterator<Item = Entry<'a>> {
    let (mut own, mut others) = (own.peekable(), others.peekable());
    std::iter::from_fn(move || match (own.peek(), others.peek()) {
        (Some(one), Some(other)) if one.pair == other.pair => {
            others.next();
            own.next()
        }
        (Some(one), Some(other)) if one.pair > other.pair => others.next(),
        (None, _) => others.next(),
        _ => own.next(),
    })
}

/// A measured pair.
struct Entry<'a> {
    pair: &'a Pair,
    separation: f64,
    /// `None` if the pair is out of reach.
    closest: Option<&'a Closest>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::collision::PairKind;

    /// Pairs with these numbers; multiples of three are within reach.
    fn numbered(numbers: impl Iterator<Item = u32>) -> Candidates {
        let mut candidates = Candidates::default();
        for (position, number) in numbers.enumerate() {
            let (features, separation) = ([number, 0], f64::from(number));
            candidates.pairs.push(Pair { kind: PairKind::EdgeEdge, features, vertices: [number; 4] });
            candidates.separations.all.push(separation);
            if number.is_multiple_of(3) {
                let closest = Closest { weights: [0.0; 4], normal: [0.0; 3], distance: separation, separation };
                candidates.separations.near.push(Near { number: position, closest });
            }
        }
        candidates
    }

    fn assert_same(found: &Candidates, expected: &Candidates, case: &str) {
        assert_eq!(found.pairs, expected.pairs, "{case}");
        assert_eq!(found.separations(), expected.separations(), "{case}");
        let near = |candidates: &Candidates| candidates.within_reach().map(|(pair, _)| *pair).collect::<Vec<_>>();
        assert_eq!(near(found), near(expected), "{case}");
    }

    #[test]
    fn pairs_of_two_lists_are_joined_once_and_in_order() {
        let count = 3 * PART as u32;
        for (own, other) in [(2, 3), (3, 2), (1, 7), (7, 1), (4, 4)] {
            let list = |step: u32| (1..count).filter(move |number| number.is_multiple_of(step));
            let both = (1..count).filter(|number| number.is_multiple_of(own) || number.is_multiple_of(other));
            let expected = numbered(both);
            for threads in [1, 2, 3] {
                let joined = numbered(list(own)).joined_with(&numbered(list(other)), threads);
                assert_same(&joined, &expected, &format!("{own} {other} {threads}"));
            }
        }
    }
    #[test]
    fn pairs_of_some_vertices_are_replaced() {
        let count = 3 * PART as u32;
        let all = numbered(0..count);
        for step in [2, 7, count + 1] {
            let vertices: Vec<bool> = (1..=count).map(|number| number.is_multiple_of(step)).collect();
            let has_vertex = |number: &u32| vertices[*number as usize];
            for threads in [1, 2, 3] {
                let chosen = all.with_any(&vertices, threads);
                assert_same(&chosen, &numbered((0..count).filter(has_vertex)), &format!("{step} {threads}"));
                let kept = numbered((0..count).filter(has_vertex).filter(|number| number.is_multiple_of(5)));
                let expected = (0..count).filter(|number| !has_vertex(number) || number.is_multiple_of(5));
                let joined = kept.joined_with_others(&all, &vertices, threads);
                assert_same(&joined, &numbered(expected), &format!("{step} {threads}"));
            }
        }
    }
}
