use super::is_by_value;
use crate::graph::{ComputedAs, Graph, NodeId, OfOneNumber, Op, Product, symmetric_index};

/// The orders of derivatives to take.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Order {
    /// First derivatives, final.
    First,
    /// First derivatives that the formula uses, so they are differentiated again. Those of rules are rules too.
    FirstToDifferentiate,
    /// First and second derivatives.
    Second,
}

/// Derivatives of an operation with respect to its operands.
pub(super) struct Local {
    /// Operands, each listed once.
    pub(super) operands: Vec<NodeId>,
    /// First derivatives, one product per operand.
    pub(super) first: Vec<Product>,
    /// Second derivatives that are not identically zero, for operands i ≤ j.
    pub(super) second: Vec<(usize, usize, Vec<Product>)>,
}

impl Local {
    fn new(operands: Vec<NodeId>, first: Vec<NodeId>, second: Vec<(usize, usize, NodeId)>) -> Self {
        let first = first.into_iter().map(|entry| vec![entry]).collect();
        let second = second.into_iter().map(|(i, j, entry)| (i, j, vec![vec![entry]])).collect();
        Self { operands, first, second }
    }

    fn linear(operands: Vec<NodeId>, first: Vec<NodeId>) -> Self {
        Self::new(operands, first, Vec::new())
    }

    fn unary(operand: NodeId, first: NodeId, second: NodeId) -> Self {
        Self::new(vec![operand], vec![first], vec![(0, 0, second)])
    }
}

/// Returns the derivatives of `node` with respect to its operands.
pub(super) fn local(g: &mut Graph, node: NodeId, order: Order) -> Local {
    let one = g.constant(1.0);
    let zero = g.constant(0.0);
    let two = g.constant(2.0);
    if let Some(OfOneNumber { operand, slope, curvature }) = g.collapsed(node) {
        return Local { operands: vec![operand], first: vec![slope], second: vec![(0, 0, vec![curvature])] };
    }
    match g.op(node) {
        Op::Rule(_) => of_rule(g, node, order),
        Op::Neg(a) => {
            let minus = g.neg(one);
            Local::linear(vec![a], vec![minus])
        }
        Op::Add(a, b) if a == b => Local::linear(vec![a], vec![two]),
        Op::Add(a, b) => Local::linear(vec![a, b], vec![one, one]),
        Op::Sub(a, b) => {
            let minus = g.neg(one);
            Local::linear(vec![a, b], vec![one, minus])
        }
        Op::Mul(a, b) if a == b => {
            // The weight absorbs the 2, so that squares in a sum share it.
            Local { operands: vec![a], first: vec![vec![two, a]], second: vec![(0, 0, vec![vec![two]])] }
        }
        Op::Mul(a, b) => Local::new(vec![a, b], vec![b, a], vec![(0, 1, one)]),
        Op::Div(a, b) => of_quotient(g, node, a, b),
        Op::Sqrt(a) => {
            // p = 1/(2√a); p′ = −2 p³.
            let (half, reciprocal) = (g.constant(0.5), g.div(one, node));
            let slope = g.mul(half, reciprocal);
            let square = g.mul(slope, slope);
            let cube = g.mul(square, slope);
            let curvature = g.mul(two, cube);
            let curvature = g.neg(curvature);
            Local::unary(a, slope, curvature)
        }
        Op::Abs(a) => {
            let minus = g.neg(one);
            let negative = g.less(a, zero);
            let sign = g.select(negative, minus, one);
            Local::linear(vec![a], vec![sign])
        }
        Op::Min(a, b) => {
            let second = g.less(b, a);
            choose(g, second, b, a)
        }
        Op::Max(a, b) => {
            let second = g.less(a, b);
            choose(g, second, b, a)
        }
        Op::Select(mask, a, b) => choose(g, mask, a, b),
        Op::Sin(a) => {
            let cosine = g.cos(a);
            let curvature = g.neg(node);
            Local::unary(a, cosine, curvature)
        }
        Op::Cos(a) => {
            let sine = g.sin(a);
            let (slope, curvature) = (g.neg(sine), g.neg(node));
            Local::unary(a, slope, curvature)
        }
        Op::Exp(a) => Local::unary(a, node, node),
        Op::Ln(a) => {
            let slope = g.div(one, a);
            let square = g.mul(slope, slope);
            let curvature = g.neg(square);
            Local::unary(a, slope, curvature)
        }
        Op::Atan2(y, x) | Op::ModerateAtan2(y, x) => of_atan2(g, y, x),
        Op::Pow(a, b) => of_power(g, node, a, b),
        Op::FusedMulSub(a, b, c) => of_product_and_sum(g, (a, b), one, c, -1.0),
        Op::MulAdd(a, b, c) => of_product_and_sum(g, (a, b), one, c, 1.0),
        Op::NegMulAdd(a, b, c) => {
            let minus = g.neg(one);
            of_product_and_sum(g, (a, b), minus, c, 1.0)
        }
        Op::Constant(_) | Op::Pi | Op::Input(_) => Local::linear(Vec::new(), Vec::new()),
        op if op.is_mask() || op.is_constant_in_exact_arithmetic() => Local::linear(Vec::new(), Vec::new()),
        // Other sums fuse when code is written, not before.
        op => unreachable!("compiler bug: no derivative of {op:?}"),
    }
}

fn of_rule(g: &mut Graph, node: NodeId, order: Order) -> Local {
    if let Some(ComputedAs { computed, defined, slopes }) = g.computed_as(node) {
        let operand = if slopes && order != Order::Second { computed } else { defined };
        return Local::linear(vec![operand], vec![g.constant(1.0)]);
    }
    let rule = g.rule(node).expect("a rule").clone();
    if is_by_value(g, &rule, order) {
        return Local::linear(vec![rule.value], vec![g.constant(1.0)]);
    }
    let n = rule.arguments.len();
    let second = match (order, rule.second) {
        (Order::First, _) => return Local { operands: rule.arguments, first: rule.first, second: Vec::new() },
        (Order::FirstToDifferentiate, _) => {
            let first = (0..n).map(|i| g.partial(node, i)).collect();
            return Local::linear(rule.arguments, first);
        }
        (Order::Second, second) => second.unwrap_or_default(),
    };
    let second = (0..n)
        .flat_map(|i| (i..n).map(move |j| (i, j)))
        .map(|(i, j)| (i, j, second[symmetric_index(n, i, j)].clone()))
        .filter(|(_, _, entry)| !g.vanishes(entry))
        .collect();
    Local { operands: rule.arguments, first: rule.first, second }
}

/// Returns the derivatives of sign · a · b + factor · c.
fn of_product_and_sum(g: &mut Graph, (a, b): (NodeId, NodeId), sign: NodeId, c: NodeId, factor: f64) -> Local {
    let factor = g.constant(factor);
    if a == b {
        let two = g.constant(2.0);
        let curvature = g.mul(two, sign);
        let slope = g.mul(curvature, a);
        return Local::new(vec![a, c], vec![slope, factor], vec![(0, 0, curvature)]);
    }
    let (by_a, by_b) = (g.mul(sign, b), g.mul(sign, a));
    Local::new(vec![a, b, c], vec![by_a, by_b, factor], vec![(0, 1, sign)])
}

/// Returns the derivatives of `mask ? a : b`; they select in the same way.
fn choose(g: &mut Graph, mask: NodeId, a: NodeId, b: NodeId) -> Local {
    let (one, zero) = (g.constant(1.0), g.constant(0.0));
    let (by_a, by_b) = (g.select(mask, one, zero), g.select(mask, zero, one));
    Local::linear(vec![a, b], vec![by_a, by_b])
}

fn of_quotient(g: &mut Graph, node: NodeId, a: NodeId, b: NodeId) -> Local {
    let reciprocal = reciprocal(g, b);
    let slope = g.mul(node, reciprocal);
    let by_b = g.neg(slope);
    let square = g.mul(reciprocal, reciprocal);
    let mixed = g.neg(square);
    let two = g.constant(2.0);
    let curvature = g.mul(slope, reciprocal);
    let curvature = g.mul(two, curvature);
    Local::new(vec![a, b], vec![reciprocal, by_b], vec![(0, 1, mixed), (1, 1, curvature)])
}

/// Creates 1/b. That of a length is known.
fn reciprocal(g: &mut Graph, b: NodeId) -> NodeId {
    let (one, cautious) = (g.constant(1.0), g.cautious());
    let reciprocal = g.div(one, b);
    match g.reciprocal_of_length(b) {
        Some(known) => g.select(cautious, reciprocal, known),
        None => reciprocal,
    }
}

fn of_atan2(g: &mut Graph, y: NodeId, x: NodeId) -> Local {
    let square = g.dot(&[x, y], &[x, y]);
    let (by_y, by_x) = (g.div(x, square), g.div(y, square));
    let by_x = g.neg(by_x);
    let two = g.constant(2.0);
    // With p = ∂/∂y and q = ∂/∂x: ∂²/∂y² = 2pq, ∂²/∂x² = −2pq, ∂²/∂x∂y = q² − p².
    let product = g.mul(by_y, by_x);
    let curvature = g.mul(two, product);
    let opposite = g.neg(curvature);
    let (pp, qq) = (g.mul(by_y, by_y), g.mul(by_x, by_x));
    let mixed = g.sub(qq, pp);
    Local::new(vec![y, x], vec![by_y, by_x], vec![(0, 0, curvature), (0, 1, mixed), (1, 1, opposite)])
}

fn of_power(g: &mut Graph, node: NodeId, a: NodeId, b: NodeId) -> Local {
    let (one, two) = (g.constant(1.0), g.constant(2.0));
    let (less_one, less_two) = (g.sub(b, one), g.sub(b, two));
    let (lower, lowest) = (g.plain_pow(a, less_one), g.plain_pow(a, less_two));
    let by_a = g.mul(b, lower);
    let factor = g.mul(b, less_one);
    let by_aa = g.mul(factor, lowest);
    if !g.varies(b) {
        return Local::unary(a, by_a, by_aa);
    }
    let log = g.ln(a);
    let by_b = g.mul(node, log);
    let by_bb = g.mul(by_b, log);
    // ∂²/∂a∂b = a^(b−1) (1 + b ln a).
    let product = g.mul(b, log);
    let sum = g.add(one, product);
    let by_ab = g.mul(lower, sum);
    Local::new(vec![a, b], vec![by_a, by_b], vec![(0, 0, by_aa), (0, 1, by_ab), (1, 1, by_bb)])
}
