//! Losses of digits near rest and near singularities.

use fastrand::Rng;

use super::accuracy::{ROUNDOFF, in_roundoffs, true_amplifications};
use super::auditor::Auditor;
use super::culprit::culprit;
use super::entry::entry_name;
use super::extremes::Extreme;
use super::report::{Check, Warning};
use crate::blocks::{Answer, Block, largest};
use crate::chart;
use crate::multiprecision::{TrueBlock, Truth, truth_of_extreme, worse};
use crate::sample::Sample;

/// The error that is not worth a warning, in units of roundoff times max(1, κ).
const ALLOWED: f64 = 1e3;
/// The difference from a limit that is not worth a warning, in units of roundoff: limits are taken at a distance.
const BESIDE_A_LIMIT: f64 = 1e9;
/// Digits of the multi-precision blocks.
const DIGITS: usize = 25;

/// The losses at all inputs so far.
#[derive(Default)]
pub(super) struct Losses {
    /// The worst loss at each kind of place, with the block's order of differentiation.
    worst: Vec<Loss>,
    /// Number of inputs.
    pub(super) inputs: usize,
}

struct Loss {
    extreme: Extreme,
    block: Block,
    is_flagged: bool,
    error: f64,
    error_kappa: f64,
}

impl Extreme {
    fn loss(&self, block: &Block, is_flagged: bool, [error, error_kappa]: [f64; 2]) -> Loss {
        Loss { extreme: self.clone(), block: block.clone(), is_flagged, error, error_kappa }
    }
}

/// Returns the first of two blocks, if they are equal but for the distance at which they were taken.
fn agreed((a, b): (TrueBlock, TrueBlock)) -> Option<TrueBlock> {
    const CLOSE: f64 = 1e-12;
    let pairs = a.block.numbers.iter().zip(&b.block.numbers);
    let difference = pairs.map(|(a, b)| (a.clone() - b.clone()).to_f64().abs()).fold(0.0, worse);
    (difference <= CLOSE * a.largest()).then_some(a)
}

impl Losses {
    /// Returns one warning for each kind of place, with the subexpression that loses the digits.
    pub(super) fn warnings(self, auditor: &Auditor<'_>) -> Vec<Warning> {
        let warning = |loss: Loss| {
            let Loss { extreme, block, is_flagged, error, error_kappa } = loss;
            let order = block.name.order(auditor.declaration.kind);
            // An infinite result has lost all digits.
            let mut found = culprit(auditor.subject, &extreme.sample, order, error.min(1.0 / ROUNDOFF));
            if is_flagged && found.subexpression.is_none() {
                found.proposal = "the formula as written has this limit, which its compiled form does not find".into();
            }
            Warning {
                block: block.name,
                place: extreme.place,
                is_flagged,
                error,
                error_kappa,
                subexpression: found.subexpression,
                proposal: found.proposal,
                input: extreme.sample,
            }
        };
        self.worst.into_iter().map(warning).collect()
    }

    /// Keeps the loss if it is the worst at its kind of place.
    fn keep(&mut self, loss: Loss) {
        match self.worst.iter_mut().find(|known| known.extreme.kind() == loss.extreme.kind()) {
            Some(known) if known.error_kappa >= loss.error_kappa => {}
            Some(known) => *known = loss,
            None => self.worst.push(loss),
        }
    }
}

impl Auditor<'_> {
    /// Looks at one input: blocks must be finite or flagged, and unflagged ones should have the digits that the
    /// rounding of edges leaves.
    pub(super) fn extreme(&mut self, extreme: Extreme, losses: &mut Losses) {
        let (subject, sample) = (self.subject, &extreme.sample);
        if subject.is_outside(sample) {
            return;
        }
        let Ok(answer) = self.answer(sample) else { return };
        let truth = truth_of_extreme(&subject.declaration, &subject.formula, sample, None, DIGITS);
        subject.meter.truth(truth.bits);
        losses.inputs += 1;
        let (mut kappas, mut limits) = (None, None);
        for (number, block) in answer.blocks.iter().enumerate() {
            let Some(exact) = truth.blocks.get(number).filter(|exact| exact.block.name == block.name) else { continue };
            let is_flagged = answer.flags[block.name.order(self.declaration.kind)].any();
            if !is_flagged {
                self.finite_or_too_large(&extreme, block, exact);
            }
            if is_flagged || !exact.is_defined {
                let limits = limits.get_or_insert_with(|| self.limits(&extreme));
                let Some(error) = limits[number].as_ref().map(|limit| self.loss(&extreme, &answer, block, limit))
                else {
                    continue;
                };
                if error > BESIDE_A_LIMIT {
                    losses.keep(extreme.loss(block, is_flagged, [error, error]));
                }
                continue;
            }
            let error = self.loss(&extreme, &answer, block, exact);
            if error.is_nan() || error <= ALLOWED {
                continue;
            }
            let kappa = kappas.get_or_insert_with(|| self.amplifications(&extreme, &truth))[number];
            let error_kappa = error / kappa.max(1.0);
            if error_kappa > ALLOWED {
                losses.keep(extreme.loss(block, is_flagged, [error, error_kappa]));
            }
        }
    }

    /// Returns the limit of each block; `None` without a limit. It is the limit of the formula along random
    /// directions, in multi-precision.
    fn limits(&self, extreme: &Extreme) -> Vec<Option<TrueBlock>> {
        const DISTANCE: f64 = 1.0 / (1_u128 << 100) as f64;
        const DIRECTIONS: usize = 4;
        let (subject, sample) = (self.subject, &extreme.sample);
        let mut random = Rng::with_seed(1);
        let mut found: Option<Vec<Option<TrueBlock>>> = None;
        for _ in 0..DIRECTIONS {
            let scale = largest(&sample.positions).max(1.0) * DISTANCE;
            let mut positions: Vec<f64> = sample.positions.iter().map(|_| scale * (2.0 * random.f64() - 1.0)).collect();
            chart::along(&subject.declaration, &sample.positions, &mut positions);
            let none = |numbers: &[f64]| vec![0.0; numbers.len()];
            let offset = Sample {
                positions,
                parameters: none(&sample.parameters),
                rest: none(&sample.rest),
                velocities: none(&sample.velocities),
            };
            let near = truth_of_extreme(&subject.declaration, &subject.formula, sample, Some(&offset), DIGITS);
            subject.meter.truth(near.bits);
            let defined = near.blocks.into_iter().map(|block| block.is_defined.then_some(block));
            found = Some(match found {
                None => defined.collect(),
                Some(known) => known.into_iter().zip(defined).map(|(a, b)| a.zip(b).and_then(agreed)).collect(),
            });
        }
        found.unwrap_or_default()
    }

    /// Returns the error in roundoffs; 0 if there is nothing to compare with.
    fn loss(&self, extreme: &Extreme, answer: &Answer, block: &Block, exact: &TrueBlock) -> f64 {
        let largest = exact.largest();
        // Numbers below the range of doubles have no digits to lose.
        if !exact.is_defined || largest.is_infinite() || largest < f64::MIN_POSITIVE / ROUNDOFF {
            return 0.0;
        }
        in_roundoffs(exact, &block.numbers, self.natural_size(&extreme.sample, answer, block.name))
    }

    /// Returns κ of each block.
    fn amplifications(&self, extreme: &Extreme, truth: &Truth) -> Vec<f64> {
        let (kappas, bits) = true_amplifications(self.subject, &extreme.sample, &truth.blocks);
        self.subject.meter.truth(bits);
        kappas
    }

    /// Checks that an unflagged block is finite, or infinite because its true numbers are.
    fn finite_or_too_large(&mut self, extreme: &Extreme, block: &Block, exact: &TrueBlock) {
        let is_excused = |x: f64| x.is_finite() || (x.is_infinite() && exact.largest().is_infinite());
        let bad = block.numbers.iter().position(|&x| !is_excused(x));
        let error = if bad.is_some() { f64::INFINITY } else { 0.0 };
        let declaration = self.declaration;
        self.note(Check::Finite, block.name, error, &extreme.sample, || {
            bad.map_or_else(String::new, |entry| {
                format!(
                    "  {}: entry {} is {} without a flag, at{}",
                    extreme.place,
                    entry_name(declaration, block, entry),
                    block.numbers[entry],
                    extreme.sample.describe(declaration)
                )
            })
        });
    }
}
