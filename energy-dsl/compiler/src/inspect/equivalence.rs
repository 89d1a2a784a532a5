//! Proofs that a planted fault changes nothing in exact arithmetic.

use crate::graph::{Graph, NodeId, Op};
use crate::plan::Code;

/// Returns whether two paths provably are the same function in exact arithmetic. Both are built into one hash-consed
/// graph where rounding errors are 0; all outputs must be the same nodes.
pub(crate) fn is_proved_equal(one: &Code, other: &Code) -> bool {
    let mut graph = Graph::textbook();
    exactly(one, &mut graph) == exactly(other, &mut graph)
}

fn exactly(code: &Code, g: &mut Graph) -> Vec<Signed> {
    let list = code.statements.list();
    let mut signed: Vec<Signed> = Vec::with_capacity(list.len());
    for &op in list {
        let value = Signed::rebuilt(g, op, &signed);
        signed.push(value);
    }
    code.returned().map(|at| signed[at.0 as usize]).collect()
}

/// A node or its negative. With it, a − b and b − a are one node, and so are their squares.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Signed {
    node: NodeId,
    negative: bool,
}

impl Signed {
    fn of(g: &mut Graph, node: NodeId) -> Self {
        match (g.op(node), g.as_constant(node)) {
            (Op::Neg(a), _) => Self { node: a, negative: true },
            (_, Some(x)) if x < 0.0 => Self { node: g.constant(-x), negative: true },
            _ => Self { node, negative: false },
        }
    }

    fn flipped(self, by: bool) -> Self {
        Self { negative: self.negative != by, ..self }
    }

    fn rebuilt(g: &mut Graph, op: Op, signed: &[Self]) -> Self {
        let at = |id: NodeId| signed[id.0 as usize];
        match op {
            Op::Neg(a) => at(a).flipped(true),
            // The way of a fault to pass on a number.
            Op::Max(a, b) if a == b => at(a),
            Op::Add(a, b) => Self::sum(g, at(a), at(b)),
            Op::Sub(a, b) => Self::sum(g, at(a), at(b).flipped(true)),
            Op::Mul(a, b) => Self::product(g, at(a), at(b)),
            Op::Div(a, b) => {
                let quotient = g.div(at(a).node, at(b).node);
                Self::of(g, quotient).flipped(at(a).negative != at(b).negative)
            }
            Op::FusedMulSub(a, b, c) | Op::MulSub(a, b, c) => {
                let product = Self::product(g, at(a), at(b));
                Self::sum(g, product, at(c).flipped(true))
            }
            Op::MulAdd(a, b, c) => {
                let product = Self::product(g, at(a), at(b));
                Self::sum(g, product, at(c))
            }
            Op::NegMulAdd(a, b, c) => {
                let product = Self::product(g, at(a), at(b)).flipped(true);
                Self::sum(g, at(c), product)
            }
            Op::NegMulSub(a, b, c) => {
                let product = Self::product(g, at(a), at(b));
                Self::sum(g, product, at(c)).flipped(true)
            }
            Op::Abs(a) => {
                let magnitude = g.abs(at(a).node);
                Self::of(g, magnitude)
            }
            op if op.is_constant_in_exact_arithmetic() && !matches!(op, Op::PowerOfTwoScale(_)) => {
                Self { node: g.constant(0.0), negative: false }
            }
            other => {
                // Written as 0 − a, which is always the same node; the negative of a difference may be one of two.
                let zero = g.constant(0.0);
                let with_signs = other.with_operands(|id| {
                    let Self { node, negative } = at(id);
                    if negative { g.plain_difference(zero, node) } else { node }
                });
                let node = g.rebuilt(with_signs);
                Self::of(g, node)
            }
        }
    }

    fn product(g: &mut Graph, a: Self, b: Self) -> Self {
        let product = g.mul(a.node, b.node);
        Self::of(g, product).flipped(a.negative != b.negative)
    }

    /// Puts the earlier node first and positive, so that sums that differ in sign or order become one node.
    fn sum(g: &mut Graph, a: Self, b: Self) -> Self {
        // The graph would turn the negative of a difference into another node.
        if g.is(a.node, 0.0) || g.is(b.node, 0.0) {
            return if g.is(a.node, 0.0) { b } else { a };
        }
        let (a, b) = if a.node <= b.node { (a, b) } else { (b, a) };
        let sum = if a.negative == b.negative { g.add(a.node, b.node) } else { g.sub(a.node, b.node) };
        Self::of(g, sum).flipped(a.negative)
    }
}
