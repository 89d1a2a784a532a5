//! Selects the products that fuse with a sum into one multiply-add.
//!
//! The choice depends only on the graph, so all routines compute a node in the same way. A difference of two products
//! is not fused: then a·b − a·b would not be 0, and a flat hinge would not be flat. Scaled operands are rounded first
//! even if the scale is 1 and omitted, so that results scale exactly with their configuration.

use super::{Graph, NodeId, Op};

impl Graph {
    /// Returns the fused operation that computes a node.
    #[must_use]
    pub fn fused(&self, node: NodeId) -> Op {
        // Negating the addend is free.
        let unsigned = |c: NodeId| match self.op(self.resolve(c)) {
            Op::Neg(c) => Some(c),
            _ => None,
        };
        match self.with_product(node) {
            Op::MulAdd(a, b, c) if let Some(c) = unsigned(c) => Op::MulSub(a, b, c),
            Op::MulSub(a, b, c) if let Some(c) = unsigned(c) => Op::MulAdd(a, b, c),
            Op::NegMulAdd(a, b, c) if let Some(c) = unsigned(c) => Op::NegMulSub(a, b, c),
            Op::NegMulSub(a, b, c) if let Some(c) = unsigned(c) => Op::NegMulAdd(a, b, c),
            op => op,
        }
    }

    fn with_product(&self, node: NodeId) -> Op {
        match self.op(node) {
            op @ Op::Add(a, b) if !self.has(Op::SumError(a.min(b), a.max(b))) && !self.unfused.contains(&node) => {
                match (self.product_of(a), self.product_of(b)) {
                    // Fuses the product with fewer uses; the other one is computed anyway.
                    (Some((x, y)), Some(_)) if self.users(a) < self.users(b) => Op::MulAdd(x, y, b),
                    (_, Some((x, y))) => Op::MulAdd(x, y, a),
                    (Some((x, y)), None) => Op::MulAdd(x, y, b),
                    (None, None) => op,
                }
            }
            op @ Op::Sub(a, b) if !self.has(Op::DifferenceError(a, b)) => {
                match (self.product_of(a), self.product_of(b)) {
                    (None, Some((x, y))) => Op::NegMulAdd(x, y, a),
                    (Some((x, y)), None) => Op::MulSub(x, y, b),
                    _ => op,
                }
            }
            // The result with the opposite sign rounds identically, at no cost.
            op @ Op::Neg(a) => match self.with_product(a) {
                Op::MulAdd(x, y, z) => Op::NegMulSub(x, y, z),
                Op::MulSub(x, y, z) => Op::NegMulAdd(x, y, z),
                Op::NegMulAdd(x, y, z) => Op::MulSub(x, y, z),
                _ => op,
            },
            op => op,
        }
    }

    /// Returns the two products (subtrahend last) of a sum whose terms are products of opposite signs, unless their
    /// difference already exists.
    pub(super) fn opposed_products(&self, a: NodeId, b: NodeId) -> Option<[NodeId; 2]> {
        let [plus, minus] = match (self.magnitude(a), self.magnitude(b)) {
            ((x, false), (y, true)) => [x, y],
            ((x, true), (y, false)) => [y, x],
            _ => return None,
        };
        let known = plus == minus || self.has(Op::Sub(plus, minus)) || self.has(Op::Sub(minus, plus));
        let products = [plus, minus].into_iter().all(|node| self.product_of(node).is_some());
        (products && !known).then_some([plus, minus])
    }

    /// Creates the difference of two products with the younger one fused, so that the opposite difference differs only
    /// in sign.
    pub(super) fn fused_difference(&mut self, [plus, minus]: [NodeId; 2]) -> NodeId {
        let (older, younger) = (plus.min(minus), plus.max(minus));
        let (x, y) = self.product_of(younger).expect("a product");
        let difference = self.neg_mul_add(x, y, older);
        self.signed(difference, younger == plus)
    }

    fn users(&self, node: NodeId) -> u32 {
        self.users[node.0 as usize]
    }

    /// Returns the factors of a product, unless its rounding error is used: that error belongs to the rounded product.
    fn product_of(&self, node: NodeId) -> Option<(NodeId, NodeId)> {
        match self.op(self.resolve(node)) {
            Op::Mul(x, y) if !self.has(Op::ProductError(x, y)) && !self.rounded.contains(&self.resolve(node)) => {
                (!self.is_scale(x) && !self.is_scale(y)).then_some((x, y))
            }
            _ => None,
        }
    }

    /// Creates a + b without fusing. A sum that exists already stays as it is, because others use it.
    pub(super) fn unfused_sum(&mut self, a: NodeId, b: NodeId) -> NodeId {
        let before = self.len();
        let sum = self.node(Op::Add(a.min(b), a.max(b)));
        if self.len() > before {
            self.unfused.insert(sum);
        }
        sum
    }

    /// Marks a node as rounded before every use.
    pub(super) fn round(&mut self, node: NodeId) {
        if matches!(self.op(node), Op::Mul(..)) {
            self.rounded.insert(node);
        }
    }

    /// Returns whether a node is a power of two that scales.
    pub(crate) fn is_scale(&self, node: NodeId) -> bool {
        match self.op(node) {
            Op::PowerOfTwoScale(_) => true,
            Op::Mul(a, b) => self.is_scale(a) && self.is_scale(b),
            _ => false,
        }
    }

    fn has(&self, op: Op) -> bool {
        self.index.contains_key(&op)
    }
}
