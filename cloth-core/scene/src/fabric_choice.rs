//! A fabric in a scene file: described in place, or chosen by name.

use std::fmt;

use schemars::JsonSchema;
use serde::de::value::MapAccessDeserializer;
use serde::de::{Deserialize, Deserializer, Error, MapAccess, Visitor};

use cloth_physics::fabric::{Fabric, MEASURED};

/// A fabric in a scene file, for the schema.
#[derive(JsonSchema)]
#[serde(untagged)]
#[expect(dead_code, reason = "for the schema only")]
pub(crate) enum FabricChoice {
    /// The name of a measured fabric.
    Name(String),
    /// A fabric described in place.
    Described(Box<Fabric>),
}

/// A file that consists of a measured fabric.
#[derive(serde::Deserialize)]
struct Alone {
    fabric: Fabric,
}

struct Choice;

impl<'de> Visitor<'de> for Choice {
    type Value = Fabric;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the table of a fabric, or the name of a measured one in quotes")
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
        let found = found.ok_or_else(|| {
            let known = NAMES.map(|known| format!("`{known}`")).join(", ");
            E::custom(format!("unknown fabric `{name}`, expected a table or one of the measured fabrics {known}"))
        })?;
        toml::from_str::<Alone>(found.table).map(|alone| alone.fabric).map_err(E::custom)
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Fabric, A::Error> {
        Fabric::deserialize(MapAccessDeserializer::new(map))
    }
}

pub(crate) fn fabric<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Fabric, D::Error> {
    deserializer.deserialize_any(Choice)
}

#[cfg(test)]
mod tests {
    use crate::Scene;
    use cloth_physics::fabric::{Bending, MEASURED, Material};

    #[test]
    fn every_table_makes_a_scene_with_a_plate() {
        for fabric in MEASURED {
            let text =
                format!("dt = 0.01\nduration = 0.1\n[mesh.sheet]\ncells = [2, 2]\nsize = [1.0, 1.0]\n{}", fabric.table);
            let scene = Scene::parse(&text, "scene.toml".as_ref()).unwrap();
            let bending = match &scene.garments[0].fabric.material {
                Material::Stvk(membrane) => {
                    assert!(fabric.table.contains("Stretching and shear: *assumed*"), "{}", fabric.name);
                    membrane.bending
                }
                Material::OrthotropicStvk(woven) => {
                    let least = woven.warp.min(woven.weft).min(woven.bias);
                    assert!(least > 5.0 && fabric.table.contains("Stretching and shear: of the same sample"));
                    woven.bending
                }
                other => panic!("{}: {other:?}", fabric.name),
            };
            let Bending::Plate(rigidity) = bending else { panic!("{}", fabric.name) };
            let d = rigidity.matrix().unwrap();
            assert!(d[0][0] > 1e-5 && d[2][2] > 1e-6, "{}: {d:?}", fabric.name);
        }
    }

    #[test]
    fn the_strip_of_denim_is_that_of_the_table() {
        let scene = Scene::parse(include_str!("../../../scenes/strip.toml"), "strip.toml".as_ref()).unwrap();
        let denim = MEASURED[0].table.split("[fabric]").nth(1).unwrap();
        let Material::Stvk(membrane) = &scene.garments[0].fabric.material else { panic!("another material") };
        let Bending::Plate(cloth_physics::fabric::Rigidity::Orthotropic { warp, .. }) = membrane.bending else {
            panic!("no plate")
        };
        assert!(
            denim.contains("density = 0.324")
                && scene.garments[0].fabric.density == 0.324
                && (warp - 64.196_457e-6).abs() < 1e-15
        );
        assert!(scene.adaptive);
    }
}
