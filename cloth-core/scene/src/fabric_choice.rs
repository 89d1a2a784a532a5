//! A fabric in a scene file: described in place, or chosen by name.

use std::fmt;

use schemars::JsonSchema;
use serde::de::value::MapAccessDeserializer;
use serde::de::{Deserialize, Deserializer, Error, MapAccess, Visitor};

use cloth_physics::fabric::{Fabric, in_library};

/// A fabric in a scene file, for the schema.
#[derive(JsonSchema)]
#[serde(untagged)]
#[expect(dead_code, reason = "for the schema only")]
pub(crate) enum FabricChoice {
    /// The name of a fabric of the library.
    Name(String),
    /// A fabric described in place.
    Described(Box<Fabric>),
}

/// A table of the library.
#[derive(serde::Deserialize)]
struct Alone {
    fabric: Fabric,
}

struct Choice;

impl<'de> Visitor<'de> for Choice {
    type Value = Fabric;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the table of a fabric, or the name of one of the library in quotes")
    }

    fn visit_str<E: Error>(self, name: &str) -> Result<Fabric, E> {
        let found = in_library(name).map_err(E::custom)?;
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
    use cloth_physics::fabric::{Bending, LIBRARY, Material};

    #[test]
    fn every_table_makes_a_scene_of_yarns_with_a_plate_and_friction() {
        for fabric in LIBRARY {
            let text =
                format!("dt = 0.01\nduration = 0.1\n[mesh.sheet]\ncells = [2, 2]\nsize = [1.0, 1.0]\n{}", fabric.table);
            let scene = Scene::parse(&text, "scene.toml".as_ref()).unwrap();
            let described = &scene.garments[0].fabric;
            assert!(described.friction.sliding > 0.2 && described.friction.at_rest > described.friction.sliding);
            let Material::Yarns(yarns) = &described.material else { panic!("{}", fabric.name) };
            let law = yarns.law().unwrap();
            assert!(law.shear.k < law.weft.k && law.misfits == [0.0; 3], "{law:?}");
            let Bending::Plate(rigidity) = yarns.bending else { panic!("{}", fabric.name) };
            let d = rigidity.matrix().unwrap();
            assert!(d[0][0] > 1e-6 && d[2][2] > 5e-7, "{}: {d:?}", fabric.name);
        }
    }

    #[test]
    fn every_number_of_the_library_has_a_source_or_is_marked_as_assumed() {
        for fabric in LIBRARY {
            let (head, body) = fabric.table.split_once("[fabric]").unwrap();
            let sources: Vec<&str> =
                head.lines().filter_map(|line| line.strip_prefix("# - ")?.split(':').next()).collect();
            for line in body.lines().filter(|line| line.contains('=')) {
                let comment = line.split_once('#').map_or("", |(_, comment)| comment);
                assert!(sources.iter().any(|source| comment.contains(source)), "{}: {line}", fabric.name);
            }
            for source in &sources {
                assert!(body.contains(source), "{}: {source} is not used", fabric.name);
            }
        }
    }

    #[test]
    fn a_name_of_an_earlier_version_gives_the_most_similar_fabric() {
        let scene = |name: &str| {
            let text = format!(
                "dt = 0.01\nduration = 0.1\n[[garment]]\nfabric = \"{name}\"\nmesh.disc = {{ radius = 1.0, rings = 2 }}\n"
            );
            Scene::parse(&text, "scene.toml".as_ref()).unwrap_err().to_string()
        };
        let old = ["interlock", "ribbon", "dots", "ponte", "rib", "sweat", "swim", "jacket", "target"];
        for name in old {
            let error = scene(name);
            let named = LIBRARY.iter().filter(|fabric| error.contains(&format!("is `{}`", fabric.name))).count();
            assert_eq!(named, 1, "{error}");
        }
        assert!(scene("leather").contains("`cotton-shirting`, `denim`"), "{}", scene("leather"));
    }
}
