//! Finds results that may overflow although the values of a routine do not.
//!
//! Guards bound lengths and their reciprocals. From these, bounds on the exponents of all operations follow, if one more
//! guard keeps parameters and other lengths far from overflow. Results within the range of the type are then finite. The
//! others are tested when they are known.

use std::collections::{BTreeMap, BTreeSet};

use crate::graph::{Graph, Input, NodeId, Op, reachable};

/// Guarded parameters, and their exponent: in double and in single precision.
const LARGEST_PARAMETER: (f64, f64) = (1e120, 1e15);
const PARAMETER: u32 = 55;
/// Guarded lengths: 2⁸⁰ and 2¹². `IsModerate` has the same bounds.
const LARGEST_LENGTH: (f64, f64) = ((1_u128 << 80) as f64, 4096.0);
/// The exponent of a length. Exponents are those of single precision; in double precision, they are 80/12 of that.
const LENGTH: u32 = 12;
/// Exponents up to this one leave room for sums of a hundred terms.
const LARGEST: u32 = 120;
/// The exponent of a number without a bound.
const UNKNOWN: u32 = 1 << 16;
/// The exponent of e⁸⁰, which guards allow.
const EXPONENTIAL: u32 = 116;

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
            let size = analysis.sizes[&g.resolve(derivative)];
            if !size.is_product && size.exponent < UNKNOWN {
                continue;
            }
            if guards.is_empty() || size.exponent > LARGEST {
                tests.results.push(derivative);
                continue;
            }
            let (parameters, lengths) = analysis.inputs(size.inputs);
            tests.parameters.extend(parameters);
            if !lengths.is_empty() {
                tests.lengths.extend(lengths);
                others.push(derivative);
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

/// A bound on the size of an expression.
#[derive(Clone, Copy, Default)]
struct Size {
    /// Its size is at most 2^exponent.
    exponent: u32,
    /// The unbounded inputs that it depends on, as bits.
    inputs: u128,
    /// Whether it has a product that may overflow where its factors do not.
    is_product: bool,
}

impl Size {
    fn of(exponent: u32) -> Self {
        Self { exponent, ..Self::default() }
    }

    fn plus(self, other: Self) -> Self {
        Self {
            exponent: self.exponent.max(other.exponent),
            inputs: self.inputs | other.inputs,
            is_product: self.is_product || other.is_product,
        }
    }

    fn times(self, other: Self) -> Self {
        Self {
            exponent: self.exponent.saturating_add(other.exponent).min(UNKNOWN),
            is_product: self.is_product || other.is_product || self.exponent > 0 && other.exponent > 0,
            ..self.plus(other)
        }
    }

    fn root(self) -> Self {
        Self { exponent: self.exponent.div_ceil(2), ..self }
    }
}

/// The sizes of all operations of a routine.
#[derive(Default)]
struct Analysis {
    /// Inputs without guards, in the order of their bits, and whether they are parameters.
    unbounded: Vec<(NodeId, bool)>,
    /// Exponents of numbers that guards bound, and of their reciprocals.
    moderate: BTreeMap<NodeId, u32>,
    /// Exponents of numbers that guards bound from above only.
    bounded: BTreeMap<NodeId, u32>,
    sizes: BTreeMap<NodeId, Size>,
}

impl Analysis {
    fn new(g: &Graph, guards: &[NodeId], results: &[NodeId]) -> Self {
        let mut analysis = Self::default();
        analysis.read(g, guards);
        for node in reachable(g, results) {
            let known = analysis.moderate.get(&node).or(analysis.bounded.get(&node)).copied();
            let size = known.map_or_else(|| analysis.of(g, node), Size::of);
            analysis.sizes.insert(node, size);
        }
        analysis
    }

    /// Reads the bounds that guards give: of moderate numbers, and of the terms of sums of squares.
    fn read(&mut self, g: &Graph, guards: &[NodeId]) {
        let (mut masks, mut sums) = (guards.to_vec(), Vec::new());
        while let Some(mask) = masks.pop() {
            match g.op(mask) {
                Op::And(a, b) => masks.extend([a, b]),
                Op::IsModerate(a, degree) => {
                    let (a, exponent) = (g.resolve(a), LENGTH * u32::from(degree));
                    sums.push((a, exponent));
                    let number = if let Op::Abs(number) = g.op(a) { number } else { a };
                    self.moderate.extend([a, g.resolve(number)].map(|node| (node, exponent)));
                }
                _ => {}
            }
        }
        while let Some((sum, exponent)) = sums.pop() {
            self.bounded.insert(sum, exponent);
            match g.op(sum) {
                Op::Add(a, b) => {
                    let terms = [a, b].map(|term| g.resolve(term));
                    if terms.iter().all(|&term| is_square(g, term)) {
                        sums.extend(terms.map(|term| (term, exponent)));
                    }
                }
                Op::Mul(a, b) if a == b => _ = self.bounded.insert(g.resolve(a), exponent.div_ceil(2)),
                _ => {}
            }
        }
    }

    /// Returns the parameters and the lengths among inputs.
    fn inputs(&self, inputs: u128) -> (Vec<NodeId>, Vec<NodeId>) {
        let chosen =
            self.unbounded.iter().enumerate().filter(|(bit, _)| inputs >> bit & 1 == 1).map(|(_, input)| *input);
        let (parameters, lengths): (Vec<_>, Vec<_>) = chosen.partition(|(_, is_parameter)| *is_parameter);
        let nodes = |list: Vec<(NodeId, bool)>| list.into_iter().map(|(node, _)| node).collect();
        (nodes(parameters), nodes(lengths))
    }

    fn of(&mut self, g: &Graph, node: NodeId) -> Size {
        let size = |operand: NodeId| self.sizes[&g.resolve(operand)];
        match g.fused(node) {
            Op::Input(Input::Position(_) | Input::Velocity(_)) => self.input(node, false),
            Op::Sub(a, b) if is_moving_input(g, a) && is_moving_input(g, b) => self.input(node, false),
            Op::Input(_) => self.input(node, true),
            Op::Constant(bits) => Size::of(exponent_of(f64::from_bits(bits))),
            Op::Neg(a) | Op::Abs(a) => size(a),
            Op::Add(a, b) | Op::Sub(a, b) | Op::Min(a, b) | Op::Max(a, b) | Op::Select(_, a, b) => {
                size(a).plus(size(b))
            }
            Op::Mul(a, b) => size(a).times(size(b)),
            Op::FusedMulSub(a, b, c)
            | Op::MulAdd(a, b, c)
            | Op::MulSub(a, b, c)
            | Op::NegMulAdd(a, b, c)
            | Op::NegMulSub(a, b, c) => size(a).times(size(b)).plus(size(c)),
            Op::Div(a, b) => size(a).times(Size::of(self.reciprocal(g, b))),
            Op::Sqrt(a) => size(a).root(),
            Op::Exp(_) | Op::Pow(..) => Size::of(EXPONENTIAL),
            // Rounding errors are smaller than the results that they belong to. Sines, angles and logarithms are small.
            _ => Size::default(),
        }
    }

    fn input(&mut self, node: NodeId, is_parameter: bool) -> Size {
        let bit = self.unbounded.len();
        self.unbounded.push((node, is_parameter));
        match bit {
            0..128 => Size { inputs: 1 << bit, ..Size::of(if is_parameter { PARAMETER } else { LENGTH }) },
            _ => Size::of(UNKNOWN),
        }
    }

    /// Returns the exponent of 1/b.
    fn reciprocal(&self, g: &Graph, b: NodeId) -> u32 {
        let b = g.resolve(b);
        if let Some(&exponent) = self.moderate.get(&b) {
            return exponent;
        }
        match g.op(b) {
            Op::Constant(bits) => exponent_of(1.0 / f64::from_bits(bits)),
            Op::Neg(a) | Op::Abs(a) => self.reciprocal(g, a),
            Op::Sqrt(a) => self.reciprocal(g, a).div_ceil(2),
            Op::Mul(x, y) => self.reciprocal(g, x).saturating_add(self.reciprocal(g, y)).min(UNKNOWN),
            Op::Div(x, y) => {
                let size = |operand: NodeId| self.sizes.get(&g.resolve(operand)).map_or(UNKNOWN, |size| size.exponent);
                self.reciprocal(g, x).saturating_add(size(y)).min(UNKNOWN)
            }
            Op::Exp(_) => EXPONENTIAL,
            _ => UNKNOWN,
        }
    }
}

/// Returns the exponent of a constant; 0 for those up to 1.
fn exponent_of(constant: f64) -> u32 {
    let exponent = constant.abs().log2().ceil();
    if exponent.is_finite() { exponent.max(0.0) as u32 } else { u32::from(constant != 0.0) * UNKNOWN }
}

fn is_moving_input(g: &Graph, node: NodeId) -> bool {
    matches!(g.op(g.resolve(node)), Op::Input(Input::Position(_) | Input::Velocity(_)))
}

/// Returns whether a node is a square or a sum of squares.
fn is_square(g: &Graph, node: NodeId) -> bool {
    match g.op(node) {
        Op::Mul(a, b) => a == b,
        Op::Add(a, b) => [a, b].into_iter().all(|part| is_square(g, g.resolve(part))),
        _ => false,
    }
}
