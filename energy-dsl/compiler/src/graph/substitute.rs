//! Copies of expressions with some of their nodes replaced.

use super::ordinary::{Assumption, Path};
use super::{Graph, NodeId};

/// Copies of expressions with some nodes replaced. A rule becomes the expression of its value.
pub(crate) struct Substitution(Path);

impl Substitution {
    /// Replaces nodes by others.
    pub(crate) fn new(g: &Graph, replaced: impl IntoIterator<Item = (NodeId, NodeId)>) -> Self {
        Self(Path::replacing(replaced.into_iter().map(|(node, by)| (g.resolve(node), by)).collect()))
    }

    /// Returns the copy of a node. What was assumed of a node is assumed of its copy.
    pub(crate) fn of(&mut self, g: &mut Graph, node: NodeId) -> NodeId {
        let copy = self.0.rebuild(g, node);
        let mut next = 0;
        while let Some(&Assumption { node, instead, guard }) = g.assumptions().get(next) {
            if let Some(copy) = self.0.known(g.resolve(node)).filter(|&copy| copy != node) {
                let (instead, guard) = (self.0.rebuild(g, instead), self.0.rebuild(g, guard));
                g.assume(copy, instead, guard);
            }
            next += 1;
        }
        copy
    }
}
