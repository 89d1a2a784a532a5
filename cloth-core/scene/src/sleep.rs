use std::fmt;

use schemars::JsonSchema;
use serde::de::value::MapAccessDeserializer;
use serde::de::{Deserialize, Deserializer, Error, MapAccess, Visitor};

use cloth_physics::bounded::{MaybeReal, Positive, Real};

/// When islands (sets of vertices that no force couples) fall asleep. An island falls asleep once, for the time
/// `after`, every vertex was slower than `speed` and changed its velocity by at most half of `speed`, and no pin or
/// obstacle that acts on it moves. A sleeping island is not stepped. It stays bit-identical until one of its pins or a
/// nearby obstacle moves.
///
/// Sleep discards slow residual motion. A motion that decays as exp(−t/τ) would have travelled at most `speed` × τ
/// further.
#[derive(Clone, Copy, Debug, PartialEq, serde::Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Sleep {
    /// Speed limit, in m/s. Default 0.001/s times the diagonal of the island's initial bounding box.
    #[serde(default, with = "MaybeReal::<Positive>")]
    pub speed: Option<f64>,
    /// Time below the speed limit, in s. Default 0.5.
    #[serde(default = "half_a_second", with = "Real::<Positive>")]
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

/// The value of `sleep` in a scene file, for the schema.
#[derive(JsonSchema)]
#[serde(untagged)]
#[expect(dead_code, reason = "for the schema only")]
pub(super) enum SleepChoice {
    /// `true`: sleep with all defaults; `false`: never sleep.
    Whether(bool),
    /// Sleep with these settings.
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
