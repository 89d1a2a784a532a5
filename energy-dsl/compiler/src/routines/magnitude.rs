//! Bounds on rounding errors: a formula evaluated with the sizes of its terms, whose signs do not cancel.

use std::collections::BTreeMap;

use crate::graph::{Graph, Input, NodeId, Op};

/// Rounding errors of a result, as multiples of its magnitude: 32 roundoffs, in double and in single precision.
const ROUNDING: (f64, f64) = (32.0 / (1_u64 << 53) as f64, 32.0 / (1_u64 << 24) as f64);

/// The magnitudes of nodes. The error of a node is at most some roundoffs of its magnitude.
#[derive(Default)]
pub(super) struct Magnitudes(BTreeMap<NodeId, NodeId>);

impl Magnitudes {
    /// Creates a bound on the rounding error of a node.
    pub(super) fn rounding_bound(&mut self, g: &mut Graph, node: NodeId) -> NodeId {
        let (magnitude, rounding) = (self.of(g, node), g.by_precision(ROUNDING.0, ROUNDING.1));
        g.mul(rounding, magnitude)
    }

    /// Creates the magnitude of a node.
    fn of(&mut self, g: &mut Graph, node: NodeId) -> NodeId {
        // Uses an explicit stack, because expressions may be deep.
        let mut stack = vec![node];
        while let Some(&next) = stack.last() {
            let parts: Vec<NodeId> = match g.rule(next) {
                Some(rule) => rule.arguments.clone(),
                None => g.op(next).operands().filter(|&operand| !g.op(operand).is_mask()).collect(),
            };
            let missing: Vec<NodeId> = parts.into_iter().filter(|part| !self.0.contains_key(part)).collect();
            if missing.is_empty() {
                let magnitude = self.combined(g, next);
                self.0.insert(next, magnitude);
                stack.pop();
            } else {
                stack.extend(missing);
            }
        }
        self.0[&node]
    }

    fn combined(&self, g: &mut Graph, node: NodeId) -> NodeId {
        if let Op::Input(Input::Increment(_)) = g.op(node) {
            // An increment is 0, but the rotation that it turns is rounded: by as much as an increment of one roundoff.
            return g.constant(1.0);
        }
        let size = g.abs(node);
        let m = |node: NodeId| self.0[&node];
        if let Some(rule) = g.rule(node).cloned() {
            // |f| + Σ |∂f/∂aᵢ| m(aᵢ).
            return rule.arguments.iter().zip(&rule.first).fold(size, |sum, (&argument, slope)| {
                let sizes: Vec<NodeId> = slope.iter().map(|&factor| g.abs(factor)).collect();
                let slope = sizes.into_iter().reduce(|a, b| g.mul(a, b)).unwrap_or(sum);
                let part = g.mul(slope, m(argument));
                g.add(sum, part)
            });
        }
        match g.op(node) {
            Op::Neg(a) | Op::Abs(a) => m(a),
            Op::Add(a, b) | Op::Sub(a, b) => g.add(m(a), m(b)),
            Op::Mul(a, b) => g.mul(m(a), m(b)),
            Op::Div(a, b) => {
                let (product, square) = (g.mul(m(a), m(b)), g.mul(b, b));
                g.div(product, square)
            }
            Op::FusedMulSub(a, b, c)
            | Op::MulAdd(a, b, c)
            | Op::MulSub(a, b, c)
            | Op::NegMulAdd(a, b, c)
            | Op::NegMulSub(a, b, c) => {
                let product = g.mul(m(a), m(b));
                g.add(product, m(c))
            }
            Op::Min(a, b) | Op::Max(a, b) => g.max(m(a), m(b)),
            Op::Select(mask, yes, no) => g.select(mask, m(yes), m(no)),
            Op::Sqrt(a) => g.div(m(a), node),
            Op::Sin(a) | Op::Cos(a) => {
                let one = g.constant(1.0);
                g.add(one, m(a))
            }
            Op::Exp(a) => {
                let relative = g.mul(size, m(a));
                g.add(size, relative)
            }
            Op::Ln(a) => {
                let argument = g.abs(a);
                let relative = g.div(m(a), argument);
                g.add(size, relative)
            }
            Op::Pow(a, b) => {
                // |aᵇ| (1 + |b| m(a)/|a| + |ln |a|| m(b)).
                let (base, exponent, one) = (g.abs(a), g.abs(b), g.constant(1.0));
                let relative = g.div(m(a), base);
                let by_base = g.mul(exponent, relative);
                let logarithm = g.ln(base);
                let logarithm = g.abs(logarithm);
                let by_exponent = g.mul(logarithm, m(b));
                let sum = g.sum([one, by_base, by_exponent]);
                g.mul(size, sum)
            }
            Op::Atan2(y, x) | Op::ModerateAtan2(y, x) => {
                let [rise, run] = [y, x].map(|node| g.abs(node));
                let crossed = g.dot(&[rise, run], &[m(x), m(y)]);
                let square = g.dot(&[x, y], &[x, y]);
                let relative = g.div(crossed, square);
                g.add(size, relative)
            }
            _ => size,
        }
    }
}
