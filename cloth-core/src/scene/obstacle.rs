use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::Deserialize;

use super::garment::{Placement, Turn};
use crate::bounded::{all_positive, finite_triple, non_negative, nonzero_triple, positive};
use crate::contact::{AnySolid, Ball, Capsule, HalfSpace, MeshSolid, Obstacle, RoundedBox, Surface, SurfaceError};
use crate::geometry::{Pose, norm};
use crate::mesh::{MeshError, ObjError, read_obj};
use crate::motion::Motion;

/// A solid that keeps cloth out: exactly one of `plane`, `sphere`, `capsule`, `box` and `mesh`.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(try_from = "Keys")]
#[schemars(with = "Keys")]
pub struct ObstacleDescription {
    shape: ShapeKeys,
    rest: Common,
}

/// What a scene file says.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Keys {
    /// Everything below a plane.
    plane: Option<PlaneKeys>,
    /// A ball.
    sphere: Option<SphereKeys>,
    /// All points within a radius of a segment.
    capsule: Option<CapsuleKeys>,
    /// A box.
    #[serde(rename = "box")]
    block: Option<BoxKeys>,
    /// A surface of triangles.
    mesh: Option<MeshKeys>,
    /// What the ledger calls it. Default the shape's name and its number from 0.
    name: Option<String>,
    /// The coefficient of friction. Default 0.
    #[serde(default, deserialize_with = "non_negative")]
    friction: f64,
    /// The sliding velocity at which friction is 1/√2 of its full size, in m/s: below it cloth sticks, though it creeps. Default 0.001.
    #[serde(default = "sticking", deserialize_with = "positive")]
    sticking: f64,
    /// Cloth is pushed away within this distance, in m. Default 0.005.
    #[serde(default = "thickness", deserialize_with = "positive")]
    thickness: f64,
    /// How hard: at the surface with this times the thickness as acceleration; in 1/s². Default 5e6.
    #[serde(default = "stiffness", deserialize_with = "positive")]
    stiffness: f64,
    /// How it moves. Default not at all.
    motion: Option<Motion>,
}

#[derive(Clone, Debug, PartialEq)]
struct Common {
    name: Option<String>,
    friction: f64,
    sticking: f64,
    thickness: f64,
    stiffness: f64,
    motion: Option<Motion>,
}

#[derive(Clone, Debug, PartialEq)]
enum ShapeKeys {
    Plane(PlaneKeys),
    Sphere(SphereKeys),
    Capsule(CapsuleKeys),
    Block(BoxKeys),
    Mesh(MeshKeys),
}

#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct PlaneKeys {
    /// A point of it, in m. Default the origin.
    #[serde(default, deserialize_with = "finite_triple")]
    point: [f64; 3],
    /// Where cloth may be. Default [0, 0, 1].
    #[serde(default = "up", deserialize_with = "nonzero_triple")]
    normal: [f64; 3],
}

#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct SphereKeys {
    /// The centre, in m. Default the origin.
    #[serde(default, deserialize_with = "finite_triple")]
    centre: [f64; 3],
    /// The radius, in m.
    #[serde(deserialize_with = "positive")]
    radius: f64,
}

#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct CapsuleKeys {
    /// One end of the segment, in m.
    #[serde(deserialize_with = "finite_triple")]
    from: [f64; 3],
    /// Its other end, in m.
    #[serde(deserialize_with = "finite_triple")]
    to: [f64; 3],
    /// The radius, in m.
    #[serde(deserialize_with = "positive")]
    radius: f64,
}

#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct BoxKeys {
    /// The centre, in m. Default the origin.
    #[serde(default, deserialize_with = "finite_triple")]
    centre: [f64; 3],
    /// Its edges, in m.
    #[serde(deserialize_with = "all_positive")]
    size: [f64; 3],
    /// A turn about its centre. Default none.
    #[serde(default)]
    rotate: Option<Turn>,
    /// The radius of its rounded edges, within its size, in m. Default 0.
    #[serde(default, deserialize_with = "non_negative")]
    rounding: f64,
}

#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct MeshKeys {
    /// An OBJ file, with lengths in m, from the scene file's folder. Corners run anticlockwise seen from outside; a surface with a rim is a shell.
    path: PathBuf,
    /// Where it is at the start. Default as in the file.
    #[serde(default)]
    placement: Placement,
    /// All points within this distance of the surface are of the solid, too, in m; needed where the surface has a rim. Default 0.
    #[serde(default, deserialize_with = "non_negative")]
    rounding: f64,
}

/// A mesh that is no obstacle.
#[derive(Debug, thiserror::Error)]
pub enum ObstacleError {
    /// The OBJ file.
    #[error("{name}: {source}")]
    Obj {
        /// The obstacle.
        name: String,
        /// What is wrong.
        source: ObjError,
    },
    /// Its size.
    #[error("{name}: {source}")]
    Scaled {
        /// The obstacle.
        name: String,
        /// What is wrong.
        source: MeshError,
    },
    /// How its triangles are turned.
    #[error("{name}: {}: {source}", .path.display())]
    Surface {
        /// The obstacle.
        name: String,
        /// The file.
        path: PathBuf,
        /// What is wrong.
        source: SurfaceError,
    },
}

fn up() -> [f64; 3] {
    [0.0, 0.0, 1.0]
}

fn sticking() -> f64 {
    1e-3
}

fn thickness() -> f64 {
    5e-3
}

fn stiffness() -> f64 {
    5e6
}

impl TryFrom<Keys> for ObstacleDescription {
    type Error = String;

    fn try_from(keys: Keys) -> Result<Self, String> {
        let Keys { plane, sphere, capsule, block, mesh, name, friction, sticking, thickness, stiffness, motion } = keys;
        let shapes = [
            plane.map(ShapeKeys::Plane),
            sphere.map(ShapeKeys::Sphere),
            capsule.map(ShapeKeys::Capsule),
            block.map(ShapeKeys::Block),
            mesh.map(ShapeKeys::Mesh),
        ];
        let mut given = shapes.into_iter().flatten();
        let (Some(shape), None) = (given.next(), given.next()) else {
            return Err("an obstacle is exactly one of `plane`, `sphere`, `capsule`, `box` and `mesh`".to_owned());
        };
        match &shape {
            ShapeKeys::Capsule(CapsuleKeys { from, to, .. }) if from == to => {
                return Err("the ends of a capsule must differ; for a ball say `sphere`".to_owned());
            }
            ShapeKeys::Block(BoxKeys { size, rounding, .. }) if size.iter().any(|edge| 0.5 * edge <= *rounding) => {
                return Err(format!("a box of {size:?} m cannot be rounded by {rounding} m: that is half an edge"));
            }
            _ => {}
        }
        Ok(Self { shape, rest: Common { name, friction, sticking, thickness, stiffness, motion } })
    }
}

impl ObstacleDescription {
    /// The obstacle, of this number among those of the scene. Relative paths start from `folder`.
    ///
    /// # Errors
    /// When the file of a mesh cannot be read or is no surface of a solid.
    pub fn obstacle(&self, number: usize, folder: &Path) -> Result<Obstacle, ObstacleError> {
        let named = |shape: &str| self.rest.name.clone().unwrap_or_else(|| format!("{shape} {number}"));
        let (shape, solid) = match self.shape.clone() {
            ShapeKeys::Plane(PlaneKeys { point, normal }) => {
                let normal = normal.map(|component| component / norm(normal));
                ("plane", AnySolid::HalfSpace(HalfSpace { point, normal }))
            }
            ShapeKeys::Sphere(SphereKeys { centre, radius }) => ("sphere", AnySolid::Ball(Ball { centre, radius })),
            ShapeKeys::Capsule(CapsuleKeys { from, to, radius }) => {
                ("capsule", AnySolid::Capsule(Capsule { ends: [from, to], radius }))
            }
            ShapeKeys::Block(BoxKeys { centre, size, rotate, rounding }) => {
                let turn = rotate.map_or(Pose::REST, |turn| Pose::turned(turn.axis, turn.angle, [0.0; 3]));
                let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|axis| turn.applied(axis));
                let half = size.map(|edge| 0.5 * edge - rounding);
                ("box", AnySolid::Box(RoundedBox { centre, axes, half, radius: rounding }))
            }
            ShapeKeys::Mesh(keys) => ("mesh", AnySolid::Mesh(keys.solid(&named("mesh"), folder)?)),
        };
        let Common { friction, sticking, thickness, stiffness, motion, .. } = self.rest.clone();
        Ok(Obstacle { name: named(shape), solid, motion, thickness, stiffness, friction, sticking })
    }
}

impl MeshKeys {
    fn solid(&self, name: &str, folder: &Path) -> Result<MeshSolid, ObstacleError> {
        let (name, path) = (name.to_owned(), folder.join(&self.path));
        let mesh = match read_obj(&path) {
            Ok(mesh) => mesh,
            Err(source) => return Err(ObstacleError::Obj { name, source }),
        };
        let placed = mesh.scaled(self.placement.scale).map(|mesh| mesh.moved(&self.placement.pose()));
        let placed = match placed {
            Ok(placed) => placed,
            Err(source) => return Err(ObstacleError::Scaled { name, source }),
        };
        let surface = Surface::new(placed, self.rounding);
        surface.map(MeshSolid::new).map_err(|source| ObstacleError::Surface { name, path, source })
    }
}
