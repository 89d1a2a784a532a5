//! Sums of unknowns whose weights cancel, such as p − (a + b + c)/3, are computed from differences of the unknowns.
//! Rounding errors are then relative to these differences, not to the distance from the origin.

use std::collections::BTreeMap;

use super::{Graph, Input, NodeId, Op};

/// A sum of unknowns and of other terms.
#[derive(Clone, Debug, Default)]
struct LinearSum {
    /// The weights of unknowns, by the numbers of these.
    unknowns: BTreeMap<u16, f64>,
    /// The weights of other terms.
    others: BTreeMap<NodeId, f64>,
}

/// Weights below this part of the others are rounding errors.
const NEGLIGIBLE: f64 = 2.0 * f64::EPSILON;
/// The most nodes of a sum.
const MOST: usize = 128;

/// Adds weighted terms to a sum.
fn add_to<T: Ord + Copy>(sum: &mut BTreeMap<T, f64>, factor: f64, terms: &BTreeMap<T, f64>) {
    for (&term, &weight) in terms {
        *sum.entry(term).or_insert(0.0) += factor * weight;
    }
    let least = NEGLIGIBLE * largest(sum).max(largest(terms));
    sum.retain(|_, weight| weight.abs() > least);
}

fn largest<T>(terms: &BTreeMap<T, f64>) -> f64 {
    terms.values().fold(0.0, |most, weight| most.max(weight.abs()))
}

impl LinearSum {
    fn plus(mut self, factor: f64, other: &Self) -> Self {
        add_to(&mut self.unknowns, factor, &other.unknowns);
        add_to(&mut self.others, factor, &other.others);
        self
    }

    fn times(&self, factor: f64) -> Self {
        Self::default().plus(factor, self)
    }

    /// Returns whether the weights of the unknowns add up to 0.
    fn cancels(&self) -> bool {
        let sizes: f64 = self.unknowns.values().map(|weight| weight.abs()).sum();
        self.unknowns.values().sum::<f64>().abs() <= NEGLIGIBLE * sizes
    }

    fn is_moderate(&self) -> bool {
        let mut weights = self.unknowns.values().chain(self.others.values());
        weights.all(|weight| (1e-100..1e100).contains(&weight.abs()))
    }

    /// Returns half of the unknowns, each with another one, if all have the same weight but for the sign.
    fn pairs(&self) -> Option<(f64, Vec<(u16, u16)>)> {
        let weight = largest(&self.unknowns);
        let of_sign = |sign: f64| self.unknowns.iter().filter(move |(_, other)| sign * **other > 0.0);
        let is_alike = |other: &f64| (other.abs() - weight).abs() <= NEGLIGIBLE * weight;
        let pairs = of_sign(1.0).zip(of_sign(-1.0)).map(|((&p, _), (&q, _))| (p, q)).collect();
        self.unknowns.values().all(is_alike).then_some((weight, pairs))
    }
}

impl Graph {
    /// Returns a + sign · b by differences of unknowns, if the weights of unknowns in it cancel, while those in a and b do
    /// not.
    pub(crate) fn by_differences(&mut self, a: NodeId, b: NodeId, sign: f64) -> Option<NodeId> {
        let is_unknown = |node| matches!(self.op(node), Op::Input(Input::Position(_)));
        if is_unknown(a) && is_unknown(b) {
            return None;
        }
        let mut left = MOST;
        let (first, second) = (self.linear_sum(a, &mut left)?, self.linear_sum(b, &mut left)?);
        let sum = first.clone().plus(sign, &second);
        if first.cancels() || !sum.cancels() || sum.unknowns.is_empty() || !sum.is_moderate() {
            return None;
        }
        if sum.others.is_empty()
            && let Some((weight, pairs)) = sum.pairs()
        {
            let differences = self.constant(0.0);
            let differences = pairs.into_iter().fold(differences, |differences, pair| {
                let [p, q] = <[u16; 2]>::from(pair).map(|unknown| self.input(Input::Position(unknown)));
                let difference = self.sub(p, q);
                self.add(differences, difference)
            });
            let parts = (1.0 / weight).round();
            // Parts of a whole are divided, which rounds once.
            if (parts * weight - 1.0).abs() <= NEGLIGIBLE {
                let parts = self.constant(parts);
                return Some(self.div(differences, parts));
            }
            let weight = self.constant(weight);
            return Some(self.mul(weight, differences));
        }
        let origin = self.origin_of(&sum, if second.unknowns.len() < first.unknowns.len() { &first } else { &second });
        let [a, b] = [a, b].map(|node| self.seen_from(node, origin));
        Some(if sign > 0.0 { self.add(a, b) } else { self.sub(a, b) })
    }

    /// Chooses the unknown from which differences are taken: that of most differences which are there already, or else
    /// the first one of a mean.
    fn origin_of(&self, sum: &LinearSum, mean: &LinearSum) -> u16 {
        let node = |unknown: u16| self.index.get(&Op::Input(Input::Position(unknown))).copied();
        let is_there = |p: u16, q: u16| {
            let (Some(p), Some(q)) = (node(p), node(q)) else { return false };
            self.index.contains_key(&Op::Sub(p, q)) || self.index.contains_key(&Op::Sub(q, p))
        };
        let known = |origin: u16| sum.unknowns.keys().filter(|&&other| is_there(origin, other)).count();
        let first = mean.unknowns.keys().next().or(sum.unknowns.keys().next()).copied();
        let rank = |&origin: &u16| (known(origin), Some(origin) == first, std::cmp::Reverse(origin));
        sum.unknowns.keys().copied().max_by_key(rank).expect("compiler bug: a sum without unknowns")
    }

    /// Returns a linear function with all unknowns replaced by their differences to one of them. Parts of it whose weights
    /// cancel stay.
    fn seen_from(&mut self, node: NodeId, origin: u16) -> NodeId {
        if self.linear_sum(node, &mut { MOST }).is_none_or(|sum| sum.cancels()) {
            return node;
        }
        match self.op(node) {
            Op::Input(Input::Position(unknown)) if unknown == origin => self.constant(0.0),
            Op::Input(_) => {
                let origin = self.input(Input::Position(origin));
                self.sub(node, origin)
            }
            op => {
                let seen: BTreeMap<NodeId, NodeId> = op.operands().map(|o| (o, self.seen_from(o, origin))).collect();
                self.rebuilt(op.with_operands(|operand| seen[&operand]))
            }
        }
    }

    /// Returns a node as a sum; one term, if it is no sum. `None` if more nodes would be visited than are left.
    fn linear_sum(&self, node: NodeId, left: &mut usize) -> Option<LinearSum> {
        *left = left.checked_sub(1)?;
        self.budget().spend(1, 0);
        let constant = |node| self.as_constant(node);
        let sum = match self.op(node) {
            Op::Input(Input::Position(unknown)) => {
                LinearSum { unknowns: BTreeMap::from([(unknown, 1.0)]), ..LinearSum::default() }
            }
            Op::Neg(a) => self.linear_sum(a, left)?.times(-1.0),
            Op::Add(a, b) => self.linear_sum(a, left)?.plus(1.0, &self.linear_sum(b, left)?),
            Op::Sub(a, b) => self.linear_sum(a, left)?.plus(-1.0, &self.linear_sum(b, left)?),
            Op::Mul(a, b) if let Some(factor) = constant(a) => self.linear_sum(b, left)?.times(factor),
            Op::Mul(a, b) if let Some(factor) = constant(b) => self.linear_sum(a, left)?.times(factor),
            Op::Div(a, b) if let Some(divisor) = constant(b) => self.linear_sum(a, left)?.times(1.0 / divisor),
            _ => LinearSum { others: BTreeMap::from([(node, 1.0)]), ..LinearSum::default() },
        };
        Some(sum)
    }
}
