use std::borrow::Cow;
use std::fmt;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::value::SeqAccessDeserializer;
use serde::de::{Deserializer, Error, SeqAccess, Visitor};
use serde::{Serialize, Serializer};

use crate::bounded::Direction;
use crate::mesh::Warp;

/// The warp in a scene file: a direction, or the name `uv`.
pub(crate) struct WarpChoice;

/// A warp, or none.
pub struct MaybeWarpChoice;

impl WarpChoice {
    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Warp, D::Error> {
        struct Choice;
        impl<'de> Visitor<'de> for Choice {
            type Value = Warp;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a direction such as [1.0, 0.0, 0.0], or \"uv\"")
            }

            fn visit_str<E: Error>(self, name: &str) -> Result<Warp, E> {
                let unknown = || E::custom(format!("unknown warp `{name}`, expected a direction or `uv`"));
                (name == "uv").then_some(Warp::Uv).ok_or_else(unknown)
            }

            fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<Warp, A::Error> {
                Direction::deserialize(SeqAccessDeserializer::new(seq)).map(Warp::Direction)
            }
        }
        deserializer.deserialize_any(Choice)
    }

    pub(crate) fn serialize<S: Serializer>(warp: &Warp, serializer: S) -> Result<S::Ok, S::Error> {
        match warp {
            Warp::Direction(direction) => direction.serialize(serializer),
            Warp::Uv => "uv".serialize(serializer),
        }
    }
}

impl MaybeWarpChoice {
    /// Reads a choice of the warp.
    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<Warp>, D::Error> {
        WarpChoice::deserialize(deserializer).map(Some)
    }

    /// Writes a choice of the warp.
    pub fn serialize<S: Serializer>(warp: &Option<Warp>, serializer: S) -> Result<S::Ok, S::Error> {
        match warp {
            Some(warp) => WarpChoice::serialize(warp, serializer),
            None => serializer.serialize_none(),
        }
    }
}

impl JsonSchema for MaybeWarpChoice {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        WarpChoice::schema_name()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        WarpChoice::json_schema(generator)
    }
}

impl JsonSchema for WarpChoice {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        "Warp".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        json_schema!({ "anyOf": [Direction::json_schema(generator), { "const": "uv" }] })
    }
}
