//! Numbers along rays that are computed when they are asked for.
//!
//! At a singular input, a routine records what it would compute. Only comparisons and results ask for numbers. If the
//! values tell that there is no limit, no derivative is computed.

use super::bundle::Bundle;
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
            | Self::Select(_, a, b) => [a, b],
            Self::Root(a) | Self::Exp(a) | Self::Ln(a) | Self::Sin(a) | Self::Cos(a) | Self::Signed(a, _) => [a, a],
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
        }
    }
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
}

impl Recording {
    pub(super) const fn new() -> Self {
        Self { numbers: Vec::new(), bundles: Vec::new(), wanted: Vec::new() }
    }

    pub(super) fn clear(&mut self) {
        self.numbers.clear();
        self.bundles.clear();
    }

    pub(super) fn add(&mut self, number: Bundle) -> u32 {
        let known = self.known(number);
        self.push(known)
    }

    pub(super) fn record(&mut self, step: Step) -> u32 {
        self.push(Recorded::Open(step))
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
