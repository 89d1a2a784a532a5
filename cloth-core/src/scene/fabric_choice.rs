//! A fabric, in place or by name.

use std::fmt;

use schemars::JsonSchema;
use serde::de::value::MapAccessDeserializer;
use serde::de::{Deserialize, Deserializer, Error, MapAccess, Visitor};

use crate::fabric::{Fabric, MEASURED};

/// What a scene file may say of a fabric.
#[derive(JsonSchema)]
#[serde(untagged)]
#[expect(dead_code, reason = "it is there for its schema")]
pub(crate) enum FabricChoice {
    /// The name of a measured fabric.
    Name(String),
    /// A fabric described in place.
    Described(Box<Fabric>),
}

/// A measured fabric alone in a text.
#[derive(serde::Deserialize)]
struct Alone {
    fabric: Fabric,
}

struct Choice;

impl<'de> Visitor<'de> for Choice {
    type Value = Fabric;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a table that describes a fabric, or the name of a measured one")
    }

    fn visit_str<E: Error>(self, name: &str) -> Result<Fabric, E> {
        const NAMES: [&str; MEASURED.len()] = {
            let mut names = [""; MEASURED.len()];
            let mut at = 0;
            while at < names.len() {
                names[at] = MEASURED[at].name;
                at += 1;
            }
            names
        };
        let found = MEASURED.iter().find(|fabric| fabric.name == name);
        let found = found.ok_or_else(|| E::unknown_variant(name, &NAMES))?;
        toml::from_str::<Alone>(found.table).map(|alone| alone.fabric).map_err(E::custom)
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Fabric, A::Error> {
        Fabric::deserialize(MapAccessDeserializer::new(map))
    }
}

pub(crate) fn fabric<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Fabric, D::Error> {
    deserializer.deserialize_any(Choice)
}
