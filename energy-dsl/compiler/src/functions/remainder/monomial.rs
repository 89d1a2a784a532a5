//! Products of powers.

use std::collections::BTreeMap;

use crate::graph::{Graph, NodeId, Op, Primitive};

/// A number times powers of nodes.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Monomial {
    pub(super) coefficient: f64,
    /// Exponents of the factors; none is 0.
    pub(super) powers: BTreeMap<NodeId, i32>,
}

/// Factors that a search visits. Powers of powers have many more.
pub(super) const MOST_FACTORS: usize = 64;

impl Monomial {
    fn one() -> Self {
        Self { coefficient: 1.0, powers: BTreeMap::new() }
    }

    /// Splits a node into its factors. `lengths` are norms of vectors, whose squares are sums of squares.
    pub(super) fn of(g: &Graph, node: NodeId, lengths: &[NodeId]) -> Self {
        let mut monomial = Self::one();
        let (mut open, mut visited) = (vec![(node, 1)], 0);
        while let Some((node, power)) = open.pop() {
            visited += 1;
            if let Some((factor, length)) = squared_length(g, node, lengths) {
                monomial.coefficient *= factor.powi(power);
                monomial.raise(length, 2 * power);
                continue;
            }
            let is_power = g.rule(node).is_some_and(|rule| rule.primitive == Primitive::NormPower);
            let resolved = if is_power { g.resolve(node) } else { node };
            match g.op(resolved) {
                _ if visited > MOST_FACTORS => monomial.raise(node, power),
                Op::Constant(bits) => monomial.coefficient *= f64::from_bits(bits).powi(power),
                Op::Neg(x) => {
                    monomial.coefficient *= -1.0;
                    open.push((x, power));
                }
                Op::Mul(x, y) => open.extend([(x, power), (y, power)]),
                Op::Div(x, y) if !is_length(g, resolved, lengths) => open.extend([(x, power), (y, -power)]),
                _ => monomial.raise(length_of_value(g, node, lengths).unwrap_or(node), power),
            }
        }
        monomial
    }

    fn raise(&mut self, node: NodeId, power: i32) {
        let exponent = self.powers.entry(node).or_insert(0);
        *exponent += power;
        if *exponent == 0 {
            self.powers.remove(&node);
        }
    }

    /// Returns the monomial times a number.
    pub(super) fn scaled(mut self, number: f64) -> Self {
        self.coefficient *= number;
        self
    }

    /// Returns self · other^power.
    pub(super) fn times(&self, other: &Self, power: i32) -> Self {
        let mut product = self.clone();
        product.coefficient *= other.coefficient.powi(power);
        other.powers.iter().for_each(|(&node, &exponent)| product.raise(node, power * exponent));
        product
    }

    /// Returns the monomial without a factor; `None` unless it has the factor once.
    pub(super) fn without_power(mut self, node: NodeId) -> Option<Self> {
        (self.powers.remove(&node)? == 1).then_some(self)
    }

    /// Returns a sum among the factors.
    pub(super) fn sum(&self, g: &Graph, lengths: &[NodeId]) -> Option<NodeId> {
        let is_sum = |factor: &NodeId| matches!(g.op(*factor), Op::Add(..) | Op::Sub(..)) && !lengths.contains(factor);
        self.powers.keys().copied().find(is_sum)
    }

    /// Returns the power of another monomial that this is, up to a number, and the number; `None` if it is not one.
    pub(super) fn as_power_of(&self, other: &Self) -> Option<(u32, f64)> {
        let power = match self.powers.first_key_value() {
            None => 0,
            Some((node, exponent)) => {
                let of = other.powers.get(node)?;
                (exponent % of == 0).then_some(exponent / of)?
            }
        };
        let rest = self.times(other, -power);
        (power >= 0 && rest.powers.is_empty()).then_some((power as u32, rest.coefficient))
    }

    /// Creates the product.
    pub(super) fn build(&self, g: &mut Graph) -> NodeId {
        let mut product = |sign: i32| {
            let mut product = g.constant(1.0);
            for (&node, &exponent) in self.powers.iter().filter(|(_, exponent)| exponent.signum() == sign) {
                let exponent = g.constant(f64::from(exponent.abs()));
                let factor = g.pow(node, exponent);
                product = g.mul(product, factor);
            }
            product
        };
        let (above, below) = (product(1), product(-1));
        let coefficient = g.constant(self.coefficient);
        let above = g.mul(coefficient, above);
        g.div(above, below)
    }
}

/// Returns the norms among the factors of a node.
pub(super) fn lengths(g: &Graph, node: NodeId) -> Vec<NodeId> {
    let is_norm = |node: &NodeId| g.rule(*node).is_some_and(|rule| rule.primitive == Primitive::Norm);
    Monomial::of(g, node, &[]).powers.into_keys().filter(is_norm).collect()
}

/// Returns the norm whose value a node computes.
fn length_of_value(g: &Graph, node: NodeId, lengths: &[NodeId]) -> Option<NodeId> {
    lengths.iter().copied().find(|&length| g.resolve(length) == node)
}

fn is_length(g: &Graph, node: NodeId, lengths: &[NodeId]) -> bool {
    length_of_value(g, node, lengths).is_some()
}

/// Returns c and the length of a node that is c ‖d‖².
fn squared_length(g: &Graph, node: NodeId, lengths: &[NodeId]) -> Option<(f64, NodeId)> {
    lengths.iter().find_map(|&length| {
        let vector = g.rule(length)?.vector.as_ref()?;
        if let Some(rule) = g.rule(node) {
            // The primitive of d·d is half of it.
            let half = rule.primitive == Primitive::InnerProduct && rule.arguments == *vector;
            return half.then_some((0.5, length));
        }
        is_sum_of_squares(g, node, vector).then_some((1.0, length))
    })
}

fn is_sum_of_squares(g: &Graph, node: NodeId, vector: &[NodeId]) -> bool {
    let mut expected: Vec<NodeId> = vector.iter().map(|&x| g.magnitude(x).0).filter(|&x| !g.is(x, 0.0)).collect();
    let mut found = Vec::new();
    let mut open = vec![node];
    while let Some(node) = open.pop() {
        match g.op(node) {
            Op::Add(x, y) if found.len() + open.len() < vector.len() => open.extend([x, y]),
            Op::Mul(x, y) if x == y => found.push(x),
            _ => return false,
        }
    }
    expected.sort_unstable();
    found.sort_unstable();
    !found.is_empty() && found == expected
}
