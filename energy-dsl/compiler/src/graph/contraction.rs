//! Weighted sums of the second derivatives of several primitives.

use super::{Graph, NodeId};

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
    /// Returns the upper triangle of Σ wᵢ ∇²vᵢ, row by row, from the factors and the weights.
    pub(crate) second: fn(&mut Graph, &[NodeId], &[NodeId]) -> Vec<NodeId>,
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
        let used = |of: &&Contraction| of.values.iter().filter(|&&value| is_used(value)).count() > 1;
        self.contractions.iter().filter(used).cloned().collect()
    }
}
