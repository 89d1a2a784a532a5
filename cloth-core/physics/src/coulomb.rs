//! Coefficients of friction at rest and in motion.

use std::borrow::Cow;
use std::fmt;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::value::MapAccessDeserializer;
use serde::de::{Deserialize, Deserializer, Error, MapAccess, Visitor};
use serde::ser::SerializeStruct;
use serde::{Serialize, Serializer};

use crate::bounded::{NonNegative, Range, Real};

/// Coefficients of Coulomb friction: a pair at rest holds up to `at_rest` times the normal force; a pair that slips
/// has `sliding` times it.
///
/// In files it is a number, for both, or a table with the keys `static` and `kinetic`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Coulomb {
    /// Static coefficient; at least the kinetic one.
    pub at_rest: f64,
    /// Kinetic coefficient.
    pub sliding: f64,
}

impl Coulomb {
    /// Returns the friction with one coefficient at rest and in motion.
    #[must_use]
    pub fn uniform(coefficient: f64) -> Self {
        Self { at_rest: coefficient, sliding: coefficient }
    }

    /// Whether anything is held.
    #[must_use]
    pub fn is_zero(&self) -> bool {
        self.at_rest <= 0.0
    }

    /// Returns the mean of the friction of two surfaces.
    #[must_use]
    pub fn between(self, other: Self) -> Self {
        let mean = |a: f64, b: f64| 0.5 * (a + b);
        Self { at_rest: mean(self.at_rest, other.at_rest), sliding: mean(self.sliding, other.sliding) }
    }
}

/// The table of two coefficients.
#[derive(serde::Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Keys {
    /// Static coefficient, at rest; at least `kinetic`.
    #[serde(rename = "static", with = "Real::<NonNegative>")]
    at_rest: f64,
    /// Kinetic coefficient, in motion.
    #[serde(rename = "kinetic", with = "Real::<NonNegative>")]
    sliding: f64,
}

impl<'de> Deserialize<'de> for Coulomb {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Choice;
        impl<'de> Visitor<'de> for Choice {
            type Value = Coulomb;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a coefficient, or the table { static, kinetic }")
            }

            fn visit_f64<E: Error>(self, number: f64) -> Result<Coulomb, E> {
                NonNegative::check(number, &[]).map(|()| Coulomb::uniform(number))
            }

            fn visit_i64<E: Error>(self, number: i64) -> Result<Coulomb, E> {
                self.visit_f64(number as f64)
            }

            fn visit_u64<E: Error>(self, number: u64) -> Result<Coulomb, E> {
                self.visit_f64(number as f64)
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Coulomb, A::Error> {
                let Keys { at_rest, sliding } = Keys::deserialize(MapAccessDeserializer::new(map))?;
                if sliding > at_rest {
                    return Err(A::Error::custom(format!(
                        "expected a kinetic coefficient of at most the static one, {at_rest}, got {sliding}"
                    )));
                }
                Ok(Coulomb { at_rest, sliding })
            }
        }
        deserializer.deserialize_any(Choice)
    }
}

impl Serialize for Coulomb {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        if self.at_rest == self.sliding {
            return serializer.serialize_f64(self.sliding);
        }
        let mut table = serializer.serialize_struct("Coulomb", 2)?;
        table.serialize_field("static", &self.at_rest)?;
        table.serialize_field("kinetic", &self.sliding)?;
        table.end()
    }
}

impl JsonSchema for Coulomb {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        "Friction".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        json_schema!({ "anyOf": [NonNegative::schema(), Keys::json_schema(generator)] })
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn read(value: serde_json::Value) -> Result<Coulomb, String> {
        serde_json::from_value(value).map_err(|error| error.to_string())
    }

    #[test]
    fn one_number_holds_at_rest_and_in_motion() {
        assert_eq!(read(json!(0.3)), Ok(Coulomb { at_rest: 0.3, sliding: 0.3 }));
        assert_eq!(read(json!(1)), Ok(Coulomb::uniform(1.0)));
        let two = read(json!({ "static": 0.5, "kinetic": 0.4 })).unwrap();
        assert_eq!(two, Coulomb { at_rest: 0.5, sliding: 0.4 });
        assert_eq!(two.between(Coulomb::uniform(0.2)), Coulomb { at_rest: 0.35, sliding: 0.5 * (0.4 + 0.2) });
    }

    #[test]
    fn impossible_coefficients_are_refused_with_their_remedy() {
        for (value, message) in [
            (json!(-1), "a finite number of at least 0, got -1"),
            (json!({ "static": 0.3, "kinetic": 0.4 }), "at most the static one, 0.3, got 0.4"),
            (json!({ "static": 0.3 }), "missing field `kinetic`"),
            (json!("rough"), "expected a coefficient, or the table { static, kinetic }"),
        ] {
            let error = read(value).unwrap_err();
            assert!(error.contains(message), "{error}");
        }
    }
}
