//! A routine as a list of operations: what the interpreter of whole elements runs, and what mutations are planted in.

use std::collections::BTreeMap;

use crate::graph::{Form, Graph, NodeId, Op, reachable};
use crate::interpret::{Computed, apply};
use crate::runtime::{Inputs, Number};

/// Operations in topological order; operands are their places in the list.
#[derive(Clone, Debug)]
pub(crate) struct Tape {
    ops: Vec<Op>,
    groups: Vec<Vec<NodeId>>,
    masks: Vec<NodeId>,
}

impl Tape {
    /// What computes the numbers of the groups, and the masks.
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

    /// The same with another operation at a place.
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

    /// The outcomes of all comparisons.
    pub(crate) fn comparisons<T: Number>(&self, inputs: &Inputs<'_, T>, precomputed: &[T]) -> Vec<T::Mask> {
        let mask = |value| if let Computed::Mask(mask) = value { Some(mask) } else { None };
        self.values(inputs, precomputed).into_iter().filter_map(mask).collect()
    }

    /// The groups of numbers, and the masks.
    pub(crate) fn run<T: Number>(&self, inputs: &Inputs<'_, T>, precomputed: &[T]) -> (Vec<Vec<T>>, Vec<T::Mask>) {
        let values = self.values(inputs, precomputed);
        let group = |group: &Vec<NodeId>| group.iter().map(|&at| number(&values, at)).collect();
        (self.groups.iter().map(group).collect(), self.masks.iter().map(|&at| mask(&values, at)).collect())
    }

    /// Whether two tapes are the same function in exact arithmetic, as far as the graph's constructors prove it: both are built
    /// into one hash-consed graph, where rounding errors are 0, and all that they return must meet.
    pub(crate) fn is_proved_equal(&self, other: &Self) -> bool {
        let mut graph = Graph::new(Form::Textbook);
        self.exactly(&mut graph) == other.exactly(&mut graph)
    }

    fn exactly(&self, g: &mut Graph) -> Vec<NodeId> {
        let mut nodes: Vec<NodeId> = Vec::with_capacity(self.ops.len());
        for &op in &self.ops {
            let node = rebuilt(g, with_operands(op, |at| nodes[at.0 as usize]));
            nodes.push(node);
        }
        self.groups.iter().flatten().chain(&self.masks).map(|at| nodes[at.0 as usize]).collect()
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

/// The operation in exact arithmetic, by the constructors that simplify.
fn rebuilt(g: &mut Graph, op: Op) -> NodeId {
    match op {
        Op::Constant(bits) => g.constant(f64::from_bits(bits)),
        Op::Truth(value) => g.truth(value),
        Op::Cautious => g.cautious(),
        Op::Pi => g.pi(),
        Op::Input(input) => g.input(input),
        Op::Neg(a) => g.neg(a),
        Op::Add(a, b) => g.add(a, b),
        Op::Sub(a, b) => g.sub(a, b),
        Op::Mul(a, b) => g.mul(a, b),
        Op::Div(a, b) => g.div(a, b),
        Op::Sqrt(a) => g.sqrt(a),
        Op::Abs(a) => g.abs(a),
        Op::Min(a, b) => g.min(a, b),
        Op::Max(a, b) => g.max(a, b),
        Op::Sin(a) => g.sin(a),
        Op::Cos(a) => g.cos(a),
        Op::Exp(a) => g.exp(a),
        Op::Ln(a) => g.ln(a),
        Op::Atan2(a, b) => g.atan2(a, b),
        Op::Pow(a, b) => g.pow(a, b),
        Op::SumError(..) | Op::DifferenceError(..) | Op::ProductError(..) | Op::RootError(..) => g.constant(0.0),
        Op::FusedMulSub(a, b, c) | Op::MulSub(a, b, c) => {
            let product = g.mul(a, b);
            g.sub(product, c)
        }
        Op::MulAdd(a, b, c) => {
            let product = g.mul(a, b);
            g.add(product, c)
        }
        Op::NegMulAdd(a, b, c) => {
            let product = g.mul(a, b);
            g.sub(c, product)
        }
        Op::PowerOfTwoScale(a) => g.power_of_two_scale(a),
        Op::Select(mask, a, b) => g.select(mask, a, b),
        Op::Less(a, b) => g.less(a, b),
        Op::LessOrEqual(a, b) => g.less_or_equal(a, b),
        Op::Equal(a, b) => g.equal(a, b),
        Op::IsModerate(a, degree) => g.is_moderate(a, degree),
        Op::And(a, b) => g.and(a, b),
        Op::Or(a, b) => g.or(a, b),
        Op::Not(a) => g.not(a),
        Op::Rule(_) => unreachable!("compiler bug: rules are resolved to their values"),
    }
}

/// The operation on other operands.
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
        Op::NegMulAdd(a, b, c) => Op::NegMulAdd(to(a), to(b), to(c)),
        Op::Select(mask, a, b) => Op::Select(to(mask), to(a), to(b)),
    }
}
