//! The parts of a scene and the assembled model.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use energy_dsl::Vector3;
use energy_solve::{ListError, Term};

use super::builder::Builder;
use super::inflation::NotClosed;
use super::{ExclusionError, PinError, SeamError};
use crate::Coulomb;
use crate::collision::Exclusions;
use crate::contact::Obstacle;
use crate::fabric::{FabricError, Locking};
use crate::mesh::{CornerAttributes, TriangleMesh};
use crate::motion::Motion;
use crate::scene::{MeshSourceError, ObstacleError, Scene};

/// A garment or hair of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Part {
    /// The name that pins and seams refer to.
    pub name: String,
    /// Its vertices in the model.
    pub vertices: Range<usize>,
    /// Cloth or hair.
    pub kind: PartKind,
    /// RGB colour, from 0 to 1, as screens show it; `None` for that of its kind.
    pub colour: Option<[f32; 3]>,
    /// Attributes of the corners of its triangles, from an OBJ file.
    pub corners: CornerAttributes,
    /// The vertices of each group of its OBJ file, numbered within the part.
    pub groups: BTreeMap<String, Vec<usize>>,
}

/// The kind of a part.
#[derive(Clone, Debug, PartialEq)]
pub enum PartKind {
    /// Cloth, with its rest mesh.
    Cloth(TriangleMesh),
    /// Strands of hair.
    Hair {
        /// Vertices of each strand.
        joints: usize,
        /// Length of a segment at rest, in m.
        segment: f64,
        /// Diameter of a strand, in m.
        width: f64,
    },
}

/// A pinned vertex that moves.
#[derive(Clone, Debug, PartialEq)]
pub struct MovingPin {
    /// The index of the vertex.
    pub vertex: usize,
    /// Initial position before the motion, in m.
    pub initial: Vector3<f64>,
    /// An index into [`Model::motions`].
    pub motion: usize,
}

/// The vertices of an entry of `[[pins]]`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct PinnedVertices {
    /// The name, which pins of a group share; `None` without one.
    pub name: Option<String>,
    /// All vertices that the pin chose, ascending.
    pub chosen: Vec<usize>,
    /// Vertices that it holds exactly now, ascending. A vertex of several pins belongs to the first one that
    /// holds it.
    pub held: Vec<usize>,
    /// Labels of its springs; empty if it holds exactly.
    pub springs: Vec<usize>,
}

impl PinnedVertices {
    pub(super) fn of(name: Option<String>, chosen: &[usize]) -> Self {
        let chosen: Vec<usize> = BTreeSet::from_iter(chosen.iter().copied()).into_iter().collect();
        Self { name, chosen, ..Self::default() }
    }
}

/// A set of vertices that no force couples to the others, with the forces on them.
#[derive(Debug, Default)]
pub struct IslandModel {
    /// Indices of the vertices in the model.
    pub vertices: Vec<usize>,
    /// The terms, with vertices numbered within the island.
    pub terms: Vec<Box<dyn Term>>,
    /// For each term, an index into [`Model::labels`].
    pub labels: Vec<usize>,
}

/// The label of a term. Terms of several islands that belong to one garment, obstacle or seam share a label.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TermLabel {
    /// The term's name.
    pub name: String,
    /// The name of its declared element.
    pub element: String,
}

/// A scene ready to be simulated.
#[derive(Debug, Default)]
pub struct Model {
    /// Garments, then hair.
    pub parts: Vec<Part>,
    /// Initial positions, in m.
    pub x: Vec<Vector3<f64>>,
    /// Initial velocities, in m/s; zero for pinned vertices.
    pub v: Vec<Vector3<f64>>,
    /// Masses, in kg.
    pub masses: Vec<f64>,
    /// The triangles of all garments.
    pub triangles: Vec<[usize; 3]>,
    /// Whether each vertex is pinned.
    pub pinned: Vec<bool>,
    /// Whether each vertex is pinned at the start; some may have been released since.
    pub pinned_at_start: Vec<bool>,
    /// Whether each vertex is pinned and never released.
    pub pinned_forever: Vec<bool>,
    /// The vertices of each entry of `[[pins]]`.
    pub pins: Vec<PinnedVertices>,
    /// Pinned vertices that move.
    pub moving: Vec<MovingPin>,
    /// The motions of pins.
    pub motions: Vec<Motion>,
    /// The islands, with their terms.
    pub islands: Vec<IslandModel>,
    /// The labels of all terms.
    pub labels: Vec<TermLabel>,
    /// Terms that were left out, because their stiffness is zero or they have no elements.
    pub left_out: Vec<String>,
    /// Pairs of vertices that seams join.
    pub sewn: Vec<[usize; 2]>,
    /// Thickness in contact at each vertex, in m.
    pub thickness: Vec<f64>,
    /// Friction with cloth at each vertex.
    pub friction: Vec<Coulomb>,
    /// Friction of pairs of parts: their numbers, obstacles after cloth and hair, and the coefficients.
    pub pair_friction: Vec<([u32; 2], Coulomb)>,
    /// Descriptions of the garments from files: their pieces and welded vertices.
    pub notes: Vec<String>,
    /// Warnings about the scene.
    pub warnings: Vec<String>,
    /// Estimates of locking, with the names of the garments.
    pub locking: Vec<(String, Locking)>,
    /// Obstacles, with their motions.
    pub obstacles: Vec<Obstacle>,
    /// Pairs of features that do not collide.
    pub(crate) exclusions: Exclusions,
}

/// A reference to a garment or hair that does not exist.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("there is no garment or hair called `{name}`; there are {}", .known.join(", "))]
#[expect(missing_docs, reason = "the messages name the fields")]
#[non_exhaustive]
pub struct UnknownPart {
    pub name: String,
    /// The existing names.
    pub known: Vec<String>,
}

/// Friction of a pair with a part that does not exist, or twice of the same pair.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
#[non_exhaustive]
pub enum PairFrictionError {
    /// A name that no part has.
    #[error("friction[{pair}]: nothing is called `{name}`; there are {}", .known.join(", "))]
    Name {
        /// Index of the pair, from 0.
        pair: usize,
        name: String,
        /// The existing names.
        known: Vec<String>,
    },
    /// A pair that another table has.
    #[error("friction[{pair}]: friction[{before}] is of the same two parts; leave one out")]
    Twice {
        /// Indices of the pairs, from 0.
        pair: usize,
        before: usize,
    },
}

/// A scene whose parts do not fit together.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
#[non_exhaustive]
pub enum ModelError {
    /// The mesh of a garment is invalid.
    #[error("{part}: {source}")]
    Mesh { part: String, source: MeshSourceError },
    /// A fabric does not fit its mesh.
    #[error("{part}: {source}")]
    Fabric { part: String, source: FabricError },
    /// A garment under pressure is not closed.
    #[error("{part}: inflation: {source}")]
    Inflation { part: String, source: NotClosed },
    /// Two parts, or two obstacles, have the same name.
    #[error("two {kind} are called `{name}`; give one of them another `name`")]
    SameName {
        /// `garments or hairs`, or `obstacles`.
        kind: &'static str,
        name: String,
    },
    /// A pin is invalid.
    #[error(transparent)]
    Pin(#[from] PinError),
    /// A seam is invalid.
    #[error(transparent)]
    Seam(#[from] SeamError),
    /// The friction of a pair is invalid.
    #[error(transparent)]
    PairFriction(#[from] PairFrictionError),
    /// An exclusion is invalid.
    #[error(transparent)]
    Exclusion(#[from] ExclusionError),
    /// The mesh of an obstacle is invalid.
    #[error(transparent)]
    Obstacle(#[from] ObstacleError),
    /// Elements and stencils of hair or stitches do not match.
    #[error(transparent)]
    List(#[from] ListError),
}

impl Model {
    /// Assembles a scene.
    ///
    /// # Errors
    /// Returns an error if a part is invalid, or a name or vertex does not exist.
    pub fn new(scene: &Scene) -> Result<Self, ModelError> {
        Self::at(scene, 0.0)
    }

    /// Assembles a scene as it starts, but without the pins that are released by a time, in s.
    ///
    /// # Errors
    /// Returns an error if a part is invalid, or a name or vertex does not exist.
    pub fn at(scene: &Scene, time: f64) -> Result<Self, ModelError> {
        Builder::new(scene, time).model()
    }

    /// Adds a term to an island. Terms with the same name and element share a label.
    pub(crate) fn add_term(&mut self, island: usize, term: Box<dyn Term>) {
        let label = TermLabel { name: term.name().to_owned(), element: term.declaration().name.to_string() };
        let known = self.labels.iter().position(|known| *known == label);
        let number = known.unwrap_or(self.labels.len());
        if known.is_none() {
            self.labels.push(label);
        }
        self.islands[island].labels.push(number);
        self.islands[island].terms.push(term);
    }

    /// Returns the vertex range of each strand of hair.
    pub fn strands(&self) -> impl Iterator<Item = Range<usize>> + '_ {
        self.parts.iter().flat_map(|part| {
            let joints = if let PartKind::Hair { joints, .. } = part.kind { joints } else { usize::MAX };
            let starts = part.vertices.clone().step_by(joints).filter(move |_| joints < usize::MAX);
            starts.map(move |start| start..start + joints)
        })
    }
}
