//! Evaluates a graph over any number type: doubles, dual numbers, multi-precision.

use super::node::Computed;
use super::{Graph, Input, NodeId, Op, reachable};
use energy_runtime::{Baseline, Inputs, Mask, Number};

/// The operations that compute some outputs of a graph, in order. They are found once, for any number of inputs.
#[derive(Clone, Debug)]
pub struct Interpreter {
    /// Operands are places in this list.
    operations: Vec<Op>,
    /// The places of the outputs.
    outputs: Vec<NodeId>,
}

/// The results of the operations so far.
struct Values<T: Number>(Vec<Computed<T>>);

impl<T: Number> Values<T> {
    fn number(&self, place: NodeId) -> T {
        match &self.0[place.0 as usize] {
            Computed::Number(value) => value.clone(),
            Computed::Mask(_) => unreachable!("compiler bug: a number was expected of {place:?}"),
        }
    }

    fn mask(&self, place: NodeId) -> T::Mask {
        match &self.0[place.0 as usize] {
            Computed::Mask(value) => *value,
            Computed::Number(_) => unreachable!("compiler bug: a mask was expected of {place:?}"),
        }
    }
}

impl Interpreter {
    /// Finds the operations that compute `outputs`.
    #[must_use]
    pub fn new(graph: &Graph, outputs: &[NodeId]) -> Self {
        let nodes = reachable(graph, outputs);
        let mut places = vec![NodeId(0); graph.len()];
        for (place, node) in (0..).zip(&nodes) {
            places[node.0 as usize] = NodeId(place);
        }
        let place = |node: NodeId| places[graph.resolve(node).0 as usize];
        let operations = nodes.iter().map(|&node| graph.fused(node).with_operands(place)).collect();
        Self { operations, outputs: outputs.iter().map(|&output| place(output)).collect() }
    }

    /// Returns the values of the outputs, none of which may be a mask. `precomputed` are the numbers that a graph may
    /// read besides its inputs.
    pub fn evaluate<T: Number>(&self, inputs: &Inputs<'_, T>, precomputed: &[T]) -> Vec<T> {
        let values = self.values(inputs, precomputed);
        self.outputs.iter().map(|&output| values.number(output)).collect()
    }

    /// Returns the values of outputs that are masks.
    pub fn masks<T: Number>(&self, inputs: &Inputs<'_, T>) -> Vec<T::Mask> {
        let values = self.values(inputs, &[]);
        self.outputs.iter().map(|&output| values.mask(output)).collect()
    }

    /// Returns the branch that every comparison, minimum, maximum and absolute value takes on the way to the outputs.
    pub fn branches<T: Number>(&self, inputs: &Inputs<'_, T>, precomputed: &[T]) -> Vec<T::Mask> {
        let values = self.values(inputs, precomputed);
        let n = |place| values.number(place);
        let branch = |(op, value): (&Op, &Computed<T>)| match (op, value) {
            (Op::Min(a, b) | Op::Max(a, b), _) => Some(n(*a).less(n(*b))),
            (Op::Abs(a), _) => Some(n(*a).less(T::from_f64(0.0))),
            (_, Computed::Mask(mask)) => Some(*mask),
            (_, Computed::Number(_)) => None,
        };
        self.operations.iter().zip(&values.0).filter_map(branch).collect()
    }

    /// Returns which precomputed numbers the outputs depend on, in order.
    pub fn precomputed(&self) -> impl Iterator<Item = usize> {
        self.operations.iter().filter_map(|op| match op {
            Op::Input(Input::Precomputed(number)) => Some(usize::from(*number)),
            _ => None,
        })
    }

    fn values<T: Number>(&self, inputs: &Inputs<'_, T>, precomputed: &[T]) -> Values<T> {
        let mut values = Values(Vec::with_capacity(self.operations.len()));
        for &op in &self.operations {
            let value = match op {
                Op::Constant(bits) => Computed::Number(T::from_f64(f64::from_bits(bits))),
                Op::Pi => Computed::Number(T::from_f64(0.0).atan2::<Baseline>(T::from_f64(-1.0))),
                Op::Input(input) => Computed::Number(read(input, inputs, precomputed)),
                Op::Cautious | Op::Truth(true) => Computed::Mask(!T::Mask::none()),
                Op::Truth(false) => Computed::Mask(T::Mask::none()),
                op => op.evaluate(|place| values.number(place), |place| values.mask(place)),
            };
            values.0.push(value);
        }
        values
    }
}

fn read<T: Number>(input: Input, inputs: &Inputs<'_, T>, precomputed: &[T]) -> T {
    match input {
        Input::Position(i) => inputs.positions[usize::from(i)].clone(),
        Input::Increment(_) => T::from_f64(0.0),
        Input::Velocity(i) => inputs.velocities.get(usize::from(i)).cloned().unwrap_or_else(|| T::from_f64(0.0)),
        Input::Parameter(i) => inputs.parameters[usize::from(i)].clone(),
        Input::Rest(i) => inputs.rest[usize::from(i)].clone(),
        Input::Precomputed(i) => precomputed[usize::from(i)].clone(),
    }
}
