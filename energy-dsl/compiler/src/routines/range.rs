//! Finds results that may overflow although the values of a routine do not.
//!
//! Guards bound lengths, and other operands with their reciprocals. From these, bounds on the exponents of all
//! operations follow, if one more guard keeps parameters and other lengths far from overflow. Results within the range
//! of the type are then finite. The others are tested when they are known.
//!
//! Primitives divide lengths by lengths: a direction d/‖d‖ has size 1, a curvature ∂n/∂x has that of 1/‖d‖. So lengths
//! count by their degree, as if those of one element were of one size, and their powers cancel. Powers of lengths that
//! are divided by, such as the area of a triangle, are guarded, too.

use std::collections::{BTreeMap, BTreeSet};

use crate::graph::{Graph, Input, NodeId, Op, reachable};

/// Exponents in a precision.
#[derive(Clone, Copy)]
struct Range {
    /// The largest exponent of a result. It leaves room for sums of a hundred terms.
    largest: u32,
    /// The exponent of guarded lengths. `IsModerate` has the same bound.
    length: u32,
    /// The exponent of guarded parameters.
    parameter: u32,
}

const DOUBLE: Range = Range { largest: 1016, length: 80, parameter: 200 };
/// With a narrower guard on parameters, larger products of them are bounded.
const NARROW: Range = Range { parameter: 64, ..DOUBLE };
const SINGLE: Range = Range { largest: 120, length: 12, parameter: 46 };
/// The exponent of a number without a bound.
const UNKNOWN: u32 = 1 << 16;
/// The exponent of e⁸⁰, which guards allow.
const EXPONENTIAL: u32 = 116;
/// The most inputs whose guards are known.
const BITS: usize = 128;
/// The degree of guards on operands that are not lengths.
const OPERAND: u8 = super::hazards::DEGREE;

/// Tests of the ordinary path of a routine.
pub(super) struct Tests {
    /// The ranges of inputs in double and in single precision.
    ranges: [Range; 2],
    /// Results that must be finite.
    results: Vec<NodeId>,
    /// Results that must be finite in single precision. In double precision, they are.
    single: Vec<NodeId>,
    /// Parameters that must be far from overflow.
    parameters: BTreeSet<NodeId>,
    /// Lengths that must be far from overflow.
    lengths: BTreeSet<NodeId>,
    /// Divisors that must be of moderate size, and their degrees.
    divisors: BTreeMap<NodeId, u8>,
}

impl Tests {
    /// Looks at results on the ordinary path, whose guards hold.
    pub(super) fn of(g: &Graph, guards: &[NodeId], values: &[NodeId], derivatives: &[NodeId]) -> Self {
        let candidates = [DOUBLE, NARROW].map(|double| Self::within(g, [double, SINGLE], guards, values, derivatives));
        candidates.into_iter().min_by_key(Self::operations).expect("two candidates")
    }

    fn within(g: &Graph, ranges: [Range; 2], guards: &[NodeId], values: &[NodeId], derivatives: &[NodeId]) -> Self {
        let all = [values, derivatives].concat();
        let analyses = ranges.map(|range| Analysis::new(g, range, guards, &all));
        let mut tests = Self::none(ranges).of_derivatives(g, derivatives, &analyses);
        let may_overflow = |derivative: &&NodeId| analyses[0].of_result(g, **derivative).may_overflow();
        let products: Vec<NodeId> = derivatives.iter().filter(may_overflow).copied().collect();
        // A polynomial has no other path than the ordinary one, and needs none if its results are tested.
        let most = if guards.is_empty() { 3 * products.len() / 4 } else { products.len() };
        if tests.operations() > most {
            tests = Self { results: products, ..Self::none(ranges) };
        }
        for &value in values {
            let [in_double, in_single] = analyses.each_ref().map(|analysis| tests.bound(g, value, analysis));
            match (in_double, in_single) {
                (true, true) => {}
                (true, false) => tests.single.push(value),
                _ => tests.results.push(value),
            }
        }
        tests
    }

    fn none(ranges: [Range; 2]) -> Self {
        let (results, single) = (Vec::new(), Vec::new());
        let (parameters, lengths, divisors) = (BTreeSet::new(), BTreeSet::new(), BTreeMap::new());
        Self { ranges, results, single, parameters, lengths, divisors }
    }

    fn of_derivatives(mut self, g: &Graph, derivatives: &[NodeId], [double, single]: &[Analysis; 2]) -> Self {
        let mut others = BTreeSet::new();
        for &derivative in derivatives {
            let [in_double, in_single] = [double, single].map(|analysis| analysis.of_result(g, derivative));
            if !in_double.may_overflow() {
                continue;
            }
            if !double.fits(in_double) {
                self.results.push(derivative);
                continue;
            }
            if !single.fits(in_single) {
                self.single.push(derivative);
            }
            for (node, unbounded) in double.inputs(in_double.inputs) {
                match unbounded {
                    Unbounded::Parameter => _ = self.parameters.insert(node),
                    Unbounded::Length => _ = self.lengths.insert(node),
                    Unbounded::Divisor(degree) => _ = self.divisors.insert(node, degree),
                }
                if !matches!(unbounded, Unbounded::Parameter) {
                    others.insert(derivative);
                }
            }
        }
        self.with_the_cheaper(&others)
    }

    /// Returns the number of operations that the tests take.
    fn operations(&self) -> usize {
        // A square and its sum are two operations, and so are the two comparisons of a divisor.
        self.results.len() + 2 * (self.parameters.len() + self.lengths.len() + self.divisors.len())
    }

    /// Returns whether the guards bound a value and all inputs that it depends on, so that it needs no test.
    fn bound(&self, g: &Graph, value: NodeId, analysis: &Analysis) -> bool {
        let is_guarded = |(node, unbounded): (NodeId, Unbounded)| match unbounded {
            Unbounded::Parameter => self.parameters.contains(&node),
            Unbounded::Length => self.lengths.contains(&node),
            Unbounded::Divisor(_) => self.divisors.contains_key(&node),
        };
        let size = analysis.of_result(g, value);
        analysis.fits(size)
            && analysis.inputs(size.inputs).all(is_guarded)
            && reachable(g, &[value]).into_iter().all(|node| is_algebraic(g, node))
    }

    /// Tests results that depend on lengths instead of these lengths, if that takes fewer operations.
    fn with_the_cheaper(mut self, results: &BTreeSet<NodeId>) -> Self {
        if results.len() < 2 * (self.lengths.len() + self.divisors.len()) {
            self.lengths.clear();
            self.divisors.clear();
            self.single.retain(|result| !results.contains(result));
            self.results.extend(results);
        }
        self
    }

    /// Creates the masks where inputs are far from overflow.
    pub(super) fn guards(&self, g: &mut Graph) -> Vec<NodeId> {
        let mut guards = Vec::new();
        let parameters = self.ranges.map(|range| range.parameter);
        let lengths = self.ranges.map(|range| range.length);
        for (inputs, exponents) in [(&self.parameters, parameters), (&self.lengths, lengths)] {
            if !inputs.is_empty() {
                let square = g.sum_of_squares(&inputs.iter().copied().collect::<Vec<_>>());
                let [double, single] = exponents.map(|exponent| 4.0_f64.powi(exponent as i32));
                let largest = g.by_precision(double, single);
                guards.push(g.less(square, largest));
            }
        }
        for (&divisor, &degree) in &self.divisors {
            let size = if is_square(g, divisor) { divisor } else { g.abs(divisor) };
            guards.push(g.is_moderate(size, degree));
        }
        guards
    }

    /// Creates the mask where all tested results are finite.
    pub(super) fn finite(&self, g: &mut Graph, outputs: &BTreeSet<NodeId>) -> NodeId {
        let finite = is_finite(g, &self.results, outputs);
        if self.single.is_empty() {
            return finite;
        }
        let (in_single, is_double) = (is_finite(g, &self.single, outputs), g.is_double());
        let holds = g.or(is_double, in_single);
        g.and(finite, holds)
    }
}

/// Creates the mask where the sum of some results is finite. Some are outputs, the others are parts of outputs.
fn is_finite(g: &mut Graph, results: &[NodeId], outputs: &BTreeSet<NodeId>) -> NodeId {
    // A result and its opposite would cancel.
    let results: BTreeMap<NodeId, NodeId> = results.iter().map(|&result| (g.magnitude(result).0, result)).collect();
    let (computed, others): (Vec<NodeId>, Vec<NodeId>) =
        results.into_values().partition(|&result| outputs.contains(&g.resolve(result)));
    let parts = [(computed, true), (others, false)].into_iter().filter(|(results, _)| !results.is_empty());
    let sums: Vec<NodeId> = parts.map(|(results, are_outputs)| g.pairwise_sum(&results, are_outputs)).collect();
    if sums.is_empty() {
        return g.truth(true);
    }
    let (sum, infinity) = (g.pairwise_sum(&sums, true), g.constant(f64::INFINITY));
    let size = g.abs(sum);
    g.less(size, infinity)
}

/// A bound on the size of an expression: 2^exponent times powers of a length.
#[derive(Clone, Copy, Default)]
struct Size {
    exponent: u32,
    /// Twice the least and the largest exponent of the length.
    degrees: [i32; 2],
    /// The unbounded inputs that it depends on, as bits.
    inputs: u128,
    /// Whether it has a product that may overflow where its factors do not.
    is_product: bool,
}

impl Size {
    fn of(exponent: u32) -> Self {
        Self { exponent, ..Self::default() }
    }

    fn of_length(degree: i32) -> Self {
        Self { degrees: [degree; 2], ..Self::default() }
    }

    /// Returns the exponent for lengths of an exponent.
    fn total(self, range: Range) -> u32 {
        let degree = self.degrees.into_iter().map(i32::unsigned_abs).fold(0, u32::max);
        self.exponent.saturating_add(degree.saturating_mul(range.length) / 2)
    }

    fn plus(self, other: Self) -> Self {
        let ([least, largest], [a, b]) = (self.degrees, other.degrees);
        Self {
            exponent: self.exponent.max(other.exponent),
            degrees: [least.min(a), largest.max(b)],
            inputs: self.inputs | other.inputs,
            is_product: self.is_product || other.is_product,
        }
    }

    fn times(self, other: Self) -> Self {
        Self {
            exponent: self.exponent.saturating_add(other.exponent).min(UNKNOWN),
            degrees: [0, 1].map(|end| self.degrees[end].saturating_add(other.degrees[end])),
            is_product: self.is_product || other.is_product || !self.is_small() && !other.is_small(),
            ..self.plus(other)
        }
    }

    /// Returns whether it may be infinite where its inputs are not.
    fn may_overflow(self) -> bool {
        self.is_product || self.exponent >= UNKNOWN
    }

    /// Returns the degree of a positive power of a length.
    fn power_of_length(self) -> Option<u8> {
        let [least, largest] = self.degrees;
        let is_power = self.exponent == 0 && least == largest && least > 0 && least % 2 == 0;
        is_power.then(|| u8::try_from(least / 2).ok()).flatten()
    }

    fn is_small(self) -> bool {
        (self.exponent, self.degrees) == (0, [0, 0])
    }

    fn root(self) -> Self {
        Self { exponent: self.exponent.div_ceil(2), degrees: self.degrees.map(|degree| degree / 2), ..self }
    }
}

/// The range of a number without a guard.
#[derive(Clone, Copy)]
enum Unbounded {
    Parameter,
    Length,
    /// A divisor: a power of a length.
    Divisor(u8),
}

/// The sizes of all operations of a routine.
struct Analysis {
    range: Range,
    /// Numbers without guards, in the order of their bits.
    unbounded: Vec<(NodeId, Unbounded)>,
    /// Sizes of numbers that guards bound, and of their reciprocals.
    moderate: BTreeMap<NodeId, [Size; 2]>,
    sizes: BTreeMap<NodeId, Size>,
}

impl Analysis {
    fn new(g: &Graph, range: Range, guards: &[NodeId], results: &[NodeId]) -> Self {
        let mut analysis = Self { range, unbounded: Vec::new(), moderate: BTreeMap::new(), sizes: BTreeMap::new() };
        analysis.read(g, guards);
        for node in reachable(g, results) {
            let known = analysis.moderate.get(&node).map(|[size, _]| *size);
            let size = known.unwrap_or_else(|| analysis.of(g, node));
            analysis.sizes.insert(node, size);
        }
        analysis
    }

    /// Reads the bounds that guards give: of operands, of the lengths of vectors, and of their components.
    fn read(&mut self, g: &Graph, guards: &[NodeId]) {
        let mut masks = guards.to_vec();
        while let Some(mask) = masks.pop() {
            match g.op(mask) {
                Op::And(a, b) => masks.extend([a, b]),
                Op::IsModerate(a, OPERAND) => {
                    let size = Size::of(self.range.length * u32::from(OPERAND));
                    let number = if let Op::Abs(number) = g.op(g.resolve(a)) { number } else { a };
                    self.moderate.extend([a, number].map(|node| (g.resolve(node), [size, size])));
                }
                Op::IsModerate(a, degree) => self.read_lengths(g, g.resolve(a), i32::from(degree)),
                _ => {}
            }
        }
    }

    /// Reads the bounds of a power of a length, and of the terms of a sum of squares.
    fn read_lengths(&mut self, g: &Graph, power: NodeId, degree: i32) {
        self.moderate.insert(power, [2 * degree, -2 * degree].map(Size::of_length));
        let mut sums = vec![power];
        while let Some(sum) = sums.pop() {
            match g.op(sum) {
                Op::Add(a, b) if is_square(g, sum) => sums.extend([a, b].map(|term| g.resolve(term))),
                Op::Mul(a, b) if a == b => {
                    self.moderate.entry(g.resolve(a)).or_insert([Size::of_length(degree), Size::of(UNKNOWN)]);
                }
                _ => {}
            }
        }
    }

    /// Returns the numbers without guards that a size depends on.
    fn inputs(&self, inputs: u128) -> impl Iterator<Item = (NodeId, Unbounded)> {
        self.unbounded
            .iter()
            .take(BITS)
            .enumerate()
            .filter(move |(bit, _)| inputs >> bit & 1 == 1)
            .map(|(_, &input)| input)
    }

    /// Returns whether numbers of a size are finite.
    fn fits(&self, size: Size) -> bool {
        size.total(self.range) <= self.range.largest
    }

    fn of_result(&self, g: &Graph, result: NodeId) -> Size {
        self.sizes[&g.resolve(result)]
    }

    fn of(&mut self, g: &Graph, node: NodeId) -> Size {
        let size = |operand: NodeId| self.sizes[&g.resolve(operand)];
        match g.fused(node) {
            _ if is_length(g, node) => self.unbounded(g, node, Unbounded::Length, Size::of_length(2)),
            Op::Input(_) => self.unbounded(g, node, Unbounded::Parameter, Size::of(self.range.parameter)),
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
            Op::Div(a, b) => {
                let numerator = size(a);
                numerator.times(self.reciprocal(g, b))
            }
            Op::Sqrt(a) => size(a).root(),
            Op::Exp(_) | Op::Pow(..) => Size::of(EXPONENTIAL),
            // Rounding errors are smaller than the results that they belong to.
            Op::SumError(a, b) => size(a).plus(size(b)),
            Op::ProductError(a, b) => size(a).times(size(b)),
            Op::RootError(_, root) => size(root),
            Op::DifferenceError(a, b) if is_moving_input(g, a) && is_moving_input(g, b) => Size::of_length(2),
            Op::DifferenceError(a, b) => size(a).plus(size(b)),
            Op::Sin(_) | Op::Cos(_) | Op::Ln(_) | Op::Atan2(..) | Op::ModerateAtan2(..) => Size::default(),
            op if op.is_mask() || matches!(op, Op::Pi | Op::PowerOfTwoScale(_)) => Size::default(),
            _ => Size::of(UNKNOWN),
        }
    }

    /// Returns the size that a number without a guard has once it is guarded.
    fn unbounded(&mut self, g: &Graph, node: NodeId, what: Unbounded, size: Size) -> Size {
        let known = self.unbounded.iter().position(|&(other, _)| other == node || is_opposite(g, other, node));
        let bit = known.unwrap_or(self.unbounded.len());
        if known.is_none() {
            self.unbounded.push((node, what));
        }
        if bit < BITS { Size { inputs: 1 << bit, ..size } } else { Size::of(UNKNOWN) }
    }

    /// Returns the size of 1/b.
    fn reciprocal(&mut self, g: &Graph, b: NodeId) -> Size {
        let b = g.resolve(b);
        if let Some([_, reciprocal]) = self.moderate.get(&b) {
            return *reciprocal;
        }
        match g.op(b) {
            Op::Constant(bits) => Size::of(exponent_of(1.0 / f64::from_bits(bits))),
            Op::Neg(a) | Op::Abs(a) => self.reciprocal(g, a),
            Op::Sqrt(a) => self.reciprocal(g, a).root(),
            Op::Mul(x, y) => self.reciprocal(g, x).times(self.reciprocal(g, y)),
            Op::Div(x, y) => match self.sizes.get(&g.resolve(y)) {
                Some(&size) => self.reciprocal(g, x).times(size),
                None => Size::of(UNKNOWN),
            },
            Op::Exp(_) => Size::of(EXPONENTIAL),
            _ => {
                let Some(size) = self.sizes.get(&b) else { return Size::of(UNKNOWN) };
                let (degree, reciprocal) = match size.power_of_length() {
                    Some(degree) => (degree, Size::of_length(-2 * i32::from(degree))),
                    None => (OPERAND, Size::of(self.range.length * u32::from(OPERAND))),
                };
                self.unbounded(g, b, Unbounded::Divisor(degree), reciprocal)
            }
        }
    }
}

/// Returns whether a result is NaN if an operand is, and bounded by its operands.
fn is_algebraic(g: &Graph, node: NodeId) -> bool {
    match g.fused(node) {
        Op::Input(_) | Op::Constant(_) | Op::Pi | Op::Neg(_) | Op::Abs(_) | Op::Sqrt(_) => true,
        Op::Add(..) | Op::Sub(..) | Op::Mul(..) | Op::Div(..) => true,
        op => {
            matches!(op, Op::FusedMulSub(..) | Op::MulAdd(..) | Op::MulSub(..) | Op::NegMulAdd(..) | Op::NegMulSub(..))
                || matches!(op, Op::SumError(..) | Op::ProductError(..) | Op::RootError(..) | Op::DifferenceError(..))
        }
    }
}

/// Returns the exponent of a constant; 0 for those up to 1.
fn exponent_of(constant: f64) -> u32 {
    let exponent = constant.abs().log2().ceil();
    if exponent.is_finite() { exponent.max(0.0) as u32 } else { u32::from(constant != 0.0) * UNKNOWN }
}

/// Returns whether two numbers are a − b and b − a.
fn is_opposite(g: &Graph, x: NodeId, y: NodeId) -> bool {
    matches!((g.op(x), g.op(y)), (Op::Sub(a, b), Op::Sub(c, d)) if (a, b) == (d, c))
}

/// Returns whether a number is a coordinate, or a difference of coordinates.
pub(super) fn is_length(g: &Graph, node: NodeId) -> bool {
    match g.op(g.resolve(node)) {
        Op::Sub(a, b) => is_moving_input(g, a) && is_moving_input(g, b),
        _ => is_moving_input(g, node),
    }
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
