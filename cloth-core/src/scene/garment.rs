use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use energy_dsl::Vector3;
use schemars::JsonSchema;
use serde::Deserialize;

use crate::bounded::{Direction, MaybeReal, NonNegative, Number, Positive, Real, Reals, Speed};
use crate::fabric::{Fabric, MaybeWarpChoice};
use crate::geometry::{Pose, cross, subtract};
use crate::mesh::{
    CornerAttributes, Disc, MeshError, ObjError, ObjOptions, PleatsError, Sheet, SpringNetwork, Strip, Topology,
    TriangleMesh, Warp, read_obj_surface,
};

/// A piece of cloth.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Garment {
    /// Name for pins and seams. Default `garment` and its index from 0.
    #[serde(default)]
    pub name: Option<String>,
    /// Shape: the table `sheet`, `disc`, `strip` or `obj`.
    pub mesh: Mesh,
    /// Fabric: a table, or the name of a measured fabric (see `cloth fabrics`).
    #[serde(deserialize_with = "super::fabric_choice::fabric")]
    #[schemars(with = "super::fabric_choice::FabricChoice")]
    pub fabric: Fabric,
    /// Direction of the warp, in place of that of the fabric: a direction, or `uv`; see the key of the fabric. Default
    /// that of the fabric.
    #[serde(default, with = "MaybeWarpChoice")]
    pub warp: Option<Warp>,
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

/// A mesh that cannot be built.
#[derive(Debug, thiserror::Error)]
pub enum MeshSourceError {
    /// The OBJ file is invalid.
    #[error(transparent)]
    Obj(#[from] ObjError),
    /// A built-in or scaled mesh is invalid.
    #[error("mesh: {0}")]
    Built(#[from] MeshError),
    /// The pleats of a sheet are too deep.
    #[error("mesh.sheet.pleats: {0}")]
    Pleats(#[from] PleatsError),
}

/// The shape of a garment.
#[derive(Clone, Debug, PartialEq)]
pub struct Shape {
    /// The rest mesh.
    pub mesh: TriangleMesh,
    /// Initial positions, in m.
    pub start: Vec<Vector3<f64>>,
    /// Initial velocities, in m/s.
    pub velocities: Vec<Vector3<f64>>,
    /// The vertex pairs that a mass–spring fabric joins.
    pub springs: SpringNetwork,
    /// Attributes of the corners, from an OBJ file.
    pub corners: CornerAttributes,
    /// The vertices of each group of an OBJ file.
    pub groups: BTreeMap<String, Vec<usize>>,
    /// Number of vertices that were merged with another one; `None` unless the garment comes from an OBJ file.
    pub welded: Option<usize>,
}

impl Garment {
    /// Builds the shape. Relative paths refer to `folder`.
    ///
    /// # Errors
    /// Returns an error if the file cannot be read or the mesh is invalid.
    pub fn shape(&self, folder: &Path) -> Result<Shape, MeshSourceError> {
        let sheet = match &self.mesh {
            Mesh::Sheet(sheet) => Some(*sheet),
            Mesh::Strip(strip) => Some(strip.sheet()),
            Mesh::Disc(_) | Mesh::Obj { .. } => None,
        };
        let (mut corners, mut groups, mut welded) = (CornerAttributes::default(), BTreeMap::new(), None);
        let mesh = match &self.mesh {
            Mesh::Sheet(sheet) => sheet.mesh()?,
            Mesh::Strip(strip) => strip.sheet().mesh()?,
            Mesh::Disc(disc) => disc.mesh()?,
            Mesh::Obj { path, groups: chosen, weld } => {
                let options = ObjOptions { groups: chosen.as_deref(), weld: *weld };
                let surface = read_obj_surface(&folder.join(path), options)?;
                (corners, groups, welded) = (surface.corners, surface.groups, Some(surface.welded));
                surface.mesh
            }
        };
        let initial = sheet.map_or_else(|| Ok(mesh.vertices().to_vec()), |sheet| sheet.start())?;
        let springs = match &sheet {
            Some(sheet) => SpringNetwork::of_sheet(sheet),
            None => SpringNetwork::of_mesh(&Topology::of(&mesh)),
        };
        let Placement { scale, translate, .. } = self.placement;
        let mesh = if scale == 1.0 { mesh } else { mesh.scaled(scale)? };
        let pose = self.placement.pose();
        let start: Vec<Vector3<f64>> = initial.iter().map(|p| pose.transform(p.map(|c| scale * c))).collect();
        let velocity = |p: &Vector3<f64>| -> Vector3<f64> {
            let turning = cross(self.spin, subtract(*p, translate));
            std::array::from_fn(|axis| self.velocity[axis] + turning[axis])
        };
        let velocities = start.iter().map(velocity).collect();
        Ok(Shape { mesh, velocities, start, springs, corners, groups, welded })
    }
}
