use energy_dsl::Vector3;

use super::candidates::excursions;
use super::{Candidate, Candidates, Closest};

/// Radii are this many times the displacement of a move, so that the next moves need no new list.
const AHEAD: f64 = 2.0;
/// A list is renewed once its radii exceed those of a new one by this factor in the mean.
const WASTE: f64 = 3.0;

/// The candidates that can come within reach while each vertex stays within a radius of a centre: a second, shorter
/// list of pairs. Late iterates of a step move little, so few pairs of the search matter to them.
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
    pairs: Vec<Listed>,
}

/// A candidate of the last search, with its distance at the centre of the list.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Listed {
    pub candidate: Candidate,
    distance: f64,
}

impl Listed {
    /// Whether the pair is certainly farther apart than `reach`, where the vertices have these excursions from the
    /// centre.
    #[inline]
    pub fn is_beyond(&self, reach: f64, excursions: &[f64]) -> bool {
        self.distance - self.candidate.pair.approach(excursions) > reach
    }
}

impl Shortlist {
    /// Creates an empty list.
    pub fn new(margin: f64, reach: f64) -> Self {
        Self { margin, reach, centre: Vec::new(), radii: Vec::new(), pairs: Vec::new() }
    }

    /// The listed pairs, in the order of the candidates.
    pub fn pairs(&self) -> &[Listed] {
        &self.pairs
    }

    /// Discards the list. Required after every search, because the list refers to its distances and normals.
    pub fn clear(&mut self) {
        self.radii.clear();
        self.pairs.clear();
    }

    /// Returns the largest distance of each vertex from the centre on a straight move, in m. Distances from a place are
    /// largest at an end.
    pub fn excursions(&self, from: &[Vector3<f64>], to: &[Vector3<f64>]) -> Vec<f64> {
        let [before, after] = [from, to].map(|x| excursions(&self.centre, x));
        before.into_iter().zip(after).map(|(before, after)| before.max(after)).collect()
    }

    /// Whether the list holds every candidate that comes within reach on a straight move.
    pub fn covers(&self, from: &[Vector3<f64>], to: &[Vector3<f64>]) -> bool {
        self.radii.len() == from.len()
            && self.excursions(from, to).iter().zip(&self.radii).all(|(excursion, radius)| excursion <= radius)
    }

    /// Lists all candidates that can come within reach during the straight move. Keeps the list if it holds them and is
    /// not much longer than necessary. `rounding` bounds the rounding errors of distances, in m.
    pub fn prepare(&mut self, candidates: &Candidates, from: &[Vector3<f64>], to: &[Vector3<f64>], rounding: f64) {
        let radii: Vec<f64> = excursions(from, to).into_iter().map(|moved| AHEAD * moved + self.margin).collect();
        if self.radii.len() != from.len() {
            self.list(candidates, from, radii, rounding, None);
            return;
        }
        let is_wasteful = self.radii.iter().sum::<f64>() > WASTE * radii.iter().sum::<f64>();
        if self.covers(from, to) && !is_wasteful {
            return;
        }
        // New balls within the old ones need no pair that the old list lacks.
        let shifts = excursions(&self.centre, from);
        let is_nested = shifts.iter().zip(&radii).zip(&self.radii).all(|((shift, new), old)| shift + new <= *old);
        let listed = is_nested.then(|| std::mem::take(&mut self.pairs));
        self.list(candidates, from, radii, rounding, listed);
    }

    /// Lists pairs around a centre, from `listed` or from all candidates.
    fn list(
        &mut self,
        candidates: &Candidates,
        centre: &[Vector3<f64>],
        radii: Vec<f64>,
        rounding: f64,
        listed: Option<Vec<Listed>>,
    ) {
        let excursions = candidates.excursions(centre);
        let near = |candidate: &Candidate| {
            if self.margin.is_infinite() {
                return Some(Listed { candidate: *candidate, distance: 0.0 });
            }
            let within = self.reach + candidate.pair.approach(&radii) + rounding;
            if candidate.is_beyond(within, centre, &excursions) {
                return None;
            }
            let distance = Closest::of(&candidate.pair, &candidate.pair.corners(centre)).distance;
            (distance <= within).then_some(Listed { candidate: *candidate, distance })
        };
        self.pairs = match listed {
            Some(listed) => listed.iter().filter_map(|listed| near(&listed.candidate)).collect(),
            None => candidates.pairs().iter().filter_map(near).collect(),
        };
        self.radii = radii;
        centre.clone_into(&mut self.centre);
    }
}
