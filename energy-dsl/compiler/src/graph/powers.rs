//! Powers. Whole and half-whole ones are products, roots and quotients, which remember what they are powers of.

use super::{Graph, NodeId, Op, Product};

impl Graph {
    /// Creates a^b without recognition.
    pub(crate) fn plain_pow(&mut self, a: NodeId, b: NodeId) -> NodeId {
        let Some(exponent) = self.as_constant(b) else { return self.node(Op::Pow(a, b)) };
        if let Some(x) = self.as_constant(a)
            && self.folds(false)
        {
            return self.constant(x.powf(exponent));
        }
        let doubled = 2.0 * exponent;
        if doubled.fract() != 0.0 || doubled.abs() > 64.0 {
            return self.node(Op::Pow(a, b));
        }
        let whole = exponent.abs().floor();
        let mut power = self.integer_power(a, whole as u32);
        if exponent.fract() != 0.0 {
            let root = self.sqrt(a);
            power = self.mul(power, root);
        }
        if exponent < 0.0 {
            let one = self.constant(1.0);
            power = self.div(one, power);
        }
        self.note_power(power, a, exponent);
        power
    }

    /// Creates aⁿ by squares.
    fn integer_power(&mut self, a: NodeId, exponent: u32) -> NodeId {
        match exponent {
            0 => self.constant(1.0),
            1 => a,
            n => {
                let half = self.integer_power(a, n / 2);
                let square = self.mul(half, half);
                let power = if n % 2 == 1 { self.mul(square, a) } else { square };
                self.note_power(power, a, f64::from(n));
                power
            }
        }
    }

    /// Records that a product or quotient is a power.
    fn note_power(&mut self, node: NodeId, base: NodeId, exponent: f64) {
        if self.varies(base) && base < node && matches!(self.op(node), Op::Mul(..) | Op::Div(..)) {
            self.powers.entry(node).or_insert((base, exponent));
            if exponent > 0.0 && exponent.fract() == 0.0 {
                self.whole_powers.entry((base, exponent as u32)).or_insert(node);
            }
        }
    }

    /// Returns the first and second derivatives of a power by its base, n xⁿ⁻¹ and n (n − 1) xⁿ⁻².
    pub(super) fn derivatives_of_power(&mut self, node: NodeId) -> Option<[Product; 2]> {
        let &(base, exponent) = self.powers.get(&node)?;
        let powers = if exponent < 0.0 {
            // Negative powers share 1/x.
            let one = self.constant(1.0);
            let reciprocal = self.div(one, base);
            let lower = self.mul(node, reciprocal);
            [lower, self.mul(lower, reciprocal)]
        } else {
            [1.0, 2.0].map(|less| self.lower_power(base, exponent - less))
        };
        let factors = [exponent, exponent * (exponent - 1.0)].map(|factor| self.constant(factor));
        Some([0, 1].map(|order| vec![factors[order], powers[order]]))
    }

    /// Creates a power, if possible as a product of two that exist.
    fn lower_power(&mut self, base: NodeId, exponent: f64) -> NodeId {
        if exponent.fract() != 0.0 || exponent < 1.0 {
            let exponent = self.constant(exponent);
            return self.plain_pow(base, exponent);
        }
        let n = exponent as u32;
        let known = |n: u32| if n == 1 { Some(base) } else { self.whole_powers.get(&(base, n)).copied() };
        let (largest, first) = (1..=n).rev().find_map(|n| Some((n, known(n)?))).expect("the base itself");
        if largest == n {
            return first;
        }
        let second = self.lower_power(base, f64::from(n - largest));
        let power = self.mul(first, second);
        self.note_power(power, base, exponent);
        power
    }
}
