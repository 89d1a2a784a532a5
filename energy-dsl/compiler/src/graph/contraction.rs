//! Weighted sums of the derivatives of several primitives.

use super::{Graph, NodeId};

/// The factors of a contraction and the weights of its values; the derivatives of their sum.
pub(crate) type Contracted<T> = fn(&mut Graph, &[NodeId], &[NodeId]) -> Vec<T>;

/// Primitives of the same arguments, such as the entries of R(F), and Σ wᵢ ∇²vᵢ in fewer operations than each ∇²vᵢ
/// takes.
#[derive(Clone, Debug)]
pub(crate) struct Contraction {
    /// vᵢ, as rules.
    pub(crate) values: Vec<NodeId>,
    /// The arguments that they share.
    pub(crate) arguments: Vec<NodeId>,
    /// Numbers that `second` reads.
    pub(crate) factors: Vec<NodeId>,
    /// Returns Σ wᵢ ∇vᵢ; `None` if that takes no fewer operations than each ∇vᵢ.
    pub(crate) first: Option<Contracted<NodeId>>,
    /// Returns the upper triangle of Σ wᵢ ∇²vᵢ, row by row. Each entry is a sum; the entry with exchanged arguments has
    /// the same numbers in reverse order.
    pub(crate) second: Contracted<Vec<NodeId>>,
}

impl Contraction {
    /// Returns the weights of the values, 0 where there is none.
    pub(crate) fn weights(&self, g: &mut Graph, of: impl Fn(NodeId) -> Option<NodeId>) -> Vec<NodeId> {
        let zero = g.constant(0.0);
        self.values.iter().map(|&value| of(value).unwrap_or(zero)).collect()
    }
}

impl Graph {
    /// Records a contraction, unless it is known.
    pub(crate) fn note_contraction(&mut self, contraction: Contraction) {
        if !self.contractions.iter().any(|known| known.values == contraction.values) {
            self.contractions.push(contraction);
        }
    }

    /// Returns the contractions of which several primitives are among these nodes.
    pub(crate) fn contractions_of(&self, is_used: impl Fn(NodeId) -> bool) -> Vec<Contraction> {
        let is_rule = |&value: &NodeId| self.rule(value).is_some_and(|rule| !self.is_spelled_out(rule));
        let used = |of: &&Contraction| of.values.iter().filter(|&value| is_used(*value) && is_rule(value)).count() > 1;
        self.contractions.iter().filter(used).cloned().collect()
    }
}
