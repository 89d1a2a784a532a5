use std::fmt;

use schemars::JsonSchema;
use serde::de::value::MapAccessDeserializer;
use serde::de::{Deserialize, Deserializer, Error, MapAccess, Visitor};

use crate::bounded::{positive, some_positive};

/// When islands (vertices that nothing couples to others) fall asleep: once each of their vertices was slower than `speed` for the time `after`, and changed
/// its velocity over that time by no more than half of that, and nothing that acts on them moves. An island that sleeps is not stepped: it stays
/// where it is to the last bit, until a pin of it or an obstacle near it moves.
///
/// What is frozen so may have had a little way to go. A motion that dies down as exp(−t/τ) and is as slow as `speed` comes no further than `speed` × τ.
#[derive(Clone, Copy, Debug, PartialEq, serde::Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Sleep {
    /// In m/s. Default a thousandth of the island's size a second: of the diagonal of the box around it at the start.
    #[serde(default, deserialize_with = "some_positive")]
    pub speed: Option<f64>,
    /// In s. Default 0.5.
    #[serde(default = "half_a_second", deserialize_with = "positive")]
    pub after: f64,
}

fn half_a_second() -> f64 {
    0.5
}

impl Default for Sleep {
    fn default() -> Self {
        Self { speed: None, after: half_a_second() }
    }
}

/// What a scene file may say of sleep.
#[derive(JsonSchema)]
#[serde(untagged)]
#[expect(dead_code, reason = "it is there for its schema")]
pub(super) enum SleepChoice {
    /// `true`: with all defaults; `false`: never.
    Whether(bool),
    /// With these.
    With(Sleep),
}

struct Choice;

impl<'de> Visitor<'de> for Choice {
    type Value = Option<Sleep>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("`true`, `false` or a table with `speed` and `after`")
    }

    fn visit_bool<E: Error>(self, whether: bool) -> Result<Option<Sleep>, E> {
        Ok(whether.then(Sleep::default))
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Option<Sleep>, A::Error> {
        Sleep::deserialize(MapAccessDeserializer::new(map)).map(Some)
    }
}

pub(super) fn sleep<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<Sleep>, D::Error> {
    deserializer.deserialize_any(Choice)
}
