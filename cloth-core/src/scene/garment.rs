use std::path::{Path, PathBuf};

use energy_dsl::Vector3;
use schemars::JsonSchema;
use serde::Deserialize;

use crate::bounded::{finite_triple, nonzero_triple, number, positive};
use crate::fabric::Fabric;
use crate::geometry::{Pose, cross, subtract};
use crate::mesh::{
    Disc, MeshError, ObjError, PleatsError, Sheet, SpringNetwork, Strip, Topology, TriangleMesh, read_obj,
};

/// A piece of cloth.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Garment {
    /// What pins and seams call it. Default `garment` and its number from 0.
    #[serde(default)]
    pub name: Option<String>,
    /// Its shape: the table `sheet`, `disc`, `strip` or `obj`.
    pub mesh: Mesh,
    /// What it is made of: a table, or the name of a measured fabric (see `cloth fabrics`).
    #[serde(deserialize_with = "super::fabric_choice::fabric")]
    #[schemars(with = "super::fabric_choice::FabricChoice")]
    pub fabric: Fabric,
    /// Where it is at the start. Default as built.
    #[serde(default)]
    pub placement: Placement,
    /// Its velocity at the start, in m/s. Default 0.
    #[serde(default, deserialize_with = "finite_triple")]
    pub velocity: [f64; 3],
    /// Its spin at the start about where its origin was placed, in rad/s. Default 0.
    #[serde(default, deserialize_with = "finite_triple")]
    pub spin: [f64; 3],
}

/// The cloth's shape at rest and at the start.
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
        /// Its path, from the scene file's folder.
        path: PathBuf,
    },
}

/// Scaled, which also scales the shape at rest, then turned, then shifted.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Placement {
    /// How many times as large. Default 1.
    #[serde(default = "one", deserialize_with = "positive")]
    pub scale: f64,
    /// A turn about an axis through the origin. Default none.
    #[serde(default)]
    pub rotate: Option<Turn>,
    /// A shift, in m. Default none.
    #[serde(default, deserialize_with = "finite_triple")]
    pub translate: [f64; 3],
}

/// A turn about an axis, right-handed.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Turn {
    /// The direction of the axis.
    #[serde(deserialize_with = "nonzero_triple")]
    pub axis: [f64; 3],
    /// How far, in degrees.
    #[serde(deserialize_with = "number")]
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
    /// The turn and the shift.
    #[must_use]
    pub fn pose(&self) -> Pose {
        let turned = self.rotate.map_or(Pose::REST, |turn| Pose::turned(turn.axis, turn.angle, [0.0; 3]));
        turned.shifted(self.translate)
    }
}

/// A mesh that cannot be had.
#[derive(Debug, thiserror::Error)]
pub enum MeshSourceError {
    /// The OBJ file.
    #[error(transparent)]
    Obj(#[from] ObjError),
    /// A built-in shape, or one that was scaled.
    #[error("mesh: {0}")]
    Built(#[from] MeshError),
    /// Its folds.
    #[error("mesh.sheet.pleats: {0}")]
    Pleats(#[from] PleatsError),
}

/// The shape of a cloth.
#[derive(Clone, Debug, PartialEq)]
pub struct Shape {
    /// At rest.
    pub mesh: TriangleMesh,
    /// The vertices at the start, in m.
    pub start: Vec<Vector3<f64>>,
    /// Their velocities, in m/s.
    pub velocities: Vec<Vector3<f64>>,
    /// The pairs of vertices that springs would join.
    pub springs: SpringNetwork,
}

impl Garment {
    /// Its shape. Relative paths start from `folder`.
    ///
    /// # Errors
    /// When the file cannot be read or the mesh is unfit.
    pub fn shape(&self, folder: &Path) -> Result<Shape, MeshSourceError> {
        let sheet = match &self.mesh {
            Mesh::Sheet(sheet) => Some(*sheet),
            Mesh::Strip(strip) => Some(strip.sheet()),
            Mesh::Disc(_) | Mesh::Obj { .. } => None,
        };
        let mesh = match &self.mesh {
            Mesh::Sheet(sheet) => sheet.mesh()?,
            Mesh::Strip(strip) => strip.sheet().mesh()?,
            Mesh::Disc(disc) => disc.mesh()?,
            Mesh::Obj { path } => read_obj(&folder.join(path))?,
        };
        let drawn = sheet.map_or_else(|| Ok(mesh.vertices().to_vec()), |sheet| sheet.start())?;
        let springs = match &sheet {
            Some(sheet) => SpringNetwork::of_sheet(sheet),
            None => SpringNetwork::of_mesh(&Topology::of(&mesh)),
        };
        let Placement { scale, translate, .. } = self.placement;
        let mesh = if scale == 1.0 { mesh } else { mesh.scaled(scale)? };
        let pose = self.placement.pose();
        let start: Vec<Vector3<f64>> = drawn.iter().map(|p| pose.applied(p.map(|c| scale * c))).collect();
        let velocity = |p: &Vector3<f64>| -> Vector3<f64> {
            let turning = cross(self.spin, subtract(*p, translate));
            std::array::from_fn(|axis| self.velocity[axis] + turning[axis])
        };
        Ok(Shape { mesh, velocities: start.iter().map(velocity).collect(), start, springs })
    }
}
