//! The singular values of a matrix, and which expressions depend on nothing else that moves.

use super::{Graph, NodeId, Op};

/// The singular value decomposition F = Σ σᵢ uᵢ vᵢᵀ.
#[derive(Clone, Debug)]
pub(crate) struct Spectrum {
    /// The entries of F, row by row.
    pub(crate) matrix: Vec<NodeId>,
    /// σᵢ, as rules.
    pub(crate) values: Vec<NodeId>,
    /// uᵢ.
    pub(crate) left: Vec<Vec<NodeId>>,
    /// vᵢ.
    pub(crate) right: Vec<Vec<NodeId>>,
    /// The unit normal of both columns of a 3×2 matrix.
    pub(crate) normal: Option<Vec<NodeId>>,
}

/// The moving numbers that an expression depends on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Dependence {
    /// None.
    Fixed,
    /// The singular values of one matrix, by index.
    Spectral(usize),
    /// Any others.
    Mixed,
}

impl Dependence {
    /// Returns what an expression of two others depends on.
    pub(crate) fn join(self, other: Self) -> Self {
        match (self, other) {
            (Self::Fixed, any) | (any, Self::Fixed) => any,
            (a, b) if a == b => a,
            _ => Self::Mixed,
        }
    }
}

impl Graph {
    /// Records a spectrum, unless it is known.
    pub(crate) fn note_spectrum(&mut self, spectrum: Spectrum) {
        if !self.spectra.iter().any(|known| known.values == spectrum.values) {
            self.spectra.push(spectrum);
        }
    }

    /// Returns all spectra.
    pub(crate) fn spectra(&self) -> &[Spectrum] {
        &self.spectra
    }

    /// Extends a list of dependences, by the index of the node, to all nodes.
    pub(crate) fn trace_dependence(&self, known: &mut Vec<Dependence>) {
        for index in known.len()..self.len() {
            let dependence = self.dependence(NodeId(u32::try_from(index).expect("fewer than 2³² nodes")), known);
            known.push(dependence);
        }
    }

    fn dependence(&self, node: NodeId, known: &[Dependence]) -> Dependence {
        if !self.varies(node) {
            return Dependence::Fixed;
        }
        if let Some(index) = self.spectra.iter().position(|spectrum| spectrum.values.contains(&node)) {
            return Dependence::Spectral(index);
        }
        let join = |sources: &mut dyn Iterator<Item = NodeId>| {
            sources.map(|source| known[source.0 as usize]).fold(Dependence::Fixed, Dependence::join)
        };
        match (self.rule(node), self.op(node)) {
            (Some(rule), _) => join(&mut rule.arguments.iter().copied()),
            (None, Op::Input(_)) => Dependence::Mixed,
            (None, op) => join(&mut op.operands()),
        }
    }
}
