//! Finds out whether a function of singular values stays the same after a reflection, by trying numbers.

use std::collections::BTreeSet;

use crate::graph::{Graph, Input, Interpreter, NodeId, Op, Substitution};
use energy_runtime::Inputs;

/// Number of random points.
const POINTS: u32 = 6;
/// Functions that differ by less, relative to their size, are equal.
const TOLERANCE: f64 = 1e-9;

/// The branches of ψ that stay the same after a reflection.
pub(super) enum Branches {
    Symmetric,
    Asymmetric,
    /// Those that are taken where the mask holds.
    SymmetricWhere(NodeId),
}

impl Branches {
    /// Tries all outcomes of the conditions.
    pub(super) fn of(g: &mut Graph, psi: NodeId, images: &[(NodeId, NodeId)], conditions: &[NodeId]) -> Self {
        let (mut symmetric, count) = (Vec::new(), 1_usize << conditions.len());
        for branch in 0..count {
            let outcomes: Vec<bool> = (0..conditions.len()).map(|i| branch >> i & 1 == 1).collect();
            let known = conditions.iter().zip(&outcomes).map(|(&mask, &outcome)| (mask, g.truth(outcome)));
            let known: Vec<(NodeId, NodeId)> = known.collect();
            if is_unchanged(g, psi, images, &known) {
                symmetric.push(outcomes);
            }
        }
        if symmetric.is_empty() {
            return Self::Asymmetric;
        }
        if symmetric.len() == count {
            return Self::Symmetric;
        }
        let mut mask = g.truth(false);
        for outcomes in symmetric {
            let literals = conditions.iter().zip(outcomes).map(|(&mask, holds)| if holds { mask } else { g.not(mask) });
            let literals: Vec<NodeId> = literals.collect();
            let always = g.truth(true);
            let taken = literals.into_iter().fold(always, |all, literal| g.and(all, literal));
            mask = g.or(mask, taken);
        }
        Self::SymmetricWhere(mask)
    }
}

/// Returns the moving conditions of the selections in a formula, seen from outside of robust primitives.
pub(super) fn conditions(g: &Graph, psi: NodeId) -> Vec<NodeId> {
    let condition = |node| match g.op(node) {
        Op::Select(mask, ..) => Some(mask),
        _ => None,
    };
    let found: BTreeSet<NodeId> = operations(g, psi).into_iter().filter_map(condition).collect();
    found.into_iter().filter(|&mask| g.varies(mask)).collect()
}

/// Returns the formula of singular values with selections for smaller and larger numbers. Its conditions are then those
/// of all branches.
pub(super) fn with_selections(g: &mut Graph, psi: NodeId, values: &[NodeId]) -> NodeId {
    let mut replaced: Vec<(NodeId, NodeId)> = values.iter().map(|&value| (value, value)).collect();
    // Operands have smaller numbers than their users.
    for node in operations(g, psi) {
        let (Op::Min(a, b) | Op::Max(a, b)) = g.op(node) else { continue };
        let mut copy = Substitution::new(g, replaced.iter().copied());
        let [a, b] = [a, b].map(|operand| copy.of(g, operand));
        let [smaller, larger] = if matches!(g.op(node), Op::Min(..)) { [a, b] } else { [b, a] };
        let is_less = g.less(a, b);
        replaced.push((node, g.select(is_less, smaller, larger)));
    }
    if replaced.len() == values.len() { psi } else { Substitution::new(g, replaced).of(g, psi) }
}

/// Returns the operations of a formula, seen from outside of robust primitives.
fn operations(g: &Graph, psi: NodeId) -> BTreeSet<NodeId> {
    let (mut seen, mut stack) = (BTreeSet::new(), vec![psi]);
    while let Some(node) = stack.pop() {
        if seen.insert(node) {
            match (g.rule(node), g.op(node)) {
                (Some(rule), _) => stack.extend(rule.arguments.iter().chain(&rule.inner)),
                (None, Op::Select(_, yes, no)) => stack.extend([yes, no]),
                (None, op) => stack.extend(op.operands()),
            }
        }
    }
    seen
}

/// Returns whether ψ is the same after a reflection, which maps all singular values to images, where the outcomes of
/// some conditions are known.
fn is_unchanged(g: &mut Graph, psi: NodeId, images: &[(NodeId, NodeId)], known: &[(NodeId, NodeId)]) -> bool {
    // Each singular value becomes an input.
    let inputs: Vec<NodeId> = (0..images.len()).map(|i| g.input(Input::Position(i as u16))).collect();
    let values = images.iter().map(|(value, _)| *value).zip(inputs);
    let mut plain = Substitution::new(g, values.chain(known.iter().copied()));
    let mirrored: Vec<(NodeId, NodeId)> = images.iter().map(|&(value, image)| (value, plain.of(g, image))).collect();
    let before = plain.of(g, psi);
    let after = Substitution::new(g, mirrored.into_iter().chain(known.iter().copied())).of(g, psi);
    if before == after {
        return true;
    }
    let both = Interpreter::new(g, &[before, after]);
    let mut random = Random(0x9e37_79b9_7f4a_7c15);
    let sizes = Sizes::of(g);
    let equal = |_| {
        let [positions, parameters, rest, precomputed] =
            [images.len(), sizes.parameters, sizes.rest, sizes.precomputed].map(|count| random.numbers(count));
        let inputs = Inputs { parameters: &parameters, rest: &rest, positions: &positions, velocities: &[] };
        let both = both.evaluate(&inputs, &precomputed);
        (both[0] - both[1]).abs() <= TOLERANCE * both[0].abs().max(both[1].abs())
    };
    (0..POINTS).all(equal)
}

/// Counts of the inputs that a graph reads.
#[derive(Default)]
struct Sizes {
    parameters: usize,
    rest: usize,
    precomputed: usize,
}

impl Sizes {
    fn of(g: &Graph) -> Self {
        let mut sizes = Self::default();
        for op in g.ops() {
            let (size, index) = match op {
                Op::Input(Input::Parameter(index)) => (&mut sizes.parameters, index),
                Op::Input(Input::Rest(index)) => (&mut sizes.rest, index),
                Op::Input(Input::Precomputed(index)) => (&mut sizes.precomputed, index),
                _ => continue,
            };
            *size = (*size).max(usize::from(index) + 1);
        }
        sizes
    }
}

/// Numbers in [½, 3/2), the same in every build.
struct Random(u64);

impl Random {
    fn numbers(&mut self, count: usize) -> Vec<f64> {
        (0..count).map(|_| self.number()).collect()
    }

    fn number(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        0.5 + (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }
}
