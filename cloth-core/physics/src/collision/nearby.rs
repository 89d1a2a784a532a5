use std::ops::Range;

use energy_dsl::Vector3;
use energy_solve::threads::{for_each, ranges};

use super::{Closest, Near, PART, Pair, Search, Separations};

/// Some pairs, in order, and how far they are apart at one place.
#[derive(Clone, Debug, Default)]
pub struct Nearby {
    pairs: Vec<Pair>,
    separations: Separations,
}

impl Nearby {
    /// Takes pairs, which are not yet measured.
    pub fn new(pairs: Vec<Pair>) -> Self {
        Self { pairs, separations: Separations::default() }
    }

    /// The pairs.
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
    pub fn visit(&mut self, search: &Search, x: &[Vector3<f64>]) {
        self.separations.measure(&self.pairs, x, search.halves(), search.threads);
    }

    /// Measures the pairs at x, and drops those that cannot come within reach while no vertex goes farther than this
    /// from x: boxes of tilted features meet long before the features do.
    pub fn keep_near(&mut self, search: &Search, x: &[Vector3<f64>], farthest: &[f64]) {
        self.visit(search, x);
        let is_near =
            |Entry { pair, separation, .. }: &Entry<'_>| separation - pair.approach(farthest) <= search.reach(pair);
        let parts = ranges(search.threads, self.pairs.len(), PART);
        let kept =
            for_each(search.threads, parts, |part| Self::collect(part.len(), self.entries(part).filter(is_near)));
        *self = Self::concatenated(std::mem::take(&mut self.separations.place), kept);
    }

    /// Removes the pairs that have none of these vertices, and returns them.
    pub fn split_off_others(&mut self, vertices: &[bool]) -> Self {
        let has_any = |entry: &Entry<'_>| entry.pair.has_any(vertices);
        let (kept, others): (Vec<_>, Vec<_>) = self.entries(0..self.pairs.len()).partition(has_any);
        let place = &self.separations.place;
        let [kept, others] =
            [kept, others].map(|entries| Self::collect(entries.len(), entries.into_iter()).at(place.clone()));
        *self = kept;
        others
    }

    /// Returns the pairs of both. The distances of the others must be the same at both places of measurement.
    pub fn joined_with(mut self, others: &Self, threads: usize) -> Self {
        if others.pairs.is_empty() {
            return self;
        }
        if self.pairs.is_empty() {
            return others.clone();
        }
        let count = self.pairs.len();
        let place_in_others = |number: usize| match number {
            0 => 0,
            _ if number == count => others.pairs.len(),
            _ => others.pairs.partition_point(|pair| *pair < self.pairs[number]),
        };
        let parts = for_each(threads, ranges(threads, count, PART), |part| {
            let part_of_others = place_in_others(part.start)..place_in_others(part.end);
            let most = part.len() + part_of_others.len();
            Self::collect(most, merged(self.entries(part), others.entries(part_of_others)))
        });
        Self::concatenated(std::mem::take(&mut self.separations.place), parts)
    }

    /// Collects pairs in order, without their place. `most` bounds their number.
    fn collect<'a>(most: usize, entries: impl Iterator<Item = Entry<'a>>) -> Self {
        let (mut pairs, mut all, mut near) = (Vec::with_capacity(most), Vec::with_capacity(most), Vec::new());
        for (number, Entry { pair, separation, closest }) in entries.enumerate() {
            pairs.push(*pair);
            all.push(separation);
            near.extend(closest.map(|closest| Near { number, closest: *closest }));
        }
        Self { pairs, separations: Separations { place: Vec::new(), all, near } }
    }

    /// Concatenates parts that were measured at this place.
    fn concatenated(place: Vec<Vector3<f64>>, parts: Vec<Self>) -> Self {
        let mut parts = parts.into_iter();
        let mut whole = parts.next().unwrap_or_default();
        for Self { pairs, separations: Separations { all, near, .. } } in parts {
            let first = whole.pairs.len();
            whole.separations.near.extend(near.into_iter().map(|near| Near { number: first + near.number, ..near }));
            whole.separations.all.extend(all);
            whole.pairs.extend(pairs);
        }
        whole.at(place)
    }

    /// Returns the pairs, measured at this place.
    fn at(mut self, place: Vec<Vector3<f64>>) -> Self {
        self.separations.place = place;
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
    fn numbered(numbers: impl Iterator<Item = u32>) -> Nearby {
        let mut nearby = Nearby::default();
        for (place, number) in numbers.enumerate() {
            let (features, separation) = ([number, 0], f64::from(number));
            nearby.pairs.push(Pair { kind: PairKind::EdgeEdge, features, vertices: [number; 4] });
            nearby.separations.all.push(separation);
            if number.is_multiple_of(3) {
                let closest = Closest { weights: [0.0; 4], normal: [0.0; 3], distance: separation, separation };
                nearby.separations.near.push(Near { number: place, closest });
            }
        }
        nearby
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
                assert_eq!(joined.pairs, expected.pairs, "{own} {other} {threads}");
                assert_eq!(joined.separations(), expected.separations(), "{own} {other} {threads}");
                let near = |nearby: &Nearby| nearby.within_reach().map(|(pair, _)| *pair).collect::<Vec<_>>();
                assert_eq!(near(&joined), near(&expected), "{own} {other} {threads}");
            }
        }
    }
}
