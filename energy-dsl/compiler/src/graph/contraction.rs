//! Weighted sums of the derivatives of several primitives.

use super::{Graph, NodeId, Primitive, Product};

/// The factors of a contraction and the weights of its values; the derivatives of their sum.
pub(crate) type Contracted<T> = fn(&mut Graph, &[NodeId], &[NodeId]) -> Vec<T>;

/// Primitives of the same arguments, such as the entries of R(F), and Σ wᵢ ∇²vᵢ in fewer operations than each ∇²vᵢ
/// takes.
#[derive(Clone, Debug)]
pub(crate) struct Contraction {
    /// The first of the primitives that can be among the values.
    pub(crate) family: Primitive,
    /// The fewest values for which it is shorter.
    pub(crate) fewest: usize,
    /// vᵢ, as rules.
    pub(crate) values: Vec<NodeId>,
    /// The arguments that they share.
    pub(crate) arguments: Vec<NodeId>,
    /// Numbers that `second` reads.
    pub(crate) factors: Vec<NodeId>,
    /// Returns Σ wᵢ ∇vᵢ; `None` if that takes no fewer operations than each ∇vᵢ.
    pub(crate) first: Option<Contracted<NodeId>>,
    /// Returns the matrix Σ wᵢ ∇²vᵢ, row by row. Each entry is a sum of as many products. Those at one place are the
    /// outer product of two vectors, if possible, so that they stay one after linear functions.
    pub(crate) second: Contracted<Vec<Product>>,
}

impl Contraction {
    /// Returns the weights of the values, 0 where there is none.
    pub(crate) fn weights(&self, g: &mut Graph, of: impl Fn(NodeId) -> Option<NodeId>) -> Vec<NodeId> {
        let zero = g.constant(0.0);
        self.values.iter().map(|&value| of(value).unwrap_or(zero)).collect()
    }
}

impl Graph {
    /// Records a contraction, in place of a known one of the same primitives.
    pub(crate) fn note_contraction(&mut self, contraction: Contraction) {
        let shares = |known: &Contraction| known.values.iter().any(|value| contraction.values.contains(value));
        self.contractions.retain(|known| known.family != contraction.family || !shares(known));
        self.contractions.push(contraction);
    }

    /// Returns the contractions of which enough primitives are among these nodes.
    pub(crate) fn contractions_of(&self, is_used: impl Fn(NodeId) -> bool) -> Vec<Contraction> {
        let is_rule = |&value: &NodeId| self.rule(value).is_some_and(|rule| !self.is_spelled_out(rule));
        let used = |of: &&Contraction| {
            of.values.iter().filter(|&value| is_used(*value) && is_rule(value)).count() >= of.fewest
        };
        self.contractions.iter().filter(used).cloned().collect()
    }
}
