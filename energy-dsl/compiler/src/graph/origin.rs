//! What vectors and quaternions were made of, for functions that recognise their arguments.

use super::{Form, Graph, NodeId};

/// How the components of a vector, a quaternion or a dual quaternion were made.
#[derive(Clone, Debug)]
pub(crate) enum Origin {
    /// The cross product of two vectors.
    Cross([Vec<NodeId>; 2]),
    /// A vector turned by a quaternion.
    Rotated { quaternion: Vec<NodeId>, vector: Vec<NodeId> },
    /// A vector moved by a dual quaternion, given by its real part and twice its dual one.
    Transformed { quaternion: Vec<NodeId>, dual: Vec<NodeId>, vector: Vec<NodeId> },
    /// So that a quaternion has length 1, or is 0 where that is flagged.
    UnitQuaternion,
    /// The exponential of a twist (θ, t), with cos ‖θ‖ and sin ‖θ‖/‖θ‖.
    Exponential { cosine: NodeId, sinc: NodeId, turn: Vec<NodeId>, shift: Vec<NodeId> },
}

impl Graph {
    /// Notes how `components` were made; a textbook does not go on to use it.
    pub(crate) fn note_origin(&mut self, components: &[NodeId], origin: Origin) {
        if self.form() == Form::Robust {
            self.origins.insert(components.to_vec(), origin);
        }
    }

    /// How `components` were made, where it was noted.
    pub(crate) fn origin(&self, components: &[NodeId]) -> Option<&Origin> {
        self.origins.get(components)
    }
}
