use std::path::PathBuf;

use schemars::JsonSchema;
use serde::Deserialize;

use super::rest_shape::{RestScale, RestShape};
use cloth_physics::bounded::{Direction, MaybeReal, NonNegative, Number, Positive, Real, Reals, Speed};
use cloth_physics::fabric::{Fabric, MaybeWarpChoice};
use cloth_physics::geometry::Pose;
use cloth_physics::mesh::{Disc, Sheet, Strip, Warp};

/// A piece of cloth.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Garment {
    /// Name for pins and seams. Default `garment` and its index from 0.
    #[serde(default)]
    pub name: Option<String>,
    /// Shape: the table `sheet`, `disc`, `strip` or `obj`.
    pub mesh: Mesh,
    /// Fabric: a table, or the name of a fabric of the library (see `cloth fabrics`).
    #[serde(deserialize_with = "crate::fabric_choice::fabric")]
    #[schemars(with = "crate::fabric_choice::FabricChoice")]
    pub fabric: Fabric,
    /// Direction of the warp, in place of that of the fabric: a direction, or `uv`; see the key of the fabric. Default
    /// that of the fabric.
    #[serde(default, with = "MaybeWarpChoice")]
    pub warp: Option<Warp>,
    /// Rest shape: the table `obj` or `uv`. Default that of `mesh`.
    #[serde(default)]
    pub rest: Option<RestShape>,
    /// Factors that shrink or stretch the rest shape, by group. Default none.
    #[serde(default)]
    pub rest_scale: Vec<RestScale>,
    /// Overpressure inside, for a closed mesh. Default none.
    #[serde(default)]
    pub inflation: Option<Inflation>,
    /// Initial placement. Default as built.
    #[serde(default)]
    pub placement: Placement,
    /// Initial velocity, in m/s. Default 0.
    #[serde(default, with = "Reals::<Speed, 3>")]
    pub velocity: [f64; 3],
    /// Initial angular velocity about the placed origin, in rad/s. Default 0.
    #[serde(default, with = "Reals::<Number, 3>")]
    pub spin: [f64; 3],
}

/// The rest shape and initial shape of a garment.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Mesh {
    /// A rectangular sheet.
    Sheet(Sheet),
    /// A round sheet.
    Disc(Disc),
    /// A narrow sheet.
    Strip(Strip),
    /// An OBJ file, with lengths in m.
    Obj {
        /// Path, relative to the scene file's folder.
        path: PathBuf,
        /// Names of groups, objects or materials of the file; only their faces become the garment. Default all faces.
        #[serde(default)]
        groups: Option<Vec<String>>,
        /// Merges vertices that are at most this far apart, in m, such as those that exporters double along seams of
        /// texture coordinates. Default: vertices stay apart.
        #[serde(default, with = "MaybeReal::<NonNegative>")]
        weld: Option<f64>,
    },
}

/// Overpressure inside a closed mesh, whose corners run anticlockwise seen from outside.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Inflation {
    /// Overpressure, in Pa.
    #[serde(with = "Real::<Number>")]
    pub pressure: f64,
    /// Time in which the pressure rises from 0, linearly, in s. Default 0: at once.
    #[serde(default, with = "Real::<NonNegative>")]
    pub rise: f64,
}

impl Inflation {
    /// Returns the pressure at a time in s, in Pa.
    #[must_use]
    pub fn at(&self, time: f64) -> f64 {
        if time < self.rise { self.pressure * (time / self.rise).max(0.0) } else { self.pressure }
    }
}

/// Scales, then rotates, then translates. Scaling also scales the rest shape.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Placement {
    /// Scale factor. Default 1.
    #[serde(default = "one", with = "Real::<Positive>")]
    pub scale: f64,
    /// Rotation about an axis through the origin. Default none.
    #[serde(default)]
    pub rotate: Option<Turn>,
    /// Translation, in m. Default none.
    #[serde(default, with = "Reals::<Number, 3>")]
    pub translate: [f64; 3],
}

/// A right-handed rotation about an axis.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Turn {
    /// Direction of the axis.
    #[serde(with = "Direction")]
    pub axis: [f64; 3],
    /// Angle, in degrees.
    #[serde(with = "Real::<Number>")]
    pub angle: f64,
}

fn one() -> f64 {
    1.0
}

impl Default for Placement {
    fn default() -> Self {
        Self { scale: 1.0, rotate: None, translate: [0.0; 3] }
    }
}

impl Placement {
    /// Returns the rotation and translation.
    #[must_use]
    pub fn pose(&self) -> Pose {
        let rotation = self.rotate.map_or(Pose::IDENTITY, |turn| Pose::rotation(turn.axis, turn.angle, [0.0; 3]));
        rotation.translated(self.translate)
    }
}
