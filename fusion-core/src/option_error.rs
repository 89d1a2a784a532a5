//! Errors of options.

use std::fmt::Display;

/// An option with a value that cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("option `{name}`: expected {expected}, got {found}")]
#[non_exhaustive]
pub struct OptionError {
    /// Path of the option in a file of options.
    pub name: &'static str,
    /// Description of the values that can be used.
    pub expected: &'static str,
    /// The value given.
    pub found: String,
}

impl OptionError {
    /// Checks a condition on a value.
    pub(crate) fn ensure(
        holds: bool,
        name: &'static str,
        expected: &'static str,
        found: impl Display,
    ) -> Result<(), Self> {
        if holds { Ok(()) } else { Err(Self { name, expected, found: found.to_string() }) }
    }

    /// Checks that a number is finite and greater than 0.
    pub(crate) fn ensure_positive(name: &'static str, value: f64) -> Result<(), Self> {
        Self::ensure(value > 0.0 && value.is_finite(), name, "a finite number greater than 0", value)
    }

    /// Checks that a number is finite and at least 0.
    pub(crate) fn ensure_not_negative(name: &'static str, value: f64) -> Result<(), Self> {
        Self::ensure(value >= 0.0 && value.is_finite(), name, "a finite number of at least 0", value)
    }
}
