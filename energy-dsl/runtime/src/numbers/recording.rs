//! Numbers along rays that are computed when they are asked for.
//!
//! At a singular input, a routine records what it would compute. Only comparisons and results ask for numbers. If the
//! values show that a limit does not exist, no derivative is computed.

use super::bundle::Bundle;
use super::comparisons;
use super::outcomes::Outcomes;

/// How a number follows from earlier ones.
#[derive(Clone, Copy, Debug)]
pub(super) enum Step {
    Plus(u32, u32),
    Minus(u32, u32),
    Times(u32, u32),
    Over(u32, u32),
    Power(u32, u32),
    /// The angle of the point (second, first).
    Angle(u32, u32),
    Root(u32),
    Exp(u32),
    Ln(u32),
    Sin(u32),
    Cos(u32),
    /// The number with another sign along some rays.
    Signed(u32, Outcomes),
    Select(Outcomes, u32, u32),
    /// The size of a number; the comparison with 0.
    Size(u32, u32),
    /// The larger and the smaller of two numbers; their comparison.
    Larger(u32, u32, u32),
    Smaller(u32, u32, u32),
}

impl Step {
    fn operands(self) -> [u32; 2] {
        match self {
            Self::Plus(a, b)
            | Self::Minus(a, b)
            | Self::Times(a, b)
            | Self::Over(a, b)
            | Self::Power(a, b)
            | Self::Angle(a, b)
            | Self::Select(_, a, b)
            | Self::Larger(a, b, _)
            | Self::Smaller(a, b, _) => [a, b],
            Self::Root(a)
            | Self::Exp(a)
            | Self::Ln(a)
            | Self::Sin(a)
            | Self::Cos(a)
            | Self::Signed(a, _)
            | Self::Size(a, _) => [a, a],
        }
    }

    /// Returns the comparison that the step makes.
    fn comparison(self) -> Option<u32> {
        match self {
            Self::Size(_, comparison) | Self::Larger(_, _, comparison) | Self::Smaller(_, _, comparison) => {
                Some(comparison)
            }
            _ => None,
        }
    }

    /// Computes the number from its operands.
    fn of(self, a: &Bundle, b: &Bundle) -> Bundle {
        match self {
            Self::Plus(..) => a.plus(b),
            Self::Minus(..) => a.minus(b),
            Self::Times(..) => a.times(b),
            Self::Over(..) => a.over(b),
            Self::Power(..) => a.power(b),
            Self::Angle(..) => a.angle(b),
            Self::Root(_) => a.raised(0.5),
            Self::Exp(_) => a.exp(),
            Self::Ln(_) => a.ln(),
            Self::Sin(_) => a.sin(),
            Self::Cos(_) => a.cos(),
            Self::Signed(_, negative) => a.signed(negative),
            Self::Select(outcomes, ..) => Bundle::select(outcomes, a, b),
            Self::Size(_, comparison) => a.signed(comparisons::compare(comparison, a)[0]),
            Self::Larger(_, _, comparison) => Bundle::select(compare(comparison, a, b)[0], b, a),
            Self::Smaller(_, _, comparison) => Bundle::select(compare(comparison, b, a)[0], b, a),
        }
    }
}

/// Returns the rays along which both numbers are defined and a < b, and those along which a = b.
pub(super) fn compare(comparison: u32, a: &Bundle, b: &Bundle) -> [Outcomes; 2] {
    let defined = defined(a, b);
    comparisons::compare(comparison, &a.minus(b)).map(|rays| rays & defined)
}

/// Returns the rays along which both numbers are defined.
pub(super) fn defined(a: &Bundle, b: &Bundle) -> Outcomes {
    Outcomes::of(|ray| a.is_defined(ray) && b.is_defined(ray))
}

/// Most numbers are never computed.
#[derive(Clone, Copy, Debug)]
enum Recorded {
    /// Index among the bundles.
    Known(u32),
    Open(Step),
}

/// The numbers of a bundle of rays.
#[derive(Debug)]
pub(super) struct Recording {
    numbers: Vec<Recorded>,
    bundles: Vec<Bundle>,
    /// Numbers that are being computed.
    wanted: Vec<u32>,
    /// The numbers 0 and 1. Many are errors of rounding, or scales.
    zero: Option<u32>,
    one: Option<u32>,
}

impl Recording {
    pub(super) const fn new() -> Self {
        Self { numbers: Vec::new(), bundles: Vec::new(), wanted: Vec::new(), zero: None, one: None }
    }

    pub(super) fn clear(&mut self) {
        self.numbers.clear();
        self.bundles.clear();
        (self.zero, self.one) = (None, None);
    }

    pub(super) fn constant(&mut self, value: f64) -> u32 {
        let known = if value == 0.0 { self.zero } else { self.one.filter(|_| value == 1.0) };
        known.unwrap_or_else(|| {
            let number = self.add(Bundle::number(value));
            self.zero = self.zero.or((value == 0.0).then_some(number));
            self.one = self.one.or((value == 1.0).then_some(number));
            number
        })
    }

    pub(super) fn add(&mut self, number: Bundle) -> u32 {
        let known = self.known(number);
        self.push(known)
    }

    pub(super) fn record(&mut self, step: Step) -> u32 {
        match step {
            Step::Plus(a, zero) | Step::Plus(zero, a) | Step::Minus(a, zero) if Some(zero) == self.zero => a,
            Step::Times(a, one) | Step::Times(one, a) | Step::Over(a, one) if Some(one) == self.one => a,
            Step::Select(_, a, b) if a == b => a,
            _ => self.push(Recorded::Open(step)),
        }
    }

    fn known(&mut self, number: Bundle) -> Recorded {
        self.bundles.push(number);
        Recorded::Known(index(self.bundles.len() - 1))
    }

    fn push(&mut self, number: Recorded) -> u32 {
        self.numbers.push(number);
        index(self.numbers.len() - 1)
    }

    fn found(&self, number: u32) -> Option<&Bundle> {
        match self.numbers[number as usize] {
            Recorded::Known(bundle) => Some(&self.bundles[bundle as usize]),
            Recorded::Open(_) => None,
        }
    }

    /// Returns numbers, and computes what they need.
    pub(super) fn each<const N: usize>(&mut self, numbers: [u32; N]) -> [&Bundle; N] {
        numbers.into_iter().for_each(|number| self.compute(number));
        numbers.map(|number| self.found(number).expect("the number is computed"))
    }

    /// Makes a comparison that nothing has asked for.
    pub(super) fn make(&mut self, comparison: u32) {
        let makes = |number: &Recorded| matches!(number, Recorded::Open(step) if step.comparison() == Some(comparison));
        if let Some(number) = self.numbers.iter().position(makes) {
            self.compute(index(number));
        }
    }

    fn compute(&mut self, number: u32) {
        self.wanted.push(number);
        while let Some(&next) = self.wanted.last() {
            let Recorded::Open(step) = self.numbers[next as usize] else {
                self.wanted.pop();
                continue;
            };
            let [a, b] = step.operands();
            match [a, b].map(|operand| self.found(operand)) {
                [Some(a), Some(b)] => {
                    let found = step.of(a, b);
                    self.numbers[next as usize] = self.known(found);
                }
                [None, _] => self.wanted.push(a),
                [_, None] => self.wanted.push(b),
            }
        }
    }
}

fn index(number: usize) -> u32 {
    u32::try_from(number).expect("a routine has fewer than 2³² operations")
}
