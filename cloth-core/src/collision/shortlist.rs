use energy_dsl::Vector3;

use super::candidates::excursions;
use super::{Candidates, Measured, Pair};

/// Radii are this many times the displacement of a move, so that the next moves need no new list.
const AHEAD: f64 = 2.0;
/// A list is renewed once its radii exceed those of a new one by this factor in the mean.
const WASTE: f64 = 3.0;

/// The candidates that can come within reach while each vertex stays within a radius of a centre, measured at the
/// current iterate: a second, shorter list of pairs. Late iterates of a step move little, so few pairs of the search
/// matter to them.
///
/// Displacements are relative to their mean, as in [`Candidates`].
#[derive(Clone, Debug)]
pub(crate) struct Shortlist {
    /// The least radius, in m; infinite if the list holds all candidates and dismisses none.
    margin: f64,
    /// Distance within which pairs are wanted, in m.
    reach: f64,
    centre: Vec<Vector3<f64>>,
    /// Distance from the centre within which each vertex may move, in m. Empty before the first list.
    radii: Vec<f64>,
    pairs: Vec<Pair>,
    measured: Measured,
}

impl Shortlist {
    /// Creates an empty list.
    pub fn new(margin: f64, reach: f64) -> Self {
        let (centre, radii, pairs, measured) = Default::default();
        Self { margin, reach, centre, radii, pairs, measured }
    }

    /// The listed pairs, in the order of the candidates.
    pub fn pairs(&self) -> &[Pair] {
        &self.pairs
    }

    /// The listed pairs at the start of the move that the list was last prepared for.
    pub fn measured(&self) -> &Measured {
        &self.measured
    }

    /// Discards the list. Required after every search, because the new candidates may be others.
    pub fn clear(&mut self) {
        self.radii.clear();
        self.pairs.clear();
        self.measured.clear();
    }

    /// Whether the list holds every candidate that comes within reach on a straight move. Distances from a centre are
    /// largest at an end.
    fn covers(&self, from: &[Vector3<f64>], to: &[Vector3<f64>]) -> bool {
        let is_within = |x| excursions(&self.centre, x).iter().zip(&self.radii).all(|(away, radius)| away <= radius);
        self.radii.len() == from.len() && is_within(from) && is_within(to)
    }

    /// Lists all candidates that can come within reach during the straight move, and measures them at its start. Keeps
    /// the list if it holds them and is not much longer than necessary. `rounding` bounds the rounding errors of
    /// distances, in m.
    pub fn prepare(&mut self, candidates: &Candidates, from: &[Vector3<f64>], to: &[Vector3<f64>], rounding: f64) {
        let radii: Vec<f64> = excursions(from, to).into_iter().map(|moved| AHEAD * moved + self.margin).collect();
        let is_wasteful = || self.radii.iter().sum::<f64>() > WASTE * radii.iter().sum::<f64>();
        if self.radii.len() != from.len() {
            self.list(candidates, from, radii, rounding);
        } else if !self.covers(from, to) || is_wasteful() {
            // New balls within the old ones need no pair that the old list lacks.
            let shifts = excursions(&self.centre, from);
            let is_nested = shifts.iter().zip(&radii).zip(&self.radii).all(|((shift, new), old)| shift + new <= *old);
            if is_nested {
                self.measured.measure(&self.pairs, from);
                self.keep_near(from, radii, rounding);
            } else {
                self.list(candidates, from, radii, rounding);
            }
        }
        self.measured.measure(&self.pairs, from);
    }

    /// Measures the list at x, and renews it if it does not hold all pairs within reach there. A list that was made for
    /// a move covers its end; a shorter one would not cover the next move.
    pub fn visit(&mut self, candidates: &Candidates, x: &[Vector3<f64>], rounding: f64) {
        if self.covers(x, x) {
            self.measured.measure(&self.pairs, x);
        } else {
            self.prepare(candidates, x, x, rounding);
        }
    }

    /// Lists pairs around a centre.
    fn list(&mut self, candidates: &Candidates, centre: &[Vector3<f64>], radii: Vec<f64>, rounding: f64) {
        let moved = candidates.excursions(centre);
        let is_near = |(pair, separation): (&Pair, &f64)| {
            self.margin.is_infinite() || separation - pair.approach(&moved) <= self.within(pair, &radii, rounding)
        };
        let all = candidates.pairs().iter().zip(candidates.measured().separations());
        self.pairs = all.filter(|&one| is_near(one)).map(|(pair, _)| *pair).collect();
        self.measured.clear();
        self.measured.measure(&self.pairs, centre);
        self.keep_near(centre, radii, rounding);
    }

    /// Keeps the pairs that can come within reach in balls around a centre, where they have been measured.
    fn keep_near(&mut self, centre: &[Vector3<f64>], radii: Vec<f64>, rounding: f64) {
        if self.margin.is_finite() {
            let is_near = |(pair, separation): (&Pair, &f64)| *separation <= self.within(pair, &radii, rounding);
            let is_kept: Vec<bool> = self.pairs.iter().zip(self.measured.separations()).map(is_near).collect();
            self.measured.retain(&is_kept);
            let mut kept = is_kept.into_iter();
            self.pairs.retain(|_| kept.next().expect("one for each pair"));
        }
        self.radii = radii;
        centre.clone_into(&mut self.centre);
    }

    /// The distance at the centre within which a pair is wanted, in m.
    fn within(&self, pair: &Pair, radii: &[f64], rounding: f64) -> f64 {
        self.reach + pair.approach(radii) + rounding
    }
}
