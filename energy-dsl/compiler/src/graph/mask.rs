//! Constructors of masks and selections. Known outcomes are folded.

use super::{Graph, NodeId, Op};

impl Graph {
    /// Creates a < b.
    pub fn less(&mut self, a: NodeId, b: NodeId) -> NodeId {
        self.node(Op::Less(a, b))
    }

    /// Creates a < b, for results that are the same for both outcomes.
    pub fn precedes(&mut self, a: NodeId, b: NodeId) -> NodeId {
        self.node(Op::Precedes(a, b))
    }

    /// Creates a ≤ b.
    pub fn less_or_equal(&mut self, a: NodeId, b: NodeId) -> NodeId {
        self.node(Op::LessOrEqual(a, b))
    }

    /// Creates a = b.
    pub fn equal(&mut self, a: NodeId, b: NodeId) -> NodeId {
        self.node(Op::Equal(a.min(b), a.max(b)))
    }

    /// Creates a constant mask.
    pub fn truth(&mut self, value: bool) -> NodeId {
        self.node(Op::Truth(value))
    }

    /// Creates the mask of extraordinary configurations.
    pub fn cautious(&mut self) -> NodeId {
        self.node(Op::Cautious)
    }

    /// Creates the conjunction.
    pub fn and(&mut self, a: NodeId, b: NodeId) -> NodeId {
        match (self.op(a), self.op(b)) {
            (Op::Truth(true), _) | (_, Op::Truth(false)) => b,
            (_, Op::Truth(true)) | (Op::Truth(false), _) => a,
            _ if a == b => a,
            _ => self.node(Op::And(a.min(b), a.max(b))),
        }
    }

    /// Creates the disjunction.
    pub fn or(&mut self, a: NodeId, b: NodeId) -> NodeId {
        match (self.op(a), self.op(b)) {
            (Op::Truth(false), _) | (_, Op::Truth(true)) => b,
            (_, Op::Truth(false)) | (Op::Truth(true), _) => a,
            _ if a == b => a,
            _ => self.node(Op::Or(a.min(b), a.max(b))),
        }
    }

    /// Creates the negation.
    pub fn not(&mut self, a: NodeId) -> NodeId {
        match self.op(a) {
            Op::Not(b) => b,
            Op::Truth(value) => self.truth(!value),
            _ => self.node(Op::Not(a)),
        }
    }

    /// Creates a selection.
    pub fn select(&mut self, mask: NodeId, yes: NodeId, no: NodeId) -> NodeId {
        match self.op(mask) {
            Op::Truth(true) => yes,
            Op::Truth(false) => no,
            _ if yes == no => yes,
            _ => self.node(Op::Select(mask, yes, no)),
        }
    }
}
