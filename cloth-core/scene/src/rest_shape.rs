use std::path::PathBuf;

use schemars::JsonSchema;
use serde::Deserialize;

use cloth_physics::bounded::{Positive, Real};

/// The rest shape of a garment, in place of that of its mesh.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum RestShape {
    /// A second OBJ file with the same faces in the same order, with lengths in m, such as the patterns laid flat.
    /// Vertices may be doubled where patterns are cut apart.
    Obj(RestFile),
    /// The texture coordinates of the OBJ file, as patterns in a plane.
    Uv(RestTexture),
}

/// A file with a rest shape.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RestFile {
    /// Path of the OBJ file, relative to the scene file's folder.
    pub path: PathBuf,
}

/// Texture coordinates as a rest shape.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RestTexture {
    /// Length of a unit of the texture coordinates, in m.
    #[serde(with = "Real::<Positive>")]
    pub scale: f64,
}

/// Factors of the rest shape of a group of triangles: below 1 they pull together, above 1 there is more cloth.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RestScale {
    /// Name of a group, object or material of the OBJ file. Default all triangles.
    #[serde(default)]
    pub group: Option<String>,
    /// Factor along the warp. Default 1.
    #[serde(default = "one", with = "Real::<Positive>")]
    pub warp: f64,
    /// Factor along the weft. Default 1.
    #[serde(default = "one", with = "Real::<Positive>")]
    pub weft: f64,
}

fn one() -> f64 {
    1.0
}
