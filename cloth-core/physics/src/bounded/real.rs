use std::collections::BTreeMap;
use std::fmt;
use std::marker::PhantomData;

use schemars::{Schema, json_schema};
use serde::de::{Deserialize, Deserializer, Error, Visitor};

use super::described::{array, described};
use super::exactly;
use super::range::{Channel, Number, Positive, Range};

/// A real number of any size.
struct AnyReal(f64);

impl<'de> Deserialize<'de> for AnyReal {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct RealVisitor;
        impl Visitor<'_> for RealVisitor {
            type Value = AnyReal;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a number")
            }

            fn visit_f64<E: Error>(self, number: f64) -> Result<AnyReal, E> {
                Ok(AnyReal(number))
            }

            fn visit_i64<E: Error>(self, number: i64) -> Result<AnyReal, E> {
                Ok(AnyReal(number as f64))
            }

            fn visit_u64<E: Error>(self, number: u64) -> Result<AnyReal, E> {
                Ok(AnyReal(number as f64))
            }
        }
        deserializer.deserialize_any(RealVisitor)
    }
}

fn reals<'de, R: Range, const N: usize, D: Deserializer<'de>>(deserializer: D) -> Result<[f64; N], D::Error> {
    let numbers = Vec::<AnyReal>::deserialize(deserializer)?.into_iter().map(|AnyReal(number)| number).collect();
    let numbers: [f64; N] = exactly(numbers)?;
    numbers.iter().try_for_each(|&number| R::check(number, &numbers)).map(|()| numbers)
}

/// A number of the range R.
pub struct Real<R>(PhantomData<R>);

/// A number of the range R, or none.
pub struct MaybeReal<R>(PhantomData<R>);

/// N numbers of the range R.
pub struct Reals<R, const N: usize>(PhantomData<R>);

/// N numbers of the range R, or none.
pub struct MaybeReals<R, const N: usize>(PhantomData<R>);

/// A list of numbers of the range R, or none.
pub struct MaybeRealList<R>(PhantomData<R>);

/// Points of a curve, with coordinates above 0.
pub struct Points;

/// A list of RGB colours.
pub struct Colours;

/// Named numbers of the range R.
pub struct RealMap<R>(PhantomData<R>);

/// Three numbers that are not all zero.
pub struct Direction;

impl<R: Range> Real<R> {
    /// Reads the value. Returns an error if it is of another kind or out of range.
    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
        let AnyReal(number) = AnyReal::deserialize(deserializer)?;
        R::check(number, &[]).map(|()| number)
    }
}

impl<R: Range> MaybeReal<R> {
    /// Reads the value. Returns an error if it is of another kind or out of range.
    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<f64>, D::Error> {
        Real::<R>::deserialize(deserializer).map(Some)
    }
}

impl<R: Range> MaybeRealList<R> {
    /// Reads the value. Returns an error if it is of another kind or out of range.
    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<Vec<f64>>, D::Error> {
        let numbers: Vec<f64> = Vec::<AnyReal>::deserialize(deserializer)?.into_iter().map(|AnyReal(n)| n).collect();
        numbers.iter().try_for_each(|&number| R::check(number, &numbers))?;
        Ok(Some(numbers))
    }
}

/// Reads a list of arrays of N numbers of the range R.
fn list_of<'de, R: Range, const N: usize, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<[f64; N]>, D::Error> {
    struct One<R, const N: usize>([f64; N], PhantomData<R>);
    impl<'de, R: Range, const N: usize> Deserialize<'de> for One<R, N> {
        fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
            reals::<R, N, D>(deserializer).map(|numbers| One(numbers, PhantomData))
        }
    }
    Ok(Vec::<One<R, N>>::deserialize(deserializer)?.into_iter().map(|One(numbers, _)| numbers).collect())
}

impl Colours {
    /// Reads the value. Returns an error if it is of another kind or out of range.
    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<[f64; 3]>, D::Error> {
        list_of::<Channel, 3, D>(deserializer)
    }
}

impl Points {
    /// Reads the value. Returns an error if it is of another kind or out of range.
    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<[f64; 2]>, D::Error> {
        list_of::<Positive, 2, D>(deserializer)
    }
}

impl<R: Range, const N: usize> Reals<R, N> {
    /// Reads the value. Returns an error if it is of another kind or out of range.
    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<[f64; N], D::Error> {
        reals::<R, N, D>(deserializer)
    }
}

impl<R: Range, const N: usize> MaybeReals<R, N> {
    /// Reads the value. Returns an error if it is of another kind or out of range.
    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<[f64; N]>, D::Error> {
        reals::<R, N, D>(deserializer).map(Some)
    }
}

impl<R: Range> RealMap<R> {
    /// Reads the value. Returns an error if it is of another kind or out of range.
    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<BTreeMap<String, f64>, D::Error> {
        let map = BTreeMap::<String, AnyReal>::deserialize(deserializer)?;
        map.into_iter().map(|(name, AnyReal(number))| R::check(number, &[]).map(|()| (name, number))).collect()
    }
}

impl Direction {
    /// Reads the value. Returns an error if it is of another kind or out of range.
    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<[f64; 3], D::Error> {
        let numbers = reals::<Number, 3, D>(deserializer)?;
        let largest = numbers.iter().fold(0.0, |largest: f64, number| largest.max(number.abs()));
        if largest == 0.0 {
            return Err(D::Error::custom(format!("expected a direction, not zero, got {numbers:?}")));
        }
        // The squared length must be representable.
        let square: f64 = numbers.iter().map(|number| number * number).sum();
        Ok(if square.is_normal() { numbers } else { numbers.map(|number| number / largest) })
    }
}

fn direction() -> Schema {
    let mut schema = array(&Number::schema(), 3);
    schema.insert("not".to_owned(), serde_json::json!({ "const": [0.0, 0.0, 0.0] }));
    schema
}

described!([R: Range] Real<R>, f64, R::schema());
described!([R: Range] MaybeReal<R>, Option<f64>, R::schema());
described!([R: Range, const N: usize] Reals<R, N>, [f64], array(&R::schema(), N));
described!([R: Range, const N: usize] MaybeReals<R, N>, Option<[f64; 3]>, array(&R::schema(), N));
described!([R: Range] MaybeRealList<R>, Option<Vec<f64>>, json_schema!({ "type": "array", "items": R::schema() }));
described!([] Colours, Vec<[f64; 3]>, json_schema!({
    "type": "array", "items": array(&Channel::schema(), 3)
}));
described!([] Points, Vec<[f64; 2]>, json_schema!({
    "type": "array", "items": array(&Positive::schema(), 2)
}));
described!([R: Range] RealMap<R>, BTreeMap<String, f64>, json_schema!({
    "type": "object", "additionalProperties": R::schema()
}));
described!([] Direction, [f64; 3], direction());
