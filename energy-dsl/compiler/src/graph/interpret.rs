//! Evaluates a graph over any number type: doubles, dual numbers, multi-precision.

use super::{Graph, Input, NodeId, Op, reachable};
use energy_runtime::{Baseline, Inputs, Mask, Number};

/// The result of an operation.
#[derive(Clone)]
enum Computed<T: Number> {
    /// A number of the evaluated type.
    Number(T),
    /// A mask of the evaluated type.
    Mask(T::Mask),
}

/// Returns the values of `outputs`, none of which may be a mask.
pub fn interpret<T: Number>(graph: &Graph, outputs: &[NodeId], inputs: &Inputs<'_, T>) -> Vec<T> {
    interpret_with(graph, outputs, inputs, &[])
}

/// Returns the values of `outputs` of a graph that reads precomputed numbers.
pub fn interpret_with<T: Number>(
    graph: &Graph,
    outputs: &[NodeId],
    inputs: &Inputs<'_, T>,
    precomputed: &[T],
) -> Vec<T> {
    let mut values: Vec<Option<Computed<T>>> = vec![None; graph.len()];
    for node in reachable(graph, outputs) {
        values[node.0 as usize] = Some(compute(graph, node, inputs, precomputed, &values));
    }
    outputs.iter().map(|&o| number(graph, &values, o)).collect()
}

/// Returns the branch that every comparison, minimum, maximum and absolute value takes on the way to `outputs`.
pub fn branches_with<T: Number>(
    graph: &Graph,
    outputs: &[NodeId],
    inputs: &Inputs<'_, T>,
    precomputed: &[T],
) -> Vec<T::Mask> {
    let mut values: Vec<Option<Computed<T>>> = vec![None; graph.len()];
    let mut branches = Vec::new();
    for node in reachable(graph, outputs) {
        let value = compute(graph, node, inputs, precomputed, &values);
        let n = |node| number(graph, &values, node);
        match (graph.fused(node), &value) {
            (Op::Min(a, b) | Op::Max(a, b), _) => branches.push(n(a).less(n(b))),
            (Op::Abs(a), _) => branches.push(n(a).less(T::from_f64(0.0))),
            (_, Computed::Mask(mask)) => branches.push(*mask),
            (_, Computed::Number(_)) => {}
        }
        values[node.0 as usize] = Some(value);
    }
    branches
}

/// Returns the value of a mask.
pub fn interpret_mask<T: Number>(graph: &Graph, output: NodeId, inputs: &Inputs<'_, T>) -> T::Mask {
    let mut values: Vec<Option<Computed<T>>> = vec![None; graph.len()];
    for node in reachable(graph, &[output]) {
        values[node.0 as usize] = Some(compute(graph, node, inputs, &[], &values));
    }
    mask(graph, &values, output)
}

fn number<T: Number>(graph: &Graph, values: &[Option<Computed<T>>], node: NodeId) -> T {
    match &values[graph.resolve(node).0 as usize] {
        Some(Computed::Number(value)) => value.clone(),
        _ => unreachable!("compiler bug: a number was expected of {node:?}"),
    }
}

fn mask<T: Number>(graph: &Graph, values: &[Option<Computed<T>>], node: NodeId) -> T::Mask {
    match &values[graph.resolve(node).0 as usize] {
        Some(Computed::Mask(value)) => *value,
        _ => unreachable!("compiler bug: a mask was expected of {node:?}"),
    }
}

fn compute<T: Number>(
    graph: &Graph,
    node: NodeId,
    inputs: &Inputs<'_, T>,
    precomputed: &[T],
    values: &[Option<Computed<T>>],
) -> Computed<T> {
    let n = |node| number(graph, values, node);
    let m = |node| mask::<T>(graph, values, node);
    apply(graph.fused(node), inputs, precomputed, n, m)
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
