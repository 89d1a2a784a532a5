//! Deserialises numbers with range checks, so that an invalid number is reported at its place in the file.

use serde::de::{Deserialize, Deserializer, Error};

/// The largest speed of anything, in m/s.
pub(crate) const SPEED_OF_LIGHT: f64 = 299_792_458.0;

fn checked<'de, D: Deserializer<'de>>(
    deserializer: D,
    fits: impl Fn(f64) -> bool,
    range: &str,
) -> Result<f64, D::Error> {
    let number = f64::deserialize(deserializer)?;
    if fits(number) { Ok(number) } else { Err(D::Error::custom(format!("expected {range}, got {number}"))) }
}

pub(crate) fn positive<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    checked(deserializer, |number| number.is_finite() && number > 0.0, "a finite number greater than 0")
}

pub(crate) fn some_positive<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<f64>, D::Error> {
    positive(deserializer).map(Some)
}

pub(crate) fn non_negative<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    checked(deserializer, |number| number.is_finite() && number >= 0.0, "a finite number of at least 0")
}

pub(crate) fn number<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    checked(deserializer, f64::is_finite, "a finite number")
}

pub(crate) fn nonzero_triple<'de, D: Deserializer<'de>>(deserializer: D) -> Result<[f64; 3], D::Error> {
    let numbers = finite_triple(deserializer)?;
    // The squared length must be representable.
    let square: f64 = numbers.iter().map(|number| number * number).sum();
    if square.is_normal() {
        Ok(numbers)
    } else {
        Err(D::Error::custom(format!("expected a direction, neither zero nor beyond 1e±150, got {numbers:?}")))
    }
}

/// Deserialises a number of parts, at least `LEAST`.
pub(crate) fn count<'de, const LEAST: usize, D: Deserializer<'de>>(deserializer: D) -> Result<usize, D::Error> {
    const MOST: usize = 4096;
    let count = usize::deserialize(deserializer)?;
    if (LEAST..=MOST).contains(&count) {
        Ok(count)
    } else {
        Err(D::Error::custom(format!("expected a number from {LEAST} to {MOST}, got {count}")))
    }
}

pub(crate) fn poisson_ratio<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    checked(deserializer, |number| number > -1.0 && number < 1.0, "a number strictly between −1 and 1")
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
        Err(D::Error::custom(format!("expected {range} only, got {numbers:?}")))
    }
}

pub(crate) fn finite_triple<'de, D: Deserializer<'de>>(deserializer: D) -> Result<[f64; 3], D::Error> {
    all(deserializer, f64::is_finite, "finite numbers")
}

/// Deserialises N numbers greater than 0.
pub(crate) fn all_positive<'de, const N: usize, D: Deserializer<'de>>(deserializer: D) -> Result<[f64; N], D::Error>
where
    [f64; N]: Deserialize<'de>,
{
    all(deserializer, |number| number.is_finite() && number > 0.0, "finite numbers greater than 0")
}

pub(crate) fn cell_counts<'de, D: Deserializer<'de>>(deserializer: D) -> Result<[usize; 2], D::Error> {
    const MOST: usize = 4096;
    let counts = <[usize; 2]>::deserialize(deserializer)?;
    if counts.iter().all(|count| (1..=MOST).contains(count)) {
        Ok(counts)
    } else {
        Err(D::Error::custom(format!("expected numbers of cells from 1 to {MOST}, got {counts:?}")))
    }
}
