use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::Deserialize;

use super::garment::{Placement, Turn};
use crate::bounded::{Direction, NonNegative, Number, Positive, Real, Reals};
use crate::contact::{AnySolid, Ball, Capsule, HalfSpace, MeshSolid, Obstacle, RoundedBox, Surface, SurfaceError};
use crate::geometry::{Pose, norm};
use crate::mesh::{MeshError, ObjError, read_obj};
use crate::motion::Motion;

/// An obstacle: exactly one of `plane`, `sphere`, `capsule`, `box` and `mesh`.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(try_from = "Keys")]
#[schemars(with = "Keys")]
pub struct ObstacleDescription {
    shape: ShapeKeys,
    rest: Common,
}

/// The keys of an obstacle in a scene file.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("oneOf" = [
    { "required": ["plane"] },
    { "required": ["sphere"] },
    { "required": ["capsule"] },
    { "required": ["box"] },
    { "required": ["mesh"] },
]))]
struct Keys {
    /// Everything below a plane.
    plane: Option<PlaneKeys>,
    /// All points within a radius of a centre.
    sphere: Option<SphereKeys>,
    /// All points within a radius of a segment.
    capsule: Option<CapsuleKeys>,
    /// A box with edges along any directions.
    #[serde(rename = "box")]
    block: Option<BoxKeys>,
    /// A solid bounded by a triangle mesh.
    mesh: Option<MeshKeys>,
    /// Name in the ledger and in messages. Default the shape's name and the obstacle's index from 0.
    name: Option<String>,
    /// Coefficient of friction. Default 0.
    #[serde(default, with = "Real::<NonNegative>")]
    friction: f64,
    /// Sliding velocity at which friction reaches 1/√2 of its full size, in m/s. Slower cloth sticks, but creeps. No
    /// meaning with `newton`, whose friction does not creep. Default 0.001.
    #[serde(default = "sticking", with = "Real::<Positive>")]
    sticking: f64,
    /// Contact acts within this distance of the surface, in m. With `newton`, nothing comes nearer than a third of it.
    /// Default 0.005.
    #[serde(default = "thickness", with = "Real::<Positive>")]
    thickness: f64,
    /// Contact stiffness per mass, in 1/s²: at the surface, the acceleration is this times the thickness. No meaning
    /// with `newton`. Default 5e6.
    #[serde(default = "stiffness", with = "Real::<Positive>")]
    stiffness: f64,
    /// Motion over time. Default none.
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
    /// A point on the plane, in m. Default the origin.
    #[serde(default, with = "Reals::<Number, 3>")]
    point: [f64; 3],
    /// Normal, pointing to the side of the cloth. Default [0, 0, 1].
    #[serde(default = "up", with = "Direction")]
    normal: [f64; 3],
}

#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct SphereKeys {
    /// The centre, in m. Default the origin.
    #[serde(default, with = "Reals::<Number, 3>")]
    centre: [f64; 3],
    /// The radius, in m.
    #[serde(with = "Real::<Positive>")]
    radius: f64,
}

#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct CapsuleKeys {
    /// One end of the segment, in m.
    #[serde(with = "Reals::<Number, 3>")]
    from: [f64; 3],
    /// Its other end, in m.
    #[serde(with = "Reals::<Number, 3>")]
    to: [f64; 3],
    /// The radius, in m.
    #[serde(with = "Real::<Positive>")]
    radius: f64,
}

#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct BoxKeys {
    /// The centre, in m. Default the origin.
    #[serde(default, with = "Reals::<Number, 3>")]
    centre: [f64; 3],
    /// Edge lengths, in m.
    #[serde(with = "Reals::<Positive, 3>")]
    size: [f64; 3],
    /// Rotation about the centre. Default none.
    #[serde(default)]
    rotate: Option<Turn>,
    /// Radius of the rounded edges, which stay within the size, in m. Default 0.
    #[serde(default, with = "Real::<NonNegative>")]
    rounding: f64,
}

#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct MeshKeys {
    /// An OBJ file, with lengths in m, relative to the scene file's folder. Corners run anticlockwise seen from
    /// outside. An open mesh is a shell.
    path: PathBuf,
    /// Initial placement. Default as in the file.
    #[serde(default)]
    placement: Placement,
    /// Extends the solid by this distance from the surface, in m. Required for an open mesh. Default 0.
    #[serde(default, with = "Real::<NonNegative>")]
    rounding: f64,
}

/// A mesh that cannot be an obstacle.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
pub enum ObstacleError {
    /// The OBJ file is invalid.
    #[error("{name}: {source}")]
    Obj { name: String, source: ObjError },
    /// The scaled mesh is invalid.
    #[error("{name}: {source}")]
    Scaled { name: String, source: MeshError },
    /// The mesh does not bound a solid.
    #[error("{name}: {}: {source}", .path.display())]
    Surface { name: String, path: PathBuf, source: SurfaceError },
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
            return Err("expected exactly one of `plane`, `sphere`, `capsule`, `box` and `mesh`".to_owned());
        };
        match &shape {
            ShapeKeys::Capsule(CapsuleKeys { from, to, .. }) if from == to => {
                return Err("the ends of a capsule must differ; use `sphere` for a ball".to_owned());
            }
            ShapeKeys::Block(BoxKeys { size, rounding, .. }) if size.iter().any(|edge| 0.5 * edge <= *rounding) => {
                return Err(format!(
                    "a box of {size:?} m cannot be rounded by {rounding} m, which is at least half an edge"
                ));
            }
            _ => {}
        }
        Ok(Self { shape, rest: Common { name, friction, sticking, thickness, stiffness, motion } })
    }
}

impl ObstacleDescription {
    /// The path of the mesh, relative to the scene file's folder; `None` for other shapes.
    #[must_use]
    pub fn mesh_path(&self) -> Option<&Path> {
        if let ShapeKeys::Mesh(keys) = &self.shape { Some(&keys.path) } else { None }
    }

    /// Builds the obstacle with index `number` in the scene. Relative paths refer to `folder`.
    ///
    /// # Errors
    /// Returns an error if the file of a mesh cannot be read or does not bound a solid.
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
                let turn = rotate.map_or(Pose::IDENTITY, |turn| Pose::rotation(turn.axis, turn.angle, [0.0; 3]));
                let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|axis| turn.transform(axis));
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
