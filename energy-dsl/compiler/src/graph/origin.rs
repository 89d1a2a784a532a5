//! Records how vectors, quaternions and matrices were made, so that functions can recognise their arguments.

use super::{Form, Graph, NodeId};

/// The construction of a vector, a quaternion, a dual quaternion or a matrix.
#[derive(Clone, Debug)]
pub(crate) enum Origin {
    /// The cross product of two vectors.
    Cross([Vec<NodeId>; 2]),
    /// A vector rotated by a quaternion.
    Rotated { quaternion: Vec<NodeId>, vector: Vec<NodeId> },
    /// A vector transformed by a dual quaternion, given by its real part and twice its dual part.
    Transformed { quaternion: Vec<NodeId>, dual: Vec<NodeId>, vector: Vec<NodeId> },
    /// The inverse of a motion.
    Inverse { motion: Vec<NodeId> },
    /// A quaternion of length 1, or 0 where that is flagged.
    UnitQuaternion,
    /// The rotation vector of a unit quaternion (w, v), by |w|, A(|w|) = acos |w| / √(1 − w²) and v.
    RotationVector { cosine: NodeId, ratio: NodeId, vector: Vec<NodeId> },
    /// The symmetric factor S of F = R S, with its trace and det S = det F.
    Stretch { trace: NodeId, matrix: Vec<NodeId> },
    /// The rotation R of F = R S, with the trace of S.
    Rotation { trace: NodeId, matrix: Vec<NodeId> },
    /// F − R of F = R S.
    Unrotated { matrix: Vec<NodeId> },
    /// S − I of F = R S, with the trace of S.
    Strain { trace: NodeId, matrix: Vec<NodeId> },
    /// The product of a square matrix that moves and one that does not.
    Deformed { moving: Vec<NodeId>, constant: Vec<NodeId> },
    /// FᵀF of a matrix F with these columns.
    Gram { columns: Vec<Vec<NodeId>> },
    /// The exponential of a twist (θ, t), with cos ‖θ‖ and sin ‖θ‖/‖θ‖.
    Exponential { cosine: NodeId, sinc: NodeId, turn: Vec<NodeId>, shift: Vec<NodeId> },
}

impl Graph {
    /// Records how `components` were made. The textbook form ignores it.
    pub(crate) fn note_origin(&mut self, components: &[NodeId], origin: Origin) {
        if self.form() == Form::Robust {
            self.origins.insert(components.to_vec(), origin);
        }
    }

    /// Returns how `components` were made, if known.
    pub(crate) fn origin(&self, components: &[NodeId]) -> Option<&Origin> {
        self.origins.get(components)
    }

    /// Records that a node is the determinant of a square matrix.
    pub(crate) fn note_determinant(&mut self, determinant: NodeId) {
        if !self.determinants.contains(&determinant) {
            self.determinants.push(determinant);
        }
    }

    /// Returns all determinants.
    pub(crate) fn determinants(&self) -> &[NodeId] {
        &self.determinants
    }
}
