//! Finds results that may overflow although the values of a routine do not: a final test covers them.
//!
//! Guards bound lengths and their reciprocals, so that products of some of them are numbers. Other inputs are unbounded.
//! A derivative with a product of two unbounded numbers, such as k² of the second derivative of tanh(k x), is tested. One
//! with products of different parameters, such as k L, is a number if all of these are far from overflow.

use std::collections::{BTreeMap, BTreeSet};

use crate::graph::{Graph, Input, NodeId, Op, reachable};

/// Parameters whose products with each other and with bounded numbers are numbers: in double and in single precision.
const LARGEST_PARAMETER: (f64, f64) = (1e120, 1e15);
/// A larger constant counts as unbounded.
const LARGEST_CONSTANT: f64 = 1e15;

/// What must be tested after a routine has run.
pub(super) struct Tests {
    /// Results that must be finite.
    pub(super) results: Vec<NodeId>,
    /// Parameters that must be far from overflow.
    parameters: BTreeSet<NodeId>,
}

impl Tests {
    /// Looks at derivatives on the ordinary path, whose guards hold. Without guards there is no other path for large
    /// parameters, so that results are tested instead.
    pub(super) fn of(g: &Graph, guards: &[NodeId], derivatives: &[NodeId]) -> Self {
        let analysis = Analysis::new(g, guards, derivatives);
        let mut tests = Self { results: Vec::new(), parameters: BTreeSet::new() };
        for &derivative in derivatives {
            match analysis.products(g.resolve(derivative)) {
                Products::Bounded => {}
                Products::OfParameters(parameters) if !guards.is_empty() => tests.parameters.extend(parameters),
                _ => tests.results.push(derivative),
            }
        }
        tests
    }

    /// Creates the mask where all parameters are far from overflow; `None` if none needs to be.
    pub(super) fn parameters(&self, g: &mut Graph) -> Option<NodeId> {
        let parameters: Vec<NodeId> = self.parameters.iter().copied().collect();
        if parameters.is_empty() {
            return None;
        }
        let square = g.sum_of_squares(&parameters);
        let [double, single] = [LARGEST_PARAMETER.0, LARGEST_PARAMETER.1].map(|largest| largest * largest);
        let largest = g.by_precision(double, single);
        Some(g.less(square, largest))
    }
}

/// The products of unbounded numbers in a result.
enum Products {
    Bounded,
    OfParameters(Vec<NodeId>),
    Unbounded,
}

/// Sets of unbounded numbers, as bits.
#[derive(Clone, Copy, Default)]
struct Degrees {
    /// Numbers with a degree of at least one.
    linear: u128,
    /// Numbers that are multiplied with themselves.
    squared: u128,
    /// Numbers that are multiplied with other ones.
    mixed: u128,
}

impl Degrees {
    fn plus(self, other: Self) -> Self {
        Self {
            linear: self.linear | other.linear,
            squared: self.squared | other.squared,
            mixed: self.mixed | other.mixed,
        }
    }

    fn times(self, other: Self) -> Self {
        let mut product = self.plus(other);
        product.squared |= self.linear & other.linear;
        if self.linear != 0 && other.linear != 0 {
            product.mixed |= self.linear | other.linear;
        }
        product
    }
}

/// The degrees of all operations of a routine.
struct Analysis {
    /// The unbounded numbers, in the order of their bits.
    unbounded: Vec<NodeId>,
    /// Those that are parameters.
    parameters: u128,
    degrees: BTreeMap<NodeId, Degrees>,
}

impl Analysis {
    fn new(g: &Graph, guards: &[NodeId], results: &[NodeId]) -> Self {
        let bounded = bounded(g, guards);
        let mut analysis = Self { unbounded: Vec::new(), parameters: 0, degrees: BTreeMap::new() };
        for node in reachable(g, results) {
            let degrees = if bounded.contains(&node) { Degrees::default() } else { analysis.of(g, node) };
            analysis.degrees.insert(node, degrees);
        }
        analysis
    }

    fn products(&self, result: NodeId) -> Products {
        let Some(&Degrees { squared, mixed, .. }) = self.degrees.get(&result) else { return Products::Unbounded };
        match mixed {
            _ if squared != 0 || mixed & !self.parameters != 0 => Products::Unbounded,
            0 => Products::Bounded,
            _ => {
                let is_mixed = |(bit, _): &(usize, &NodeId)| mixed >> bit & 1 == 1;
                Products::OfParameters(self.unbounded.iter().enumerate().filter(is_mixed).map(|(_, &n)| n).collect())
            }
        }
    }

    fn of(&mut self, g: &Graph, node: NodeId) -> Degrees {
        let d = |operand: NodeId| self.degrees[&g.resolve(operand)];
        match g.fused(node) {
            Op::Input(input) => {
                self.unbounded_number(node, matches!(input, Input::Parameter(_) | Input::Precomputed(_)))
            }
            Op::Constant(bits) if !f64::from_bits(bits).is_finite() => Degrees { squared: 1, ..Degrees::default() },
            Op::Constant(bits) if f64::from_bits(bits).abs() > LARGEST_CONSTANT => self.unbounded_number(node, false),
            Op::Neg(a) | Op::Abs(a) | Op::Sqrt(a) => d(a),
            Op::Add(a, b)
            | Op::Sub(a, b)
            | Op::Min(a, b)
            | Op::Max(a, b)
            | Op::SumError(a, b)
            | Op::DifferenceError(a, b)
            | Op::Select(_, a, b) => d(a).plus(d(b)),
            Op::Mul(a, b) | Op::ProductError(a, b) => d(a).times(d(b)),
            Op::FusedMulSub(a, b, c)
            | Op::MulAdd(a, b, c)
            | Op::MulSub(a, b, c)
            | Op::NegMulAdd(a, b, c)
            | Op::NegMulSub(a, b, c) => d(a).times(d(b)).plus(d(c)),
            Op::RootError(a, _) => d(a),
            // Guards bound the reciprocals of divisors.
            Op::Div(a, _) => d(a),
            // Sines and angles are bounded; guards bound exponentials, logarithms and powers.
            _ => Degrees::default(),
        }
    }

    /// Returns the degrees of one more unbounded number. If there are too many, it counts as a square.
    fn unbounded_number(&mut self, node: NodeId, is_parameter: bool) -> Degrees {
        let bit = self.unbounded.len();
        if bit >= 128 {
            return Degrees { linear: 0, squared: 1, mixed: 0 };
        }
        self.unbounded.push(node);
        if is_parameter {
            self.parameters |= 1 << bit;
        }
        Degrees { linear: 1 << bit, squared: 0, mixed: 0 }
    }
}

/// Returns the numbers that guards bound: moderate ones, and the components of vectors whose squares are.
fn bounded(g: &Graph, guards: &[NodeId]) -> BTreeSet<NodeId> {
    let mut bounded = BTreeSet::new();
    let mut sums = Vec::new();
    let mut masks = guards.to_vec();
    while let Some(mask) = masks.pop() {
        match g.op(mask) {
            Op::And(a, b) => masks.extend([a, b]),
            Op::IsModerate(a, _) => sums.push(g.resolve(a)),
            _ => {}
        }
    }
    while let Some(sum) = sums.pop() {
        bounded.insert(sum);
        match g.op(sum) {
            Op::Add(a, b) => {
                sums.extend([a, b].map(|part| g.resolve(part)).into_iter().filter(|&part| is_square(g, part)))
            }
            Op::Mul(a, b) if a == b => _ = bounded.insert(g.resolve(a)),
            _ => {}
        }
    }
    bounded
}

/// Returns whether a node is a square or a sum of squares.
fn is_square(g: &Graph, node: NodeId) -> bool {
    match g.op(node) {
        Op::Mul(a, b) => a == b,
        Op::Add(a, b) => [a, b].into_iter().all(|part| is_square(g, g.resolve(part))),
        _ => false,
    }
}
