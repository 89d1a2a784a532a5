//! A routine as a list of operations, for the interpreter and for planted faults.

use std::collections::BTreeMap;

use crate::graph::{Computed, Graph, NodeId, Op, apply, reachable};
use energy_runtime::{Inputs, Number};

/// Operations in topological order. Operands are indices into the list.
#[derive(Clone, Debug)]
pub(crate) struct Tape {
    ops: Vec<Op>,
    groups: Vec<Vec<NodeId>>,
    masks: Vec<NodeId>,
}

impl Tape {
    /// Creates the tape that computes the groups of numbers and the masks.
    pub(crate) fn new(graph: &Graph, groups: &[Vec<NodeId>], masks: &[NodeId]) -> Self {
        let outputs: Vec<NodeId> = groups.iter().flatten().chain(masks).copied().collect();
        let nodes = reachable(graph, &outputs);
        let places: BTreeMap<NodeId, NodeId> = nodes
            .iter()
            .enumerate()
            .map(|(place, &node)| (node, NodeId(u32::try_from(place).expect("fewer than 2³² nodes"))))
            .collect();
        let place = |node: NodeId| places[&graph.resolve(node)];
        Self {
            ops: nodes.iter().map(|&node| with_operands(graph.fused(node), place)).collect(),
            groups: groups.iter().map(|group| group.iter().map(|&node| place(node)).collect()).collect(),
            masks: masks.iter().map(|&node| place(node)).collect(),
        }
    }

    pub(crate) fn ops(&self) -> &[Op] {
        &self.ops
    }

    /// Returns the tape with another operation at one index.
    pub(crate) fn with(&self, place: usize, op: Op) -> Self {
        let mut tape = self.clone();
        tape.ops[place] = op;
        tape
    }

    fn values<T: Number>(&self, inputs: &Inputs<'_, T>, precomputed: &[T]) -> Vec<Computed<T>> {
        let mut values: Vec<Computed<T>> = Vec::with_capacity(self.ops.len());
        for &op in &self.ops {
            let value = apply(op, inputs, precomputed, |at| number(&values, at), |at| mask(&values, at));
            values.push(value);
        }
        values
    }

    /// Returns the outcomes of all comparisons.
    pub(crate) fn comparisons<T: Number>(&self, inputs: &Inputs<'_, T>, precomputed: &[T]) -> Vec<T::Mask> {
        let mask = |value| if let Computed::Mask(mask) = value { Some(mask) } else { None };
        self.values(inputs, precomputed).into_iter().filter_map(mask).collect()
    }

    /// Returns the groups of numbers, and the masks.
    pub(crate) fn run<T: Number>(&self, inputs: &Inputs<'_, T>, precomputed: &[T]) -> (Vec<Vec<T>>, Vec<T::Mask>) {
        let values = self.values(inputs, precomputed);
        let group = |group: &Vec<NodeId>| group.iter().map(|&at| number(&values, at)).collect();
        (self.groups.iter().map(group).collect(), self.masks.iter().map(|&at| mask(&values, at)).collect())
    }

    /// Returns whether two tapes provably are the same function in exact arithmetic. Both are built into one
    /// hash-consed graph where rounding errors are 0; all outputs must be the same nodes.
    pub(crate) fn is_proved_equal(&self, other: &Self) -> bool {
        let mut graph = Graph::textbook();
        self.exactly(&mut graph) == other.exactly(&mut graph)
    }

    fn exactly(&self, g: &mut Graph) -> Vec<Signed> {
        let mut signed: Vec<Signed> = Vec::with_capacity(self.ops.len());
        for &op in &self.ops {
            let value = Signed::rebuilt(g, op, &signed);
            signed.push(value);
        }
        self.groups.iter().flatten().chain(&self.masks).map(|at| signed[at.0 as usize]).collect()
    }

    /// Marks the operations that affect a number of the result, other than through a comparison.
    pub(crate) fn are_numbers_of_results(&self) -> Vec<bool> {
        let mut reach = vec![false; self.ops.len()];
        for at in self.groups.iter().flatten() {
            reach[at.0 as usize] = true;
        }
        for place in (0..self.ops.len()).rev().filter(|&place| !self.ops[place].is_mask()) {
            if reach[place] {
                self.ops[place].operands().for_each(|at| reach[at.0 as usize] = true);
            }
        }
        reach
    }
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
            // A tape's way to pass on a number.
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
            other => {
                // Written as 0 − a, which is always the same node; the negative of a difference may be one of two.
                let zero = g.constant(0.0);
                let with_signs = with_operands(other, |id| {
                    let Self { node, negative } = at(id);
                    if negative { g.plain_difference(zero, node) } else { node }
                });
                let node = rebuilt(g, with_signs);
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

fn number<T: Number>(values: &[Computed<T>], at: NodeId) -> T {
    match &values[at.0 as usize] {
        Computed::Number(value) => value.clone(),
        Computed::Mask(_) => unreachable!("compiler bug: a number was expected of {at:?}"),
    }
}

fn mask<T: Number>(values: &[Computed<T>], at: NodeId) -> T::Mask {
    match &values[at.0 as usize] {
        Computed::Mask(value) => *value,
        Computed::Number(_) => unreachable!("compiler bug: a mask was expected of {at:?}"),
    }
}

/// Rebuilds an operation that is not arithmetic by the simplifying constructors.
fn rebuilt(g: &mut Graph, op: Op) -> NodeId {
    match op {
        Op::Constant(bits) => g.constant(f64::from_bits(bits)),
        Op::Truth(value) => g.truth(value),
        Op::Cautious => g.cautious(),
        Op::Pi => g.pi(),
        Op::Input(input) => g.input(input),
        Op::Sqrt(a) => g.sqrt(a),
        Op::Min(a, b) => g.min(a, b),
        Op::Max(a, b) => g.max(a, b),
        Op::Sin(a) => g.sin(a),
        Op::Cos(a) => g.cos(a),
        Op::Exp(a) => g.exp(a),
        Op::Ln(a) => g.ln(a),
        Op::Atan2(a, b) => g.atan2(a, b),
        Op::ModerateAtan2(a, b) => g.moderate_atan2(a, b),
        Op::Pow(a, b) => g.pow(a, b),
        Op::SumError(..) | Op::DifferenceError(..) | Op::ProductError(..) | Op::RootError(..) => g.constant(0.0),
        Op::PowerOfTwoScale(a) => g.power_of_two_scale(a),
        Op::Select(mask, a, b) => g.select(mask, a, b),
        Op::Less(a, b) => g.less(a, b),
        Op::LessOrEqual(a, b) => g.less_or_equal(a, b),
        Op::Equal(a, b) => g.equal(a, b),
        Op::IsModerate(a, degree) => g.is_moderate(a, degree),
        Op::And(a, b) => g.and(a, b),
        Op::Or(a, b) => g.or(a, b),
        Op::Not(a) => g.not(a),
        _ => unreachable!("compiler bug: arithmetic is rebuilt with its signs, and rules are resolved to their values"),
    }
}

/// Returns the operation on other operands.
fn with_operands(op: Op, mut to: impl FnMut(NodeId) -> NodeId) -> Op {
    match op {
        Op::Constant(_) | Op::Truth(_) | Op::Cautious | Op::Pi | Op::Input(_) | Op::Rule(_) => op,
        Op::Neg(a) => Op::Neg(to(a)),
        Op::Sqrt(a) => Op::Sqrt(to(a)),
        Op::Abs(a) => Op::Abs(to(a)),
        Op::Sin(a) => Op::Sin(to(a)),
        Op::Cos(a) => Op::Cos(to(a)),
        Op::Exp(a) => Op::Exp(to(a)),
        Op::Ln(a) => Op::Ln(to(a)),
        Op::PowerOfTwoScale(a) => Op::PowerOfTwoScale(to(a)),
        Op::IsModerate(a, degree) => Op::IsModerate(to(a), degree),
        Op::Not(a) => Op::Not(to(a)),
        Op::Add(a, b) => Op::Add(to(a), to(b)),
        Op::Sub(a, b) => Op::Sub(to(a), to(b)),
        Op::Mul(a, b) => Op::Mul(to(a), to(b)),
        Op::Div(a, b) => Op::Div(to(a), to(b)),
        Op::Min(a, b) => Op::Min(to(a), to(b)),
        Op::Max(a, b) => Op::Max(to(a), to(b)),
        Op::Atan2(a, b) => Op::Atan2(to(a), to(b)),
        Op::ModerateAtan2(a, b) => Op::ModerateAtan2(to(a), to(b)),
        Op::Pow(a, b) => Op::Pow(to(a), to(b)),
        Op::SumError(a, b) => Op::SumError(to(a), to(b)),
        Op::DifferenceError(a, b) => Op::DifferenceError(to(a), to(b)),
        Op::ProductError(a, b) => Op::ProductError(to(a), to(b)),
        Op::RootError(a, b) => Op::RootError(to(a), to(b)),
        Op::Less(a, b) => Op::Less(to(a), to(b)),
        Op::LessOrEqual(a, b) => Op::LessOrEqual(to(a), to(b)),
        Op::Equal(a, b) => Op::Equal(to(a), to(b)),
        Op::And(a, b) => Op::And(to(a), to(b)),
        Op::Or(a, b) => Op::Or(to(a), to(b)),
        Op::FusedMulSub(a, b, c) => Op::FusedMulSub(to(a), to(b), to(c)),
        Op::MulAdd(a, b, c) => Op::MulAdd(to(a), to(b), to(c)),
        Op::MulSub(a, b, c) => Op::MulSub(to(a), to(b), to(c)),
        Op::NegMulSub(a, b, c) => Op::NegMulSub(to(a), to(b), to(c)),
        Op::NegMulAdd(a, b, c) => Op::NegMulAdd(to(a), to(b), to(c)),
        Op::Select(mask, a, b) => Op::Select(to(mask), to(a), to(b)),
    }
}

#[cfg(test)]
mod tests {
    use crate::inspect::Interpreted;
    use crate::inspect::mutation::Fault;

    /// Pure rounding errors are 0 in exact arithmetic, and a squared cross product has no sign.
    #[test]
    fn what_changes_nothing_is_proved_and_what_changes_something_is_not() {
        let hinge = "energy Angle(a, b, c, d: Point) { dihedral(a, b, c, d) }";
        let bend = "energy Bend(a, b, c: Point) { 1 - dot(unit(b - a), unit(c - b)) }";
        for (source, least) in [(hinge, 100), (bend, 5)] {
            let element = Interpreted::from_source(source).unwrap().remove(0);
            let all = element.mutations();
            let proved = all.iter().filter(|mutation| element.is_proved_equivalent(mutation)).count();
            assert!(proved >= least && proved < all.len() / 2, "{proved} of {}", all.len());
        }
        let square = Interpreted::from_source("energy S(a, b: Point) { norm_squared(a - b) }").unwrap().remove(0);
        let value = |m: &&crate::Mutation| m.routine == "value";
        let proved: Vec<Fault> = square
            .mutations()
            .iter()
            .filter(value)
            .filter(|mutation| square.is_proved_equivalent(mutation))
            .map(|mutation| mutation.fault)
            .collect();
        assert_eq!(proved, [Fault::SwappedOperands; 3], "a − b or b − a, squared");
    }
}
