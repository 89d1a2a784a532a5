//! Recognises c − c e⁻ˣ q(x), where the polynomial q begins as the series of eˣ: 1 + x + x²/2 + … + xᵏ⁻¹/(k − 1)!.
//!
//! It is c xᵏ γₖ(x) − c e⁻ˣ r(x), where r is the rest of q. As written, it loses the digits of 1/xᵏ.

use super::super::exponential::expm1;
use super::monomial::{Monomial, lengths};
use super::recognise::{LARGEST_ORDER, SAME, factors, leaves};
use super::series::{constant_term, whole_remainder};
use crate::graph::{Expansion, Graph, NodeId, Op, Primitive};

/// Recognises a sum of a constant and a damped polynomial.
pub(in super::super) fn recognise_damped_sum(g: &mut Graph, a: NodeId, b: NodeId) -> Option<NodeId> {
    recognise(g, vec![(a, 1.0), (b, 1.0)])
}

/// Recognises a difference of a constant and a damped polynomial.
pub(in super::super) fn recognise_damped_difference(g: &mut Graph, a: NodeId, b: NodeId) -> Option<NodeId> {
    recognise(g, vec![(a, 1.0), (b, -1.0)])
}

fn recognise(g: &mut Graph, sum: Vec<(NodeId, f64)>) -> Option<NodeId> {
    let terms = leaves(g, sum)?;
    let exponents = terms.iter().flat_map(|&(term, _)| factors(g, term));
    let exponents: Vec<NodeId> = exponents.filter_map(|factor| exponent(g, factor)).collect();
    let (factor, damped) = exponents.into_iter().find_map(|exponent| Damped::of(g, &terms, exponent))?;
    let whole = damped.build(g);
    let factor = factor.build(g);
    Some(g.mul(factor, whole))
}

/// Returns the exponent of an exponential that varies.
fn exponent(g: &Graph, node: NodeId) -> Option<NodeId> {
    match g.op(node) {
        Op::Exp(x) if g.varies(x) => Some(x),
        _ => None,
    }
}

/// Returns k if a node is 1 − e⁻ˣ Σ xʲ/j! with k terms; `opposite` is −x.
fn order(g: &Graph, node: NodeId, x: NodeId, opposite: NodeId) -> Option<(u32, f64)> {
    let rule = g.rule(node)?;
    let argument = *rule.arguments.first()?;
    match rule.primitive {
        Primitive::Expm1 if argument == opposite => Some((1, -1.0)),
        Primitive::Remainder(Expansion::IncompleteGamma, k, power) if k == power && argument == x => {
            Some((k.into(), 1.0))
        }
        _ => None,
    }
}

/// 1 − e⁻ˣ q(x).
struct Damped {
    x: NodeId,
    exponential: NodeId,
    /// Terms of q that the series of eˣ begins with.
    order: u32,
    /// Powers and coefficients of the other terms of q.
    rest: Vec<(u32, f64)>,
}

impl Damped {
    /// Returns c and 1 − e⁻ˣ q of the sum c − c e⁻ˣ q; `None` if it is another one, or if q is a number.
    fn of(g: &mut Graph, terms: &[(NodeId, f64)], opposite: NodeId) -> Option<(Monomial, Self)> {
        let (x, exponential) = (g.neg(opposite), g.exp(opposite));
        let g: &Graph = g;
        let lengths = lengths(g, x);
        let signed = |node: NodeId, sign: f64| Monomial::of(g, node, &lengths).scaled(sign);
        let variable = signed(x, 1.0);
        let (mut constants, mut damped) = (Vec::new(), Vec::new());
        for &(node, sign) in terms {
            let own = factors(g, node);
            let known = own.iter().find_map(|&factor| Some((factor, order(g, factor, x, opposite)?)));
            if own.contains(&exponential) {
                damped.extend(expanded(g, signed(node, sign).without_power(exponential)?, &lengths)?);
            } else if let Some((factor, (k, number))) = known {
                let constant = signed(node, sign * number).without_power(factor)?;
                let term = |j: u32| {
                    let power = constant.times(&variable, i32::try_from(j).ok()?);
                    Some(power.scaled(-constant_term(Expansion::Exponential, j)))
                };
                damped.extend((0..k).map(term).collect::<Option<Vec<_>>>()?);
                constants.push(constant);
            } else {
                constants.push(signed(node, sign));
            }
        }
        let constant = total(constants)?;
        let mut coefficients: Vec<(u32, f64)> = Vec::new();
        for term in damped {
            let (power, number) = term.times(&constant, -1).as_power_of(&variable)?;
            match coefficients.iter_mut().find(|(other, _)| *other == power) {
                Some((_, sum)) => *sum -= number,
                None => coefficients.push((power, -number)),
            }
        }
        let (order, rest) = without_head(coefficients);
        (order > 0 && (order > 1 || !rest.is_empty())).then_some((constant, Self { x, exponential, order, rest }))
    }

    fn build(self, g: &mut Graph) -> NodeId {
        let Self { x, exponential, order, rest } = self;
        let whole = match order {
            1 => {
                let opposite = g.neg(x);
                let less = expm1(g, opposite);
                g.neg(less)
            }
            _ => whole_remainder(g, Expansion::IncompleteGamma, order, x),
        };
        // Term by term: a divisor may cancel a power of x in each.
        rest.into_iter().fold(whole, |sum, (power, coefficient)| {
            let (power, coefficient) = (g.constant(f64::from(power)), g.constant(coefficient));
            let power = g.pow(x, power);
            let factor = g.mul(coefficient, power);
            let term = g.mul(factor, exponential);
            g.plain_difference(sum, term)
        })
    }
}

/// Multiplies out a sum among the factors of a product.
fn expanded(g: &Graph, product: Monomial, lengths: &[NodeId]) -> Option<Vec<Monomial>> {
    let Some(sum) = product.sum(g, lengths) else { return Some(vec![product]) };
    let rest = product.without_power(sum)?;
    let term = |(node, sign): (NodeId, f64)| rest.times(&Monomial::of(g, node, lengths).scaled(sign), 1);
    Some(leaves(g, vec![(sum, 1.0)])?.into_iter().map(term).collect())
}

/// Adds products of the same powers; `None` if there are others, or if the sum is 0.
fn total(products: Vec<Monomial>) -> Option<Monomial> {
    let mut total = products.first()?.clone();
    for product in &products[1..] {
        if product.powers != total.powers {
            return None;
        }
        total.coefficient += product.coefficient;
    }
    (total.coefficient != 0.0).then_some(total)
}

/// Splits a polynomial into the first terms of the series of eˣ, of which it returns the number, and the rest.
fn without_head(mut coefficients: Vec<(u32, f64)>) -> (u32, Vec<(u32, f64)>) {
    let mut order = 0;
    let is_next = |&(power, coefficient): &(u32, f64), order: u32| {
        let expected = constant_term(Expansion::Exponential, order);
        power == order && (coefficient - expected).abs() <= SAME * expected
    };
    while order <= LARGEST_ORDER
        && let Some(next) = coefficients.iter().position(|term| is_next(term, order))
    {
        coefficients.swap_remove(next);
        order += 1;
    }
    coefficients.sort_by_key(|(power, _)| *power);
    (order, coefficients)
}
