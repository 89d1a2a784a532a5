//! Recognises functions minus the head of their Taylor series, and these over powers.

use super::super::elementary::{sine_remainder, versine};
use super::super::exponential::{expm1, log1pmx};
use super::monomial::{MOST_FACTORS, Monomial, lengths};
use super::series::{constant_term, remainder, successor, whole_remainder};
use crate::graph::{Expansion, Graph, NodeId, Op, Primitive};

/// Terms of a sum that are searched.
pub(super) const MOST_TERMS: usize = 12;
/// Order of the largest remainder.
pub(super) const LARGEST_ORDER: u32 = 12;
/// Coefficients that differ by this part are equal: each is rounded a few times.
pub(super) const SAME: f64 = 1e-15;

/// A node that is sign · xᵖ Φₖ(x).
#[derive(Clone, Copy)]
struct Function {
    node: NodeId,
    expansion: Expansion,
    k: u32,
    power: u32,
    sign: f64,
    x: NodeId,
}

/// Returns the function that a node computes.
fn function(g: &Graph, node: NodeId) -> Option<Function> {
    use Expansion::{Exponential, Logarithm, Trigonometric};
    let whole = |expansion, k, sign, x| Function { node, expansion, k, power: k, sign, x };
    match g.op(node) {
        Op::Exp(x) => return Some(whole(Exponential, 0, 1.0, x)),
        Op::Sin(x) => return Some(whole(Trigonometric, 1, 1.0, x)),
        Op::Cos(x) => return Some(whole(Trigonometric, 0, 1.0, x)),
        _ => {}
    }
    let rule = g.rule(node)?;
    let x = *rule.arguments.first()?;
    Some(match rule.primitive {
        Primitive::Expm1 => whole(Exponential, 1, 1.0, x),
        Primitive::Versine => whole(Trigonometric, 2, 1.0, x),
        Primitive::SineRemainder => whole(Trigonometric, 3, 1.0, x),
        Primitive::Log1p => whole(Logarithm, 1, 1.0, x),
        Primitive::Log1pmx => whole(Logarithm, 2, -1.0, x),
        Primitive::Sinc => Function { power: 0, ..whole(Trigonometric, 1, 1.0, x) },
        Primitive::Remainder(expansion, k, power) => {
            Function { power: power.into(), ..whole(expansion, k.into(), 1.0, x) }
        }
        _ => return None,
    })
}

/// Recognises a sum of a function and the negative head of its series.
pub(in super::super) fn recognise_sum(g: &mut Graph, a: NodeId, b: NodeId) -> Option<NodeId> {
    recognise_terms(g, &[(a, 1.0), (b, 1.0)])
}

/// Recognises a difference of a function and the head of its series.
pub(in super::super) fn recognise_difference(g: &mut Graph, a: NodeId, b: NodeId) -> Option<NodeId> {
    recognise_terms(g, &[(a, 1.0), (b, -1.0)])
}

fn recognise_terms(g: &mut Graph, sum: &[(NodeId, f64)]) -> Option<NodeId> {
    let (function, factor) = functions_in(g, sum).into_iter().find_map(|function| reduced(g, sum, function))?;
    Some(built(g, function, &factor))
}

/// Returns the functions among the terms of a sum; none if it is long.
fn functions_in(g: &Graph, sum: &[(NodeId, f64)]) -> Vec<Function> {
    let mut found = Vec::new();
    let mut open: Vec<NodeId> = sum.iter().map(|(node, _)| *node).collect();
    let mut terms = 0;
    while let Some(node) = open.pop() {
        match g.op(node) {
            Op::Add(x, y) | Op::Sub(x, y) => open.extend([x, y]),
            Op::Neg(x) => open.push(x),
            _ => {
                terms += 1;
                functions_of(g, node, &mut found);
            }
        }
        if terms + open.len() > MOST_TERMS {
            return Vec::new();
        }
    }
    found.retain(|function| g.varies(function.x));
    found
}

/// Returns the terms of a sum and their signs; `None` if there are many.
pub(super) fn leaves(g: &Graph, mut open: Vec<(NodeId, f64)>) -> Option<Vec<(NodeId, f64)>> {
    let mut found = Vec::new();
    while let Some((node, sign)) = open.pop() {
        match g.op(node) {
            Op::Add(a, b) => open.extend([(a, sign), (b, sign)]),
            Op::Sub(a, b) => open.extend([(a, sign), (b, -sign)]),
            Op::Neg(a) => open.push((a, -sign)),
            _ => found.push((node, sign)),
        }
        if found.len() + open.len() > MOST_TERMS {
            return None;
        }
    }
    Some(found)
}

/// Adds the functions among the factors of a product.
fn functions_of(g: &Graph, product: NodeId, found: &mut Vec<Function>) {
    found.extend(factors(g, product).into_iter().filter_map(|factor| function(g, factor)));
}

/// Returns the first factors of a product, above its divisors.
pub(super) fn factors(g: &Graph, product: NodeId) -> Vec<NodeId> {
    let (mut open, mut found) = (vec![product], Vec::new());
    for _ in 0..MOST_FACTORS {
        let Some(node) = open.pop() else { break };
        match g.op(node) {
            Op::Mul(x, y) => open.extend([x, y]),
            Op::Div(x, _) | Op::Neg(x) => open.push(x),
            _ => found.push(node),
        }
    }
    found
}

/// Returns the function of higher order that a sum equals, and its factor; `None` if the sum has other terms.
fn reduced(g: &Graph, sum: &[(NodeId, f64)], function: Function) -> Option<(Function, Monomial)> {
    let lengths = lengths(g, function.x);
    let x = Monomial::of(g, function.x, &lengths);
    let signed = |node: NodeId, sign: f64| Monomial::of(g, node, &lengths).scaled(sign);
    let (own, sign) = own_term(g, sum, function.node)?;
    let mut factor = signed(own, sign).without_power(function.node)?;
    // The function is sign · xᵖ Φₖ: moves powers of x into it.
    factor = factor.times(&x, i32::try_from(function.power).ok()? - i32::try_from(function.k).ok()?);
    factor.coefficient *= function.sign;
    let mut head = Vec::new();
    let mut open: Vec<(NodeId, f64)> = sum.to_vec();
    while let Some((node, sign)) = open.pop() {
        if node == own {
            continue;
        }
        match (signed(node, sign).times(&factor, -1).as_power_of(&x), g.op(node)) {
            (Some(term), _) => head.push(term),
            (None, Op::Add(a, b)) => open.extend([(a, sign), (b, sign)]),
            (None, Op::Sub(a, b)) => open.extend([(a, sign), (b, -sign)]),
            (None, Op::Neg(a)) => open.push((a, -sign)),
            _ => return None,
        }
    }
    let (k, sign) = after_head(function, head)?;
    factor.coefficient *= sign;
    Some((Function { k, power: k, sign: 1.0, ..function }, factor))
}

/// Returns the only term of a sum that a function is a factor of, and its sign.
fn own_term(g: &Graph, sum: &[(NodeId, f64)], function: NodeId) -> Option<(NodeId, f64)> {
    let mut found = Vec::new();
    let mut open = sum.to_vec();
    while let Some((node, sign)) = open.pop() {
        match g.op(node) {
            Op::Add(a, b) => open.extend([(a, sign), (b, sign)]),
            Op::Sub(a, b) => open.extend([(a, sign), (b, -sign)]),
            _ if factors(g, node).contains(&function) => found.push((node, sign)),
            Op::Neg(a) => open.push((a, -sign)),
            _ => {}
        }
    }
    let [own] = found[..] else { return None };
    Some(own)
}

/// Removes the head of the series from xᵏ Φₖ. Returns the order k′ and the sign of the remainder; `None` if terms of
/// the head are missing, or others are left.
fn after_head(function: Function, mut head: Vec<(u32, f64)>) -> Option<(u32, f64)> {
    let (mut k, mut sign) = (function.k, 1.0);
    while !head.is_empty() {
        let number = head.iter().filter(|(power, _)| *power == k).map(|(_, number)| number).sum::<f64>();
        let expected = -sign * constant_term(function.expansion, k);
        if (number - expected).abs() > SAME * expected.abs() || k > LARGEST_ORDER {
            return None;
        }
        head.retain(|(power, _)| *power != k);
        let (next, turned) = successor(function.expansion, k)?;
        (k, sign) = (next, sign * turned);
    }
    (k > function.k).then_some((k, sign))
}

/// Creates factor · xᵏ Φₖ(x).
fn built(g: &mut Graph, function: Function, factor: &Monomial) -> NodeId {
    let Function { expansion, k, x, .. } = function;
    let whole = match (expansion, k) {
        (Expansion::Exponential, 1) => expm1(g, x),
        (Expansion::Trigonometric, 2) => versine(g, x),
        (Expansion::Trigonometric, 3) => sine_remainder(g, x),
        (Expansion::Logarithm, 2) => {
            let opposite = log1pmx(g, x);
            g.neg(opposite)
        }
        _ => whole_remainder(g, expansion, k, x),
    };
    match factor.powers.is_empty() {
        true => {
            let number = g.constant(factor.coefficient);
            g.mul(number, whole)
        }
        false => {
            let factor = factor.build(g);
            g.mul(factor, whole)
        }
    }
}

/// Recognises a function with a zero at x = 0 over a power of x, and a quotient whose sides share a factor.
pub(in super::super) fn recognise_quotient(g: &mut Graph, above: NodeId, below: NodeId) -> Option<NodeId> {
    let mut functions = Vec::new();
    functions_of(g, above, &mut functions);
    functions.retain(|function| function.k > 0 && g.varies(function.x));
    if let Some((function, factor)) = functions.into_iter().find_map(|function| cancelled(g, above, below, function)) {
        let rest = remainder(g, function.expansion, function.k, function.x);
        let factor = factor.build(g);
        return Some(g.mul(factor, rest));
    }
    without_common_factor(g, above, below).or_else(|| term_by_term(g, above, below))
}

/// Divides each term of a sum that is a factor of `above`, if the divisor cancels in all of them and one is a function
/// with a zero.
fn term_by_term(g: &mut Graph, above: NodeId, below: NodeId) -> Option<NodeId> {
    let product = Monomial::of(g, above, &[]);
    let sum = product.sum(g, &[])?;
    let terms = leaves(g, vec![(sum, 1.0)])?;
    let mut functions = Vec::new();
    terms.iter().for_each(|&(term, _)| functions_of(g, term, &mut functions));
    if !functions.iter().any(|function| function.k > 0) {
        return None;
    }
    let rest = product.without_power(sum)?.build(g);
    let quotient = |(term, sign): (NodeId, f64)| {
        let above = g.mul(rest, term);
        let quotient = recognise_quotient(g, above, below)?;
        Some(if sign < 0.0 { g.neg(quotient) } else { quotient })
    };
    let quotients: Option<Vec<NodeId>> = terms.into_iter().map(quotient).collect();
    quotients.map(|quotients| g.sum(quotients))
}

/// Cancels a factor that vanishes on both sides at the same inputs. The quotient has the limit there, but its
/// derivatives would lose all digits.
fn without_common_factor(g: &mut Graph, above: NodeId, below: NodeId) -> Option<NodeId> {
    let [above, below] = [above, below].map(|side| Monomial::of(g, side, &[]));
    let is_shared = |node: &NodeId| {
        let powers = [&above, &below].map(|side| side.powers.get(node).copied().unwrap_or(0));
        g.varies(*node) && powers.into_iter().all(|power| power > 0)
    };
    above.powers.keys().any(is_shared).then(|| above.times(&below, -1).build(g))
}

/// Returns Φₖ and its factor in a quotient; `None` if nothing cancels.
fn cancelled(g: &Graph, above: NodeId, below: NodeId, function: Function) -> Option<(Function, Monomial)> {
    let lengths = lengths(g, function.x);
    let x = Monomial::of(g, function.x, &lengths);
    let divisor = Monomial::of(g, below, &lengths);
    let mut factor = Monomial::of(g, above, &lengths).without_power(function.node)?;
    factor = factor.times(&x, i32::try_from(function.power).ok()?);
    let shares = |(node, power): (&NodeId, &i32)| {
        let has = |product: &Monomial| product.powers.get(node).is_some_and(|other| other.signum() == power.signum());
        g.varies(*node) && has(&divisor) && has(&factor)
    };
    if !x.powers.iter().any(shares) {
        return None;
    }
    factor = factor.times(&divisor, -1);
    factor.coefficient *= function.sign;
    Some((function, factor))
}
