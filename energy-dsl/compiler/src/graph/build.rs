//! Constructors of nodes. They fold constants, zeros and ones, move signs outwards, and order commutative operands, so
//! that equal expressions become one node.
//!
//! No rewrite changes how a result is rounded. Products with powers of two are regrouped, which is exact.

use super::recognise::Ending;
use super::{Form, Graph, Input, NodeId, Op};
use energy_runtime::Number;

/// Bytes of a node in all tables of a graph, which double in size as they grow.
const NODE_BYTES: u64 = 150;

impl Graph {
    pub(crate) fn push(&mut self, op: Op, varies: bool) -> NodeId {
        self.budget().spend(1, NODE_BYTES);
        let id = NodeId(u32::try_from(self.nodes.len()).expect("fewer than 2³² nodes"));
        for operand in op.operands() {
            self.users[operand.0 as usize] += 1;
        }
        self.nodes.push(op);
        self.varies.push(varies);
        self.users.push(0);
        id
    }

    pub(super) fn node(&mut self, op: Op) -> NodeId {
        if let Some(&id) = self.index.get(&op) {
            self.budget().spend(1, 0);
            return id;
        }
        let varies = match op {
            Op::Input(Input::Position(_) | Input::Velocity(_) | Input::Increment(_)) => true,
            Op::Input(input) => self.varied.contains(&input),
            _ => op.operands().any(|o| self.varies(o)),
        };
        let id = self.push(op, varies);
        self.index.insert(op, id);
        id
    }

    /// Creates a constant.
    pub fn constant(&mut self, value: f64) -> NodeId {
        // There is one zero. Code that depends on the sign of zero uses a selection.
        self.node(Op::Constant((value + 0.0).to_bits()))
    }

    /// Creates π.
    pub fn pi(&mut self) -> NodeId {
        self.node(Op::Pi)
    }

    /// Creates an input.
    pub fn input(&mut self, input: Input) -> NodeId {
        self.node(Op::Input(input))
    }

    /// Returns the constant value of a node; `None` if it is not constant.
    #[must_use]
    pub fn as_constant(&self, node: NodeId) -> Option<f64> {
        match self.op(node) {
            Op::Constant(bits) => Some(f64::from_bits(bits)),
            _ => None,
        }
    }

    /// Returns whether the node is the constant `value`.
    #[must_use]
    pub fn is(&self, node: NodeId, value: f64) -> bool {
        self.as_constant(node) == Some(value)
    }

    /// Returns the node without its leading minus sign, and whether it had one.
    pub(crate) fn magnitude(&self, node: NodeId) -> (NodeId, bool) {
        match self.op(node) {
            Op::Neg(a) => (a, true),
            _ => (node, false),
        }
    }

    pub(super) fn signed(&mut self, node: NodeId, negative: bool) -> NodeId {
        if negative { self.neg(node) } else { node }
    }

    /// Creates −a.
    pub fn neg(&mut self, a: NodeId) -> NodeId {
        match self.op(a) {
            Op::Constant(bits) => self.constant(-f64::from_bits(bits)),
            Op::Neg(b) => b,
            Op::Sub(b, c) => self.node(Op::Sub(c, b)),
            _ => self.node(Op::Neg(a)),
        }
    }

    /// Returns whether to fold an operation on constants. The textbook form is also evaluated in higher precision, so
    /// it only folds exact results.
    pub(super) fn folds(&self, exact: bool) -> bool {
        exact || self.form() == Form::Robust
    }

    /// Creates a + b.
    pub fn add(&mut self, a: NodeId, b: NodeId) -> NodeId {
        if let (Some(x), Some(y)) = (self.as_constant(a), self.as_constant(b))
            && self.folds(x.sum_error(y) == 0.0)
        {
            return self.constant(x + y);
        }
        if self.is(a, 0.0) {
            return b;
        }
        if self.is(b, 0.0) {
            return a;
        }
        if a == b {
            let two = self.constant(2.0);
            return self.mul(two, a);
        }
        if let Some(recognised) = self.recognised(Ending::Sum, a, b) {
            return recognised;
        }
        match (self.magnitude(a), self.magnitude(b)) {
            ((x, true), (y, true)) => {
                let sum = self.add(x, y);
                self.neg(sum)
            }
            ((x, true), (y, false)) => self.sub(y, x),
            ((x, false), (y, true)) => self.sub(x, y),
            _ if self.outward
                && let Some((c, x, y)) = self.common_power_of_two(a, b) =>
            {
                let (c, sum) = (self.constant(c), self.add(x, y));
                self.mul(c, sum)
            }
            // Uses the operand order that was written first: it decides which product is fused.
            _ if self.index.contains_key(&Op::Add(b, a)) => self.node(Op::Add(b, a)),
            _ => self.node(Op::Add(a, b)),
        }
    }

    /// Creates a − b. `1 − cos` of an angle between vectors and `‖d‖ − L` become robust primitives.
    pub fn sub(&mut self, a: NodeId, b: NodeId) -> NodeId {
        if let (Some(x), Some(y)) = (self.as_constant(a), self.as_constant(b))
            && self.folds(x.sum_error(-y) == 0.0)
        {
            return self.constant(x - y);
        }
        if a == b {
            return self.constant(0.0);
        }
        if self.is(a, 0.0) {
            return self.neg(b);
        }
        if self.is(b, 0.0) {
            return a;
        }
        if let Some(recognised) = self.recognised(Ending::Difference, a, b) {
            return recognised;
        }
        match (self.magnitude(a), self.magnitude(b)) {
            ((x, true), (y, true)) => self.sub(y, x),
            ((x, true), (y, false)) => {
                let sum = self.add(x, y);
                self.neg(sum)
            }
            ((x, false), (y, true)) => self.add(x, y),
            _ if self.outward
                && let Some((c, x, y)) = self.common_power_of_two(a, b) =>
            {
                let (c, difference) = (self.constant(c), self.sub(x, y));
                self.mul(c, difference)
            }
            _ => {
                // Reuses the opposite difference if it exists.
                if let Some(&opposite) = self.index.get(&Op::Sub(b, a)) {
                    return self.node(Op::Neg(opposite));
                }
                self.node(Op::Sub(a, b))
            }
        }
    }

    /// Creates a − b without recognition.
    pub(crate) fn plain_difference(&mut self, a: NodeId, b: NodeId) -> NodeId {
        self.node(Op::Sub(a, b))
    }

    /// Creates a · b. A squared elongation becomes its own primitive.
    pub fn mul(&mut self, a: NodeId, b: NodeId) -> NodeId {
        if let (Some(x), Some(y)) = (self.as_constant(a), self.as_constant(b))
            && self.folds(x.mul_add(y, -(x * y)) == 0.0)
        {
            return self.constant(x * y);
        }
        let (a, b) = if self.as_constant(b).is_some() { (b, a) } else { (a, b) };
        if let Some(x) = self.as_constant(a) {
            if x == 0.0 || x == 1.0 || x == -1.0 {
                return if x == 0.0 { a } else { self.signed(b, x < 0.0) };
            }
            if let Some(regrouped) = self.regroup(x, b) {
                return regrouped;
            }
        }
        let ((a, minus_a), (b, minus_b)) = (self.magnitude(a), self.magnitude(b));
        if a == b
            && self.form() == Form::Robust
            && let Some(half_square) = self.rule(a).and_then(|r| r.half_square)
        {
            let two = self.constant(2.0);
            let square = self.mul(two, half_square);
            return self.signed(square, minus_a != minus_b);
        }
        // (2ⁿ x)(2ᵐ y) = 2ⁿ⁺ᵐ (x y), exactly.
        let ((c, x), (d, y)) = (self.power_of_two_times(a), self.power_of_two_times(b));
        let outward = self.outward && [(x, a), (y, b)].into_iter().any(|(x, a)| x != a && self.varies(x));
        if outward && self.as_constant(a).is_none() || x != a && y != b {
            let (constant, product) = (self.constant(c * d), self.mul(x, y));
            let product = self.mul(constant, product);
            return self.signed(product, minus_a != minus_b);
        }
        for (scale, scaled) in [(a, b), (b, a)] {
            if self.is_scale(scale) {
                self.round(scaled);
            }
        }
        let product = self.node(Op::Mul(a.min(b), a.max(b)));
        self.signed(product, minus_a != minus_b)
    }

    /// Returns whether the product of two factors without signs is a node already.
    pub(crate) fn has_product(&self, a: NodeId, b: NodeId) -> bool {
        self.index.contains_key(&Op::Mul(a.min(b), a.max(b)))
    }

    /// Creates a · b; a minus sign stays with its factor.
    pub(super) fn signed_product(&mut self, a: NodeId, b: NodeId) -> NodeId {
        self.node(Op::Mul(a.min(b), a.max(b)))
    }

    /// Splits a product into its constant and its other factor.
    fn scaled_by_constant(&self, node: NodeId) -> Option<(NodeId, NodeId)> {
        match self.op(node) {
            Op::Mul(c, y) if self.as_constant(c).is_some() => Some((c, y)),
            Op::Mul(y, c) if self.as_constant(c).is_some() => Some((c, y)),
            _ => None,
        }
    }

    /// Splits a leading power of two off a product; returns 1 and the node without one.
    fn power_of_two_times(&self, node: NodeId) -> (f64, NodeId) {
        let scaled = self.scaled_by_constant(node);
        let scaled = scaled.and_then(|(c, x)| Some((self.as_constant(c).filter(|&c| is_power_of_two(c))?, x)));
        scaled.unwrap_or((1.0, node))
    }

    /// Returns the power of two that both terms share, and the other factors.
    fn common_power_of_two(&self, a: NodeId, b: NodeId) -> Option<(f64, NodeId, NodeId)> {
        let ((c, x), (d, y)) = (self.power_of_two_times(a), self.power_of_two_times(b));
        (c == d && c != 1.0).then_some((c, x, y))
    }

    /// Regroups x · (c · y) if both constants are powers of two.
    fn regroup(&mut self, x: f64, b: NodeId) -> Option<NodeId> {
        let (c, y) = self.scaled_by_constant(b)?;
        let c = self.as_constant(c)?;
        if !(is_power_of_two(x) && is_power_of_two(c)) {
            return None;
        }
        let factor = self.constant(x * c);
        Some(self.mul(factor, y))
    }

    /// Creates a / b. A division by a power of two becomes a product.
    pub fn div(&mut self, a: NodeId, b: NodeId) -> NodeId {
        if self.is(a, 0.0) {
            return a;
        }
        if let Some(y) = self.as_constant(b) {
            if let Some(x) = self.as_constant(a)
                && self.folds((x / y).mul_add(y, -x) == 0.0)
            {
                return self.constant(x / y);
            }
            if is_power_of_two(y) {
                let reciprocal = self.constant(1.0 / y);
                return self.mul(reciprocal, a);
            }
        }
        let ((a, minus_a), (b, minus_b)) = (self.magnitude(a), self.magnitude(b));
        if self.is_scale(b) {
            self.round(a);
        }
        let quotient = self.node(Op::Div(a, b));
        self.signed(quotient, minus_a != minus_b)
    }

    fn unary(&mut self, a: NodeId, fold: fn(f64) -> f64, op: fn(NodeId) -> Op) -> NodeId {
        match self.as_constant(a) {
            Some(x) if self.folds(is_exact(x, fold(x))) => self.constant(fold(x)),
            _ => self.node(op(a)),
        }
    }

    /// Creates √a. The root of 1 − cos between vectors becomes its own primitive.
    pub fn sqrt(&mut self, a: NodeId) -> NodeId {
        if let Some(recognised) = self.recognised(Ending::Root, a, a) {
            return recognised;
        }
        self.plain_sqrt(a)
    }

    /// Creates √a without recognition.
    pub(crate) fn plain_sqrt(&mut self, a: NodeId) -> NodeId {
        self.unary(a, f64::sqrt, Op::Sqrt)
    }

    /// Creates |a|.
    pub fn abs(&mut self, a: NodeId) -> NodeId {
        let (a, _) = self.magnitude(a);
        match self.op(a) {
            Op::Mul(x, y) if x == y => a,
            Op::Sqrt(_) | Op::Exp(_) => a,
            _ => self.unary(a, f64::abs, Op::Abs),
        }
    }

    /// Creates sin a. For a dihedral angle or its half, the angle is not computed.
    pub fn sin(&mut self, a: NodeId) -> NodeId {
        if let Some(recognised) = self.recognised(Ending::Sine, a, a) {
            return recognised;
        }
        self.unary(a, f64::sin, Op::Sin)
    }

    /// Creates cos a. For a dihedral angle or its half, the angle is not computed.
    pub fn cos(&mut self, a: NodeId) -> NodeId {
        if let Some(recognised) = self.recognised(Ending::Cosine, a, a) {
            return recognised;
        }
        self.unary(a, f64::cos, Op::Cos)
    }

    /// Creates eᵃ.
    pub fn exp(&mut self, a: NodeId) -> NodeId {
        self.unary(a, f64::exp, Op::Exp)
    }

    /// Creates ln a.
    pub fn ln(&mut self, a: NodeId) -> NodeId {
        self.unary(a, f64::ln, Op::Ln)
    }

    /// Creates atan2(y, x).
    pub fn atan2(&mut self, y: NodeId, x: NodeId) -> NodeId {
        self.node(Op::Atan2(y, x))
    }

    /// Creates atan2(y, x) for moderate y² + x².
    pub fn moderate_atan2(&mut self, y: NodeId, x: NodeId) -> NodeId {
        self.node(Op::ModerateAtan2(y, x))
    }

    /// Creates min(a, b).
    pub fn min(&mut self, a: NodeId, b: NodeId) -> NodeId {
        if a == b { a } else { self.node(Op::Min(a.min(b), a.max(b))) }
    }

    /// Creates max(a, b).
    pub fn max(&mut self, a: NodeId, b: NodeId) -> NodeId {
        if a == b { a } else { self.node(Op::Max(a.min(b), a.max(b))) }
    }

    /// Creates a^b: products for integers, a root for halves, else `powf`. A power of a norm becomes its own primitive.
    pub fn pow(&mut self, a: NodeId, b: NodeId) -> NodeId {
        if let Some(recognised) = self.recognised(Ending::Power, a, b) {
            return recognised;
        }
        self.plain_pow(a, b)
    }

    /// Creates an operation on nodes of this graph by its constructor, which simplifies.
    pub(crate) fn rebuilt(&mut self, op: Op) -> NodeId {
        match op {
            Op::Constant(bits) => self.constant(f64::from_bits(bits)),
            Op::Truth(value) => self.truth(value),
            Op::Cautious => self.cautious(),
            Op::Pi => self.pi(),
            Op::Input(input) => self.input(input),
            Op::Neg(a) => self.neg(a),
            Op::Add(a, b) => self.add(a, b),
            Op::Sub(a, b) => self.sub(a, b),
            Op::Mul(a, b) => self.mul(a, b),
            Op::Div(a, b) => self.div(a, b),
            Op::Sqrt(a) => self.sqrt(a),
            Op::Abs(a) => self.abs(a),
            Op::Min(a, b) => self.min(a, b),
            Op::Max(a, b) => self.max(a, b),
            Op::Sin(a) => self.sin(a),
            Op::Cos(a) => self.cos(a),
            Op::Exp(a) => self.exp(a),
            Op::Ln(a) => self.ln(a),
            Op::Atan2(a, b) => self.atan2(a, b),
            Op::ModerateAtan2(a, b) => self.moderate_atan2(a, b),
            Op::Pow(a, b) => self.plain_pow(a, b),
            Op::FusedMulSub(a, b, c) => self.fused_mul_sub(a, b, c),
            Op::MulAdd(a, b, c) => {
                let minus = self.neg(a);
                self.neg_mul_add(minus, b, c)
            }
            Op::NegMulAdd(a, b, c) => self.neg_mul_add(a, b, c),
            Op::SumError(a, b) => self.sum_error(a, b),
            Op::DifferenceError(a, b) => self.difference_error(a, b),
            Op::ProductError(a, b) => self.product_error(a, b),
            Op::RootError(a, b) => self.root_error(a, b),
            Op::PowerOfTwoScale(a) => self.power_of_two_scale(a),
            Op::Less(a, b) => self.less(a, b),
            Op::Precedes(a, b) => self.precedes(a, b),
            Op::LessOrEqual(a, b) => self.less_or_equal(a, b),
            Op::Equal(a, b) => self.equal(a, b),
            Op::IsModerate(a, degree) => self.is_moderate(a, degree),
            Op::And(a, b) => self.and(a, b),
            Op::Or(a, b) => self.or(a, b),
            Op::Not(a) => self.not(a),
            Op::Select(mask, a, b) => self.select(mask, a, b),
            Op::Rule(_) | Op::MulSub(..) | Op::NegMulSub(..) => {
                unreachable!("compiler bug: resolved, and not yet fused")
            }
        }
    }
}

/// Returns whether the result of a unary function is known to be exact: |x|, an exact root, or an integer at 0 and 1.
fn is_exact(x: f64, result: f64) -> bool {
    result == x.abs() || result.mul_add(result, -x) == 0.0 || (result.fract() == 0.0 && (x == 0.0 || x == 1.0))
}

pub(super) fn is_power_of_two(value: f64) -> bool {
    value != 0.0 && value.is_normal() && value.to_bits() & ((1 << 52) - 1) == 0
}
