//! Evaluates a graph over any number type: doubles, dual numbers, multi-precision.

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

/// The result of an operation.
#[derive(Clone)]
enum Computed<T: Number> {
    /// A number of the evaluated type.
    Number(T),
    /// A mask of the evaluated type.
    Mask(T::Mask),
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
            let value = apply(op, inputs, precomputed, |place| values.number(place), |place| values.mask(place));
            values.0.push(value);
        }
        values
    }
}

/// Evaluates one operation; `n` and `m` return its operands.
fn apply<T: Number>(
    op: Op,
    inputs: &Inputs<'_, T>,
    precomputed: &[T],
    n: impl Fn(NodeId) -> T,
    m: impl Fn(NodeId) -> T::Mask,
) -> Computed<T> {
    Computed::Number(match op {
        Op::Constant(bits) => T::from_f64(f64::from_bits(bits)),
        Op::Pi => T::from_f64(0.0).atan2::<Baseline>(T::from_f64(-1.0)),
        Op::Input(input) => read(input, inputs, precomputed),
        Op::Neg(a) => -n(a),
        Op::Add(a, b) => n(a) + n(b),
        Op::Sub(a, b) => n(a) - n(b),
        Op::Mul(a, b) => n(a) * n(b),
        Op::Div(a, b) => n(a) / n(b),
        Op::Sqrt(a) => n(a).sqrt(),
        Op::Abs(a) => n(a).abs(),
        Op::Min(a, b) => n(a).min(n(b)),
        Op::Max(a, b) => n(a).max(n(b)),
        Op::Sin(a) => n(a).sin::<Baseline>(),
        Op::Cos(a) => n(a).cos::<Baseline>(),
        Op::Exp(a) => n(a).exp::<Baseline>(),
        Op::Ln(a) => n(a).ln::<Baseline>(),
        Op::Atan2(a, b) => n(a).atan2::<Baseline>(n(b)),
        Op::ModerateAtan2(a, b) => n(a).moderate_atan2::<Baseline>(n(b)),
        Op::Pow(a, b) => n(a).powf::<Baseline>(n(b)),
        Op::SumError(a, b) => n(a).sum_error(n(b)),
        Op::DifferenceError(a, b) => n(a).difference_error(n(b)),
        Op::ProductError(a, b) => n(a).product_error::<Baseline>(n(b)),
        Op::FusedMulSub(a, b, c) => n(a).fused_mul_sub::<Baseline>(n(b), n(c)),
        Op::RootError(a, b) => n(a).root_error::<Baseline>(n(b)),
        Op::MulAdd(a, b, c) => n(a) * n(b) + n(c),
        Op::MulSub(a, b, c) => n(a) * n(b) - n(c),
        Op::NegMulSub(a, b, c) => -(n(a) * n(b)) - n(c),
        Op::NegMulAdd(a, b, c) => n(c) - n(a) * n(b),
        Op::PowerOfTwoScale(a) => n(a).power_of_two_scale(),
        Op::Select(mask, a, b) => T::select(m(mask), n(a), n(b)),
        Op::Less(a, b) => return Computed::Mask(n(a).less(n(b))),
        Op::Precedes(a, b) => return Computed::Mask(n(a).precedes(n(b))),
        Op::LessOrEqual(a, b) => return Computed::Mask(n(a).less_or_equal(n(b))),
        Op::Equal(a, b) => return Computed::Mask(n(a).equal(n(b))),
        Op::IsModerate(a, degree) => return Computed::Mask(n(a).is_moderate(degree)),
        Op::Cautious => return Computed::Mask(!T::Mask::none()),
        Op::Truth(value) => return Computed::Mask(if value { !T::Mask::none() } else { T::Mask::none() }),
        Op::And(a, b) => return Computed::Mask(m(a) & m(b)),
        Op::Or(a, b) => return Computed::Mask(m(a) | m(b)),
        Op::Not(a) => return Computed::Mask(!m(a)),
        Op::Rule(_) => unreachable!("compiler bug: rules are resolved to their values"),
    })
}

fn read<T: Number>(input: Input, inputs: &Inputs<'_, T>, precomputed: &[T]) -> T {
    match input {
        Input::Position(i) => inputs.positions[usize::from(i)].clone(),
        Input::Velocity(i) => inputs.velocities.get(usize::from(i)).cloned().unwrap_or_else(|| T::from_f64(0.0)),
        Input::Parameter(i) => inputs.parameters[usize::from(i)].clone(),
        Input::Rest(i) => inputs.rest[usize::from(i)].clone(),
        Input::Precomputed(i) => precomputed[usize::from(i)].clone(),
    }
}
