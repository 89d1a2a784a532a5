use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::Deserialize;

use super::garment::{Placement, Turn};
use super::numbered_files::{NumberingError, check_numbers, numbered_files};
use cloth_physics::Coulomb;
use cloth_physics::bounded::{Direction, MaybeReal, NonNegative, Number, Positive, Real, Reals};
use cloth_physics::contact::{
    AnySolid, Ball, Capsule, Deformation, HalfSpace, MeshSolid, Obstacle, RoundedBox, Surface, SurfaceError,
};
use cloth_physics::geometry::{Pose, norm};
use cloth_physics::mesh::{MeshError, ObjError, TriangleMesh, read_obj};
use cloth_physics::motion::{Motion, Steering};

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
    /// Friction: a coefficient, or the table `static`, `kinetic`. Dry skin has about 0.3, damp skin 0.9. Integrators
    /// other than `newton` use the kinetic coefficient only. Default 0.
    #[serde(default)]
    friction: Coulomb,
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
    friction: Coulomb,
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
    /// outside. An open mesh is a shell. With `frames_per_second`, the name has one `*` for the numbers of the frames.
    path: PathBuf,
    /// The mesh deforms: `path` names one OBJ file per frame, with the same vertices and faces, in the order of their
    /// numbers, at this rate in 1/s. Vertices move on straight lines from frame to frame. Needs `newton`. Default: the
    /// mesh is rigid.
    #[serde(default, with = "MaybeReal::<Positive>")]
    frames_per_second: Option<f64>,
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
#[non_exhaustive]
pub enum ObstacleError {
    /// The OBJ file is invalid.
    #[error("{name}: {source}")]
    Obj { name: String, source: ObjError },
    /// The scaled mesh is invalid.
    #[error("{name}: {source}")]
    Scaled { name: String, source: MeshError },
    /// No file has the name of a frame.
    #[error(
        "{name}: no file matches {}; name the frames with one `*` for their numbers, such as body_*.obj",
        .pattern.display()
    )]
    NoFrames { name: String, pattern: PathBuf },
    /// The numbers of the frames have gaps or repeat.
    #[error("{name}: {source}")]
    Numbering { name: String, source: NumberingError },
    /// The name of a file has a `*`, but the rate of the frames is missing.
    #[error(
        "{name}: {} has a `*` for the numbers of frames, but `frames_per_second` is missing; give their rate in 1/s",
        .path.display()
    )]
    NoRate { name: String, path: PathBuf },
    /// A frame has other vertices or faces than the first one.
    #[error(
        "{name}: {} has other vertices or faces than {}; export the same mesh in every frame",
        .path.display(), .first.display()
    )]
    OtherMesh { name: String, path: PathBuf, first: PathBuf },
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
            ShapeKeys::Mesh(MeshKeys { frames_per_second: Some(_), .. }) if motion.is_some() => {
                return Err("a mesh with `frames_per_second` moves by itself; leave out `motion`".to_owned());
            }
            _ => {}
        }
        Ok(Self { shape, rest: Common { name, friction, sticking, thickness, stiffness, motion } })
    }
}

impl ObstacleDescription {
    /// Returns the paths of the mesh, one for each frame if it deforms; empty for other shapes. Relative paths refer to
    /// `folder`.
    #[must_use]
    pub fn mesh_paths(&self, folder: &Path) -> Vec<PathBuf> {
        match &self.shape {
            ShapeKeys::Mesh(keys) if keys.frames_per_second.is_some() => numbered_files(&folder.join(&keys.path)),
            ShapeKeys::Mesh(keys) => vec![folder.join(&keys.path)],
            _ => Vec::new(),
        }
    }

    /// Returns the name of the obstacle with index `number` in the scene.
    #[must_use]
    pub fn name(&self, number: usize) -> String {
        let shape = match &self.shape {
            ShapeKeys::Plane(_) => "plane",
            ShapeKeys::Sphere(_) => "sphere",
            ShapeKeys::Capsule(_) => "capsule",
            ShapeKeys::Block(_) => "box",
            ShapeKeys::Mesh(_) => "mesh",
        };
        self.rest.name.clone().unwrap_or_else(|| format!("{shape} {number}"))
    }

    /// Lets a program move the obstacle while the simulation runs, from its pose at the start.
    #[must_use]
    pub fn steered(&mut self) -> Steering {
        let mut motion = self.rest.motion.clone().unwrap_or_default();
        let steering = Steering::new(motion.pose(0.0));
        motion.steering = Some(steering.clone());
        self.rest.motion = Some(motion);
        steering
    }

    /// Whether the obstacle deforms.
    #[must_use]
    pub fn deforms(&self) -> bool {
        matches!(&self.shape, ShapeKeys::Mesh(MeshKeys { frames_per_second: Some(_), .. }))
    }

    /// Builds the obstacle with index `number` in the scene. Relative paths refer to `folder`.
    ///
    /// # Errors
    /// Returns an error if the file of a mesh cannot be read or does not bound a solid.
    pub fn obstacle(&self, number: usize, folder: &Path) -> Result<Obstacle, ObstacleError> {
        let named = |shape: &str| self.rest.name.clone().unwrap_or_else(|| format!("{shape} {number}"));
        let mut deformation = None;
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
            ShapeKeys::Mesh(keys) => {
                let (solid, own) = keys.solid(&named("mesh"), &self.mesh_paths(folder), folder)?;
                deformation = own;
                ("mesh", AnySolid::Mesh(solid))
            }
        };
        let Common { friction, sticking, thickness, stiffness, motion, .. } = self.rest.clone();
        Ok(Obstacle { name: named(shape), solid, motion, deformation, thickness, stiffness, friction, sticking })
    }
}

impl MeshKeys {
    /// Reads the mesh at the start, and its deformation if there are frames.
    fn solid(
        &self,
        name: &str,
        paths: &[PathBuf],
        folder: &Path,
    ) -> Result<(MeshSolid, Option<Deformation>), ObstacleError> {
        let pattern = folder.join(&self.path);
        let Some((first, others)) = paths.split_first() else {
            return Err(ObstacleError::NoFrames { name: name.to_owned(), pattern });
        };
        if self.frames_per_second.is_some() {
            check_numbers(&pattern).map_err(|source| ObstacleError::Numbering { name: name.to_owned(), source })?;
        } else if pattern.to_string_lossy().contains('*') && !pattern.exists() {
            return Err(ObstacleError::NoRate { name: name.to_owned(), path: pattern });
        }
        let mesh = self.placed(name, first)?;
        let mut frames = vec![mesh.vertices().to_vec()];
        for path in others {
            let frame = self.placed(name, path)?;
            if frame.triangles() != mesh.triangles() || frame.vertices().len() != mesh.vertices().len() {
                let (name, path, first) = (name.to_owned(), path.clone(), first.clone());
                return Err(ObstacleError::OtherMesh { name, path, first });
            }
            frames.push(frame.vertices().to_vec());
        }
        let deformation = self.frames_per_second.map(|rate| Deformation::new(frames, rate));
        let invalid = |source| ObstacleError::Surface { name: name.to_owned(), path: first.clone(), source };
        let surface = Surface::new(mesh, self.rounding).map_err(invalid)?;
        Ok((MeshSolid::new(surface), deformation))
    }

    /// Reads a mesh and places it.
    fn placed(&self, name: &str, path: &Path) -> Result<TriangleMesh, ObstacleError> {
        let mesh = read_obj(path).map_err(|source| ObstacleError::Obj { name: name.to_owned(), source })?;
        let placed = mesh.scaled(self.placement.scale).map(|mesh| mesh.moved(&self.placement.pose()));
        placed.map_err(|source| ObstacleError::Scaled { name: name.to_owned(), source })
    }
}
