//! Numbers with a range, so that an impossible one is refused where it is written.

use serde::de::{Deserialize, Deserializer, Error};

fn checked<'de, D: Deserializer<'de>>(
    deserializer: D,
    fits: impl Fn(f64) -> bool,
    range: &str,
) -> Result<f64, D::Error> {
    let number = f64::deserialize(deserializer)?;
    if fits(number) { Ok(number) } else { Err(D::Error::custom(format!("{number} must be {range}"))) }
}

pub(crate) fn positive<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    checked(deserializer, |number| number.is_finite() && number > 0.0, "a finite number above 0")
}

pub(crate) fn some_positive<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<f64>, D::Error> {
    positive(deserializer).map(Some)
}

pub(crate) fn non_negative<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    checked(deserializer, |number| number.is_finite() && number >= 0.0, "a finite number, 0 or above")
}

pub(crate) fn number<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    checked(deserializer, f64::is_finite, "a finite number")
}

pub(crate) fn nonzero_triple<'de, D: Deserializer<'de>>(deserializer: D) -> Result<[f64; 3], D::Error> {
    let numbers = finite_triple(deserializer)?;
    // Its square must be a number above 0, too.
    let square: f64 = numbers.iter().map(|number| number * number).sum();
    if square.is_normal() {
        Ok(numbers)
    } else {
        Err(D::Error::custom(format!("{numbers:?} must be a direction: not all zero, nor beyond 1e±150")))
    }
}

/// A number of parts, at least `LEAST` and not absurd.
pub(crate) fn count<'de, const LEAST: usize, D: Deserializer<'de>>(deserializer: D) -> Result<usize, D::Error> {
    const MOST: usize = 4096;
    let count = usize::deserialize(deserializer)?;
    if (LEAST..=MOST).contains(&count) {
        Ok(count)
    } else {
        Err(D::Error::custom(format!("{count} must be between {LEAST} and {MOST}")))
    }
}

pub(crate) fn poisson_ratio<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    checked(deserializer, |number| number > -1.0 && number < 1.0, "between −1 and 1, both excluded")
}

fn all<'de, const N: usize, D: Deserializer<'de>>(
    deserializer: D,
    fits: impl Fn(f64) -> bool,
    range: &str,
) -> Result<[f64; N], D::Error>
where
    [f64; N]: Deserialize<'de>,
{
    let numbers = <[f64; N]>::deserialize(deserializer)?;
    if numbers.iter().all(|&number| fits(number)) {
        Ok(numbers)
    } else {
        Err(D::Error::custom(format!("{numbers:?} must hold {range} only")))
    }
}

pub(crate) fn finite_triple<'de, D: Deserializer<'de>>(deserializer: D) -> Result<[f64; 3], D::Error> {
    all(deserializer, f64::is_finite, "finite numbers")
}

/// N numbers, each above 0.
pub(crate) fn all_positive<'de, const N: usize, D: Deserializer<'de>>(deserializer: D) -> Result<[f64; N], D::Error>
where
    [f64; N]: Deserialize<'de>,
{
    all(deserializer, |number| number.is_finite() && number > 0.0, "finite numbers above 0")
}

pub(crate) fn cell_counts<'de, D: Deserializer<'de>>(deserializer: D) -> Result<[usize; 2], D::Error> {
    const MOST: usize = 4096;
    let counts = <[usize; 2]>::deserialize(deserializer)?;
    if counts.iter().all(|count| (1..=MOST).contains(count)) {
        Ok(counts)
    } else {
        Err(D::Error::custom(format!("{counts:?}: each number of cells must be between 1 and {MOST}")))
    }
}
