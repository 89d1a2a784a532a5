//! Constructors for rounding: rounding errors of sums, products and roots, fused products, and scales by powers of two.

use super::build::is_power_of_two;
use super::{Graph, NodeId, Op};

impl Graph {
    /// Creates 0 − a. It equals −a, except that it is +0 for both zeros.
    pub fn minus_or_plus_zero(&mut self, a: NodeId) -> NodeId {
        let zero = self.constant(0.0);
        self.node(Op::Sub(zero, a))
    }

    /// Creates the rounding error of a + b. Signs move out as in the sum itself, so that both have the same operands.
    pub fn sum_error(&mut self, a: NodeId, b: NodeId) -> NodeId {
        if !self.compensated || self.is(a, 0.0) || self.is(b, 0.0) {
            return self.constant(0.0);
        }
        match (self.magnitude(a), self.magnitude(b)) {
            ((x, true), (y, true)) => {
                let error = self.sum_error(x, y);
                self.neg(error)
            }
            ((x, true), (y, false)) => self.difference_error(y, x),
            ((x, false), (y, true)) => self.difference_error(x, y),
            _ => self.node(Op::SumError(a.min(b), a.max(b))),
        }
    }

    /// Creates the rounding error of a − b.
    pub fn difference_error(&mut self, a: NodeId, b: NodeId) -> NodeId {
        if !self.compensated || self.is(a, 0.0) || self.is(b, 0.0) {
            return self.constant(0.0);
        }
        match (self.magnitude(a), self.magnitude(b)) {
            ((x, true), (y, true)) => self.difference_error(y, x),
            ((x, true), (y, false)) => {
                let error = self.sum_error(x, y);
                self.neg(error)
            }
            ((x, false), (y, true)) => self.sum_error(x, y),
            _ if !self.index.contains_key(&Op::Sub(a, b)) && self.index.contains_key(&Op::Sub(b, a)) => {
                let opposite = self.node(Op::DifferenceError(b, a));
                self.neg(opposite)
            }
            _ => self.node(Op::DifferenceError(a, b)),
        }
    }

    /// Creates the rounding error of a · b.
    pub fn product_error(&mut self, a: NodeId, b: NodeId) -> NodeId {
        let exact = [a, b].iter().any(|&factor| self.as_constant(factor).is_some_and(is_power_of_two));
        if !self.compensated || exact {
            return self.constant(0.0);
        }
        let ((a, minus_a), (b, minus_b)) = (self.magnitude(a), self.magnitude(b));
        let error = self.node(Op::ProductError(a.min(b), a.max(b)));
        self.signed(error, minus_a != minus_b)
    }

    /// Returns the rounding error of a node that is a difference; zero for other nodes.
    pub fn rounding_tail(&mut self, node: NodeId) -> NodeId {
        match self.op(node) {
            Op::Sub(a, b) => self.difference_error(a, b),
            Op::Neg(a) => {
                let tail = self.rounding_tail(a);
                self.neg(tail)
            }
            _ => self.constant(0.0),
        }
    }

    /// Creates a · b − c as if rounded once. Without compensation it is rounded twice, so that a · b − b · a is 0.
    pub fn fused_mul_sub(&mut self, a: NodeId, b: NodeId, c: NodeId) -> NodeId {
        if !self.compensated || self.as_constant(a).or(self.as_constant(b)).is_some() || self.is(c, 0.0) {
            let product = self.mul(a, b);
            return self.sub(product, c);
        }
        let ((a, minus_a), (b, minus_b)) = (self.magnitude(a), self.magnitude(b));
        let negative = minus_a != minus_b;
        // −a·b − c = −(a·b − (−c)).
        let c = self.signed(c, negative);
        let difference = self.node(Op::FusedMulSub(a.min(b), a.max(b), c));
        self.signed(difference, negative)
    }

    /// Creates a · b − c · d with one product fused, for use where it need not be 0 when both are equal.
    pub fn difference_of_products(&mut self, [a, b]: [NodeId; 2], [c, d]: [NodeId; 2]) -> NodeId {
        let product = self.mul(a, b);
        self.neg_mul_add(c, d, product)
    }

    /// Creates c − a · b, fused.
    pub(crate) fn neg_mul_add(&mut self, a: NodeId, b: NodeId, c: NodeId) -> NodeId {
        if self.is(c, 0.0) || self.as_constant(a).or(self.as_constant(b)).is_some() {
            let product = self.mul(a, b);
            return self.sub(c, product);
        }
        let ((a, minus_a), (b, minus_b)) = (self.magnitude(a), self.magnitude(b));
        let (a, b) = (a.min(b), a.max(b));
        if minus_a == minus_b { self.node(Op::NegMulAdd(a, b, c)) } else { self.node(Op::MulAdd(a, b, c)) }
    }

    /// Creates a − b², where b is √a rounded.
    pub fn root_error(&mut self, a: NodeId, b: NodeId) -> NodeId {
        if !self.compensated {
            return self.constant(0.0);
        }
        self.node(Op::RootError(a, b))
    }

    /// Creates the power of two that scales |a| into [1, 2).
    pub fn power_of_two_scale(&mut self, a: NodeId) -> NodeId {
        self.node(Op::PowerOfTwoScale(a))
    }

    /// Creates the mask of a ≥ 0 being a moderate power of a length, so that no scaling is needed.
    pub fn is_moderate(&mut self, a: NodeId, degree: u8) -> NodeId {
        self.node(Op::IsModerate(a, degree))
    }

    /// Creates the mask of number types with the precision of doubles, or more. Compilers fold it.
    pub fn is_double(&mut self) -> NodeId {
        // In single precision, the second number is 1.
        let [one, more] = [1.0, 1.0 + 2.0_f64.powi(-30)].map(|x| self.constant(x));
        self.less(one, more)
    }

    /// Creates a constant that depends on the precision of the number type.
    pub fn by_precision(&mut self, double: f64, single: f64) -> NodeId {
        let is_double = self.is_double();
        let [double, single] = [double, single].map(|x| self.constant(x));
        self.select(is_double, double, single)
    }

    /// Creates a × b with fused products. It is more accurate, but not exactly 0 where the cross product vanishes.
    pub fn fused_cross(&mut self, a: &[NodeId], b: &[NodeId]) -> [NodeId; 3] {
        std::array::from_fn(|i| {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            self.difference_of_products([a[j], b[k]], [a[k], b[j]])
        })
    }
}
