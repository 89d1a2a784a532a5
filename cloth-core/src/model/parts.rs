//! What a scene is made of, on one numbering of vertices.

use std::ops::Range;

use energy_dsl::Vector3;
use energy_solve::{ListError, Term};

use super::builder::Builder;
use super::{PinError, SeamError};
use crate::contact::Obstacle;
use crate::fabric::FabricError;
use crate::mesh::TriangleMesh;
use crate::motion::Motion;
use crate::scene::{MeshSourceError, ObstacleError, Scene};

/// A garment or hair of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Part {
    /// What pins and seams call it.
    pub name: String,
    /// Its vertices.
    pub vertices: Range<usize>,
    /// What it is.
    pub kind: PartKind,
}

/// What a part is.
#[derive(Clone, Debug, PartialEq)]
pub enum PartKind {
    /// Cloth, of this mesh.
    Cloth(TriangleMesh),
    /// Strands, each of that many vertices.
    Hair {
        /// Vertices of a strand.
        joints: usize,
    },
}

/// A pinned vertex that moves.
#[derive(Clone, Debug, PartialEq)]
pub struct MovingPin {
    /// The vertex.
    pub vertex: usize,
    /// Where it is drawn, in m; the motion starts from there.
    pub drawn: Vector3<f64>,
    /// Which of [`Model::motions`].
    pub motion: usize,
}

/// Vertices that nothing couples to others, with everything that acts on them.
#[derive(Debug, Default)]
pub struct IslandModel {
    /// Its vertices, by their numbers in the whole.
    pub vertices: Vec<usize>,
    /// Everything that acts, on vertices counted within the island.
    pub terms: Vec<Box<dyn Term>>,
    /// Which of [`Model::labels`] each term has.
    pub labels: Vec<usize>,
}

/// What a term is called, which may act on several islands.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TermLabel {
    /// Its name.
    pub name: String,
    /// The declared element it is made of.
    pub element: &'static str,
}

/// A scene ready to be simulated.
#[derive(Debug, Default)]
pub struct Model {
    /// Garments, then hair.
    pub parts: Vec<Part>,
    /// Positions at the start, in m.
    pub x: Vec<Vector3<f64>>,
    /// Velocities at the start, in m/s; zero for pinned vertices.
    pub v: Vec<Vector3<f64>>,
    /// Masses, in kg.
    pub masses: Vec<f64>,
    /// All triangles.
    pub triangles: Vec<[usize; 3]>,
    /// Whether each vertex is pinned.
    pub pinned: Vec<bool>,
    /// Pinned vertices that move.
    pub moving: Vec<MovingPin>,
    /// How they move.
    pub motions: Vec<Motion>,
    /// What moves on its own.
    pub islands: Vec<IslandModel>,
    /// What the terms of the islands are called.
    pub labels: Vec<TermLabel>,
    /// What was left out because its stiffness is zero, or there is nothing for it to act on.
    pub left_out: Vec<String>,
    /// What should be known about it.
    pub warnings: Vec<String>,
    /// Solids.
    pub obstacles: Vec<Obstacle>,
}

/// A name that no garment or hair has.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("there is no garment or hair called `{name}`; there are {}", .known.join(", "))]
pub struct UnknownPart {
    /// The name.
    pub name: String,
    /// Those that there are.
    pub known: Vec<String>,
}

/// A scene whose parts do not fit together.
#[derive(Debug, thiserror::Error)]
pub enum ModelError {
    /// A shape.
    #[error("{part}: {source}")]
    Mesh {
        /// The garment.
        part: String,
        /// What is wrong.
        source: MeshSourceError,
    },
    /// A fabric.
    #[error("{part}: {source}")]
    Fabric {
        /// The garment.
        part: String,
        /// What is wrong.
        source: FabricError,
    },
    /// Two parts of one name.
    #[error("two garments or hairs are called `{name}`")]
    SameName {
        /// The name.
        name: String,
    },
    /// A pin.
    #[error(transparent)]
    Pin(#[from] PinError),
    /// A seam.
    #[error(transparent)]
    Seam(#[from] SeamError),
    /// The mesh of an obstacle.
    #[error(transparent)]
    Obstacle(#[from] ObstacleError),
    /// Hair or stitches that do not fit.
    #[error(transparent)]
    List(#[from] ListError),
}

impl Model {
    /// Puts a scene together.
    ///
    /// # Errors
    /// When a part is unfit, or a name or vertex does not exist.
    pub fn new(scene: &Scene) -> Result<Self, ModelError> {
        Builder::new(scene).model()
    }

    /// The strands of hair, each as its vertices.
    pub fn strands(&self) -> impl Iterator<Item = Range<usize>> + '_ {
        self.parts.iter().flat_map(|part| {
            let joints = if let PartKind::Hair { joints } = part.kind { joints } else { usize::MAX };
            let starts = part.vertices.clone().step_by(joints).filter(move |_| joints < usize::MAX);
            starts.map(move |start| start..start + joints)
        })
    }
}
