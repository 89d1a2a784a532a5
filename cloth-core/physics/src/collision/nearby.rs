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
        self.separations.all()
    }

    /// The pairs that were within reach where they were last measured, with their closest points.
    pub fn within_reach(&self) -> impl Iterator<Item = (&Pair, &Closest)> {
        self.near().iter().map(|Near { number, closest }| (&self.pairs[*number], closest))
    }

    /// The numbers of these pairs, and their closest points.
    pub fn near(&self) -> &[Near] {
        self.separations.near()
    }

    /// Measures the pairs at x, unless they have been measured there.
    pub fn visit(&mut self, search: &Search, x: &[Vector3<f64>]) {
        self.separations.measure(&self.pairs, x, search.halves(), search.threads);
    }

    /// Measures the pairs at x, and drops those that cannot come within reach while no vertex goes farther than this
    /// from x: boxes of tilted features meet long before the features do.
    pub fn keep_near(&mut self, search: &Search, x: &[Vector3<f64>], farthest: &[f64]) {
        self.visit(search, x);
        let is_near = |(pair, separation): (&Pair, &f64)| separation - pair.approach(farthest) <= search.reach(pair);
        let is_kept: Vec<bool> = self.pairs.iter().zip(self.separations.all()).map(is_near).collect();
        self.separations.retain(&is_kept);
        let mut kept = is_kept.into_iter();
        self.pairs.retain(|_| kept.next().expect("one for each pair"));
    }

    /// Removes the pairs that have none of these vertices, and returns them.
    pub fn split_off_others(&mut self, vertices: &[bool]) -> Self {
        let is_kept: Vec<bool> = self.pairs.iter().map(|pair| pair.has_any(vertices)).collect();
        self.separations.retain(&is_kept);
        let all = std::mem::take(&mut self.pairs).into_iter().zip(is_kept);
        let (kept, others): (Vec<_>, Vec<_>) = all.partition(|(_, is_kept)| *is_kept);
        self.pairs = kept.into_iter().map(|(pair, _)| pair).collect();
        Self::new(others.into_iter().map(|(pair, _)| pair).collect())
    }

    /// Returns the pairs of both.
    pub fn joined_with(mut self, others: Self) -> Self {
        if others.pairs.is_empty() {
            return self;
        }
        self.pairs.extend(others.pairs);
        // Two runs in order are merged in linear time.
        self.pairs.sort();
        self.pairs.dedup();
        Self::new(self.pairs)
    }
}
