//! Finds results that may overflow although the values of a routine do not.
//!
//! Guards bound some lengths and their reciprocals, so that products of a few are numbers. All other inputs are
//! unbounded. A derivative with the square of an unbounded parameter, such as k² of the second derivative of tanh(k x),
//! is tested when it is known. Products of different parameters, such as k L, and of lengths are numbers if these are
//! far from overflow: that takes one more guard.

use std::collections::{BTreeMap, BTreeSet};

use crate::graph::{Graph, Input, NodeId, Op, reachable};

/// Parameters whose products with each other and with bounded numbers are numbers: in double and in single precision.
const LARGEST_PARAMETER: (f64, f64) = (1e120, 1e15);
/// Lengths on the ordinary path: 2⁸⁰ and 2¹².
const LARGEST_LENGTH: (f64, f64) = ((1_u128 << 80) as f64, 4096.0);
/// A larger constant counts as unbounded.
const LARGEST_CONSTANT: f64 = 1e15;

/// Tests of the ordinary path of a routine.
#[derive(Default)]
pub(super) struct Tests {
    /// Results that must be finite.
    pub(super) results: Vec<NodeId>,
    /// Parameters that must be far from overflow.
    parameters: BTreeSet<NodeId>,
    /// Lengths that must be far from overflow.
    lengths: BTreeSet<NodeId>,
}

impl Tests {
    /// Looks at derivatives on the ordinary path, whose guards hold. Without guards there is no other path for large
    /// inputs, so that results are tested instead. So they are if that takes fewer operations.
    pub(super) fn of(g: &Graph, guards: &[NodeId], derivatives: &[NodeId]) -> Self {
        let analysis = Analysis::new(g, guards, derivatives);
        let (mut tests, mut others) = (Self::default(), Vec::new());
        for &derivative in derivatives {
            match analysis.products(g.resolve(derivative)) {
                Products::Bounded => {}
                Products::Of { parameters, lengths } if !guards.is_empty() => {
                    tests.parameters.extend(parameters);
                    if !lengths.is_empty() {
                        tests.lengths.extend(lengths);
                        others.push(derivative);
                    }
                }
                _ => tests.results.push(derivative),
            }
        }
        // A square and its sum are two operations.
        if others.len() < 2 * tests.lengths.len() {
            tests.lengths.clear();
            tests.results.extend(others);
        }
        tests
    }

    /// Creates the masks where inputs are far from overflow.
    pub(super) fn guards(&self, g: &mut Graph) -> Vec<NodeId> {
        let mut guards = Vec::new();
        for (inputs, (double, single)) in [(&self.parameters, LARGEST_PARAMETER), (&self.lengths, LARGEST_LENGTH)] {
            if !inputs.is_empty() {
                let square = g.sum_of_squares(&inputs.iter().copied().collect::<Vec<_>>());
                let largest = g.by_precision(double * double, single * single);
                guards.push(g.less(square, largest));
            }
        }
        guards
    }
}

/// The products of unbounded numbers in a result.
enum Products {
    Bounded,
    Of { parameters: Vec<NodeId>, lengths: Vec<NodeId> },
    Unbounded,
}

/// The bit of numbers that have no bit of their own.
const TOO_MANY: u128 = 1 << 127;

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
#[derive(Default)]
struct Analysis {
    /// The unbounded numbers, in the order of their bits.
    unbounded: Vec<NodeId>,
    /// Those that are parameters, and lengths.
    parameters: u128,
    lengths: u128,
    degrees: BTreeMap<NodeId, Degrees>,
}

impl Analysis {
    fn new(g: &Graph, guards: &[NodeId], results: &[NodeId]) -> Self {
        let bounded = bounded(g, guards);
        let mut analysis = Self::default();
        for node in reachable(g, results) {
            let degrees = if bounded.contains(&node) { Degrees::default() } else { analysis.of(g, node) };
            analysis.degrees.insert(node, degrees);
        }
        analysis
    }

    fn products(&self, result: NodeId) -> Products {
        let Some(&Degrees { squared, mixed, .. }) = self.degrees.get(&result) else { return Products::Unbounded };
        let products = squared | mixed;
        if squared & !self.lengths != 0 || products & !(self.lengths | self.parameters) != 0 {
            return Products::Unbounded;
        }
        if products == 0 {
            return Products::Bounded;
        }
        let among = |set: u128| {
            let numbers = self.unbounded.iter().enumerate();
            numbers.filter(|(bit, _)| (products & set) >> bit & 1 == 1).map(|(_, &number)| number).collect()
        };
        Products::Of { parameters: among(self.parameters), lengths: among(self.lengths) }
    }

    fn of(&mut self, g: &Graph, node: NodeId) -> Degrees {
        let d = |operand: NodeId| self.degrees[&g.resolve(operand)];
        match g.fused(node) {
            Op::Input(Input::Position(_) | Input::Velocity(_)) => self.length(node),
            Op::Sub(a, b) if is_moving_input(g, a) && is_moving_input(g, b) => self.length(node),
            Op::Input(_) => self.parameter(node),
            Op::Constant(bits) if !f64::from_bits(bits).is_finite() => {
                Degrees { squared: TOO_MANY, ..Degrees::default() }
            }
            Op::Constant(bits) if f64::from_bits(bits).abs() > LARGEST_CONSTANT => self.unbounded_number(node),
            Op::Neg(a) | Op::Abs(a) | Op::Sqrt(a) => d(a),
            Op::Add(a, b) | Op::Sub(a, b) | Op::Min(a, b) | Op::Max(a, b) | Op::Select(_, a, b) => d(a).plus(d(b)),
            Op::Mul(a, b) => d(a).times(d(b)),
            Op::FusedMulSub(a, b, c)
            | Op::MulAdd(a, b, c)
            | Op::MulSub(a, b, c)
            | Op::NegMulAdd(a, b, c)
            | Op::NegMulSub(a, b, c) => d(a).times(d(b)).plus(d(c)),
            // Guards bound the reciprocals of divisors.
            Op::Div(a, _) => d(a),
            // Rounding errors are smaller than the results that they belong to. Sines and angles are bounded; guards
            // bound exponentials, logarithms and powers.
            _ => Degrees::default(),
        }
    }

    fn length(&mut self, node: NodeId) -> Degrees {
        let degrees = self.unbounded_number(node);
        self.lengths |= degrees.linear;
        degrees
    }

    fn parameter(&mut self, node: NodeId) -> Degrees {
        let degrees = self.unbounded_number(node);
        self.parameters |= degrees.linear;
        degrees
    }

    /// Returns the degrees of one more unbounded number. If there are too many, it counts as a square.
    fn unbounded_number(&mut self, node: NodeId) -> Degrees {
        let bit = self.unbounded.len();
        if bit >= 127 {
            return Degrees { squared: TOO_MANY, ..Degrees::default() };
        }
        self.unbounded.push(node);
        Degrees { linear: 1 << bit, ..Degrees::default() }
    }
}

fn is_moving_input(g: &Graph, node: NodeId) -> bool {
    matches!(g.op(g.resolve(node)), Op::Input(Input::Position(_) | Input::Velocity(_)))
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
