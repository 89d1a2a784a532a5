use energy_dsl::Vector3;

use super::{Closest, Near, Pair, Search, Separations};

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
        *self = Self::collect(self.separations.place.clone(), self.entries().filter(is_near));
    }

    /// Removes the pairs that have none of these vertices, and returns them.
    pub fn split_off_others(&mut self, vertices: &[bool]) -> Self {
        let has_any = |entry: &Entry<'_>| entry.pair.has_any(vertices);
        let (kept, others): (Vec<_>, Vec<_>) = self.entries().partition(has_any);
        let place = &self.separations.place;
        let [kept, others] = [kept, others].map(|entries| Self::collect(place.clone(), entries.into_iter()));
        *self = kept;
        others
    }

    /// Returns the pairs of both. Those of the other must be as far apart at the place where these were measured as
    /// where they were measured themselves.
    pub fn joined_with(self, others: &Self) -> Self {
        if others.pairs.is_empty() {
            return self;
        }
        if self.pairs.is_empty() {
            return others.clone();
        }
        let (mut own, mut others) = (self.entries().peekable(), others.entries().peekable());
        let in_order = std::iter::from_fn(|| match (own.peek(), others.peek()) {
            (Some(one), Some(other)) if one.pair == other.pair => {
                others.next();
                own.next()
            }
            (Some(one), Some(other)) if one.pair > other.pair => others.next(),
            (None, _) => others.next(),
            _ => own.next(),
        });
        Self::collect(self.separations.place.clone(), in_order)
    }

    /// Collects pairs in order.
    fn collect<'a>(place: Vec<Vector3<f64>>, entries: impl Iterator<Item = Entry<'a>>) -> Self {
        let most = entries.size_hint().1.unwrap_or(0);
        let (mut pairs, mut all, mut near) = (Vec::with_capacity(most), Vec::with_capacity(most), Vec::new());
        for (number, Entry { pair, separation, closest }) in entries.enumerate() {
            pairs.push(*pair);
            all.push(separation);
            near.extend(closest.map(|closest| Near { number, closest: *closest }));
        }
        Self { pairs, separations: Separations { place, all, near } }
    }

    fn entries(&self) -> impl Iterator<Item = Entry<'_>> {
        let mut near = self.near().iter().peekable();
        let pairs = self.pairs.iter().zip(&self.separations.all).enumerate();
        pairs.map(move |(number, (pair, &separation))| {
            let closest = near.next_if(|near| near.number == number).map(|near| &near.closest);
            Entry { pair, separation, closest }
        })
    }
}

/// A measured pair.
struct Entry<'a> {
    pair: &'a Pair,
    separation: f64,
    /// `None` if the pair is out of reach.
    closest: Option<&'a Closest>,
}
