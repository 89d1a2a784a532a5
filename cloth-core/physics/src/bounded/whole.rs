use std::fmt;

use schemars::{Schema, json_schema};
use serde::de::{Deserialize, Deserializer, Error, Visitor};

use super::described::{array, described};
use super::exactly;

/// A whole number of any size.
struct AnyWhole(i64);

impl<'de> Deserialize<'de> for AnyWhole {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct WholeVisitor;
        impl Visitor<'_> for WholeVisitor {
            type Value = AnyWhole;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a whole number")
            }

            fn visit_i64<E: Error>(self, number: i64) -> Result<AnyWhole, E> {
                Ok(AnyWhole(number))
            }

            fn visit_u64<E: Error>(self, number: u64) -> Result<AnyWhole, E> {
                Ok(AnyWhole(i64::try_from(number).unwrap_or(i64::MAX)))
            }

            fn visit_f64<E: Error>(self, number: f64) -> Result<AnyWhole, E> {
                // JSON schemas call 4.0 an integer.
                if number.fract() == 0.0 {
                    Ok(AnyWhole(number as i64))
                } else {
                    Err(E::invalid_type(serde::de::Unexpected::Float(number), &self))
                }
            }
        }
        deserializer.deserialize_any(WholeVisitor)
    }
}

fn check<const LEAST: usize, const MOST: usize, E: Error>(AnyWhole(number): AnyWhole) -> Result<usize, E> {
    let fits = usize::try_from(number).ok().filter(|number| (LEAST..=MOST).contains(number));
    fits.ok_or_else(|| E::custom(format!("expected a whole number from {LEAST} to {MOST}, got {number}")))
}

fn whole<'de, const LEAST: usize, const MOST: usize, const N: usize, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<[usize; N], D::Error> {
    let numbers = Vec::<AnyWhole>::deserialize(deserializer)?;
    exactly(numbers.into_iter().map(check::<LEAST, MOST, _>).collect::<Result<_, _>>()?)
}

/// A number of parts.
pub struct Count<const LEAST: usize, const MOST: usize>;

/// A number of parts, or none.
pub struct MaybeCount<const LEAST: usize, const MOST: usize>;

/// N numbers of parts.
#[non_exhaustive]
pub struct Counts<const LEAST: usize, const MOST: usize, const N: usize>;

/// A list of at least one vertex, or none.
pub struct MaybeVertices;

/// A list of pairs of vertices.
pub struct Pairs;

/// Two names.
pub struct Pair;

/// Two names; `None` if the key is missing.
pub struct MaybePair;

/// The largest index of a vertex.
const LARGEST_INDEX: usize = u32::MAX as usize;

impl<const LEAST: usize, const MOST: usize> Count<LEAST, MOST> {
    /// Reads the value. Returns an error if it is of another kind or out of range.
    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<usize, D::Error> {
        check::<LEAST, MOST, _>(AnyWhole::deserialize(deserializer)?)
    }
}

impl<const LEAST: usize, const MOST: usize> MaybeCount<LEAST, MOST> {
    /// Reads the value. Returns an error if it is of another kind or out of range.
    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<usize>, D::Error> {
        Count::<LEAST, MOST>::deserialize(deserializer).map(Some)
    }
}

impl<const LEAST: usize, const MOST: usize, const N: usize> Counts<LEAST, MOST, N> {
    /// Reads the value. Returns an error if it is of another kind or out of range.
    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<[usize; N], D::Error> {
        whole::<LEAST, MOST, N, D>(deserializer)
    }
}

impl MaybeVertices {
    /// Reads the value. Returns an error if it is of another kind or out of range.
    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<Vec<usize>>, D::Error> {
        let numbers = Vec::<AnyWhole>::deserialize(deserializer)?;
        if numbers.is_empty() {
            return Err(D::Error::custom("expected at least one vertex, got an empty list"));
        }
        numbers.into_iter().map(check::<0, LARGEST_INDEX, _>).collect::<Result<_, _>>().map(Some)
    }
}

impl Pairs {
    /// Reads the value. Returns an error if it is of another kind or out of range.
    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<Vec<[usize; 2]>>, D::Error> {
        struct One([usize; 2]);
        impl<'de> Deserialize<'de> for One {
            fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                whole::<0, LARGEST_INDEX, 2, D>(deserializer).map(One)
            }
        }
        Vec::<One>::deserialize(deserializer).map(|pairs| Some(pairs.into_iter().map(|One(pair)| pair).collect()))
    }
}

impl Pair {
    /// Reads the value. Returns an error if it is of another kind or out of range.
    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<[String; 2], D::Error> {
        exactly(Vec::deserialize(deserializer)?)
    }
}

impl MaybePair {
    /// Reads the value. Returns an error if it is of another kind or out of range.
    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<[String; 2]>, D::Error> {
        Pair::deserialize(deserializer).map(Some)
    }
}

fn integer(least: usize, most: usize) -> Schema {
    json_schema!({ "type": "integer", "minimum": least, "maximum": most })
}

described!([const LEAST: usize, const MOST: usize] Count<LEAST, MOST>, usize, integer(LEAST, MOST));
described!([const LEAST: usize, const MOST: usize] MaybeCount<LEAST, MOST>, Option<usize>, integer(LEAST, MOST));
described!([const LEAST: usize, const MOST: usize, const N: usize] Counts<LEAST, MOST, N>, [usize],
    array(&integer(LEAST, MOST), N));
described!([] MaybeVertices, Option<Vec<usize>>, json_schema!({
    "type": "array", "items": integer(0, LARGEST_INDEX), "minItems": 1
}));
described!([] Pairs, Option<Vec<[usize; 2]>>, json_schema!({
    "type": "array", "items": array(&integer(0, LARGEST_INDEX), 2)
}));
described!([] Pair, [String], array(&json_schema!({ "type": "string" }), 2));
described!([] MaybePair, Option<[String; 2]>, array(&json_schema!({ "type": "string" }), 2));
