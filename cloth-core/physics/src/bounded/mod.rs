//! Values of scene files: each type here reads a value, checks its range, and has the JSON schema that says the same.
//!
//! Fields name them with `#[serde(with = "…")]`, from which the schema follows too, so that program and schema cannot
//! differ. [`Strict`] reads tables and choices.

mod choice;
mod described;
mod range;
mod real;
mod strict;
mod whole;

pub use range::{
    AboveOne, Angle, Channel, Fraction, NonNegative, Number, PoissonRatio, Positive, Range, SPEED_OF_LIGHT, Share,
    Signed, Speed, Strain,
};
pub use real::{Colours, Direction, MaybeReal, MaybeRealList, MaybeReals, Points, Real, RealMap, Reals};
pub use strict::Strict;
pub use whole::{Count, Counts, MaybeCount, MaybePair, MaybeVertices, Pair, Pairs};

use serde::de::Error;

/// Returns an array of exactly N entries; an error if there are more or fewer.
fn exactly<const N: usize, T, E: Error>(entries: Vec<T>) -> Result<[T; N], E> {
    let count = entries.len();
    entries.try_into().map_err(|_| E::custom(format!("expected {N} entries, got {count}")))
}
