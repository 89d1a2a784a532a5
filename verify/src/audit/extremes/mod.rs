//! Inputs where formulas lose digits: near rest, and near singularities.
//!
//! Coordinates are multiples of powers of two wherever that is possible, so that the differences of points are exact:
//! a loss of digits is then due to the formula alone.

mod deformed;
mod folded;
mod rest;

use fastrand::Rng;

use super::subject::Subject;
use crate::sample::{Sample, has_points};

/// An input near rest or a singularity.
#[derive(Clone, Debug)]
pub(super) struct Extreme {
    /// The place, as in `near rest, at a strain of 1e-9`.
    pub(super) place: String,
    pub(super) sample: Sample,
}

impl Extreme {
    /// Returns the kind of place: what precedes the numbers.
    pub(super) fn kind(&self) -> &str {
        self.place.split(',').next().unwrap_or_default()
    }

    fn new(place: impl Into<String>, sample: Sample) -> Self {
        Self { place: place.into(), sample }
    }
}

/// Returns the inputs for an element, the most important first. `ordinary` is an input in the domain of the formula;
/// its parameters are kept.
pub(super) fn extremes(subject: &Subject, ordinary: &Sample, seed: u64) -> Vec<Extreme> {
    let mut random = Rng::with_seed(seed ^ 0x6578_7472);
    let declaration = &*subject.declaration;
    let mut list = Vec::new();
    if let Some(rest) = rest::RestShape::of(declaration, ordinary) {
        let mut near = rest::near(&rest, ordinary, &mut random);
        let others = near.split_off(2);
        list.extend(near.into_iter().chain(deformed::of_rest(&rest, ordinary)).chain(others));
    } else if has_points(declaration) {
        list.extend(rest::near_parameter(subject, ordinary));
        list.extend(folded::sequences(ordinary));
        list.extend(deformed::of_edges(ordinary));
    }
    list.extend(deformed::of_matrices(declaration, ordinary));
    list
}

/// Rounds to a multiple of 2⁻¹⁰.
fn dyadic(x: f64) -> f64 {
    (x * 1024.0).round() / 1024.0
}
