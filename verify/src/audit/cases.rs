//! Inputs with their expected results, drawn in the domain of the formula.

use std::cell::OnceCell;

use super::subject::Subject;
use crate::blocks::{Block, BlockName};
use crate::formula::expected_blocks;
use crate::geometry::{Rotation, rotate_all};
use crate::multiprecision::{TrueBlock, truth_of_ordinary};
use crate::sample::{Sample, Sampler};

/// An input with the expected results, which do not depend on the code under audit. They are computed when they are
/// first needed: planted faults are mostly noticed at one of the first inputs.
pub(super) struct Case<'a> {
    /// The element without faults.
    subject: &'a Subject,
    pub(super) sample: Sample,
    pub(super) turn: Rotation,
    /// Whether the formula has no value at some inputs of the kind.
    pub(super) is_bounded: bool,
    dual: OnceCell<Vec<Block>>,
    truth: OnceCell<Vec<TrueBlock>>,
}

impl<'a> Case<'a> {
    /// Creates the case of a given input. Multi-precision is slow, so most cases are without.
    pub(super) fn new(subject: &'a Subject, sample: Sample, turn: Rotation, with_truth: bool) -> Self {
        let truth = if with_truth { OnceCell::new() } else { OnceCell::from(Vec::new()) };
        Self { subject, sample, turn, is_bounded: false, dual: OnceCell::new(), truth }
    }

    pub(super) fn turned(&self, vectors: &[f64]) -> Vec<f64> {
        rotate_all(&self.turn, vectors)
    }

    /// Returns the blocks by dual numbers through the textbook form.
    pub(super) fn duals(&self) -> &[Block] {
        let Subject { declaration, formula, meter, .. } = self.subject;
        self.dual.get_or_init(|| {
            meter.duals();
            expected_blocks(declaration, formula, &self.sample)
        })
    }

    pub(super) fn dual(&self, name: BlockName) -> &Block {
        self.duals().iter().find(|block| block.name == name).expect("the same kind has the same blocks")
    }

    /// Returns the blocks in multi-precision; empty for cases without.
    pub(super) fn truths(&self) -> &[TrueBlock] {
        let Subject { declaration, formula, meter, .. } = self.subject;
        self.truth.get_or_init(|| {
            let truth = truth_of_ordinary(declaration, formula, &self.sample, DIGITS);
            meter.truth(truth.bits);
            truth.blocks
        })
    }

    pub(super) fn truth(&self, name: BlockName) -> Option<&TrueBlock> {
        self.truths().iter().find(|truth| truth.block.name == name)
    }
}

/// Digits of the multi-precision blocks.
const DIGITS: usize = 25;
/// One in this many inputs has integer coordinates.
const LATTICE: usize = 5;
/// Attempts to draw an input in the domain of the formula, for each kind of input.
const ATTEMPTS: usize = 8;
/// Ranges of principal stretches that are tried where free points leave the domain, from wide to narrow.
const STRETCHES: [(f64, f64); 4] = [(0.5, 2.0), (0.8, 1.25), (0.95, 1.05), (0.99, 1.01)];
/// Factors by which points without rest shape are brought together where they leave the domain.
const SCALES: [f64; 4] = [0.5, 0.25, 0.125, 0.0625];

/// The inputs of an audit.
pub(super) struct Cases<'a> {
    pub(super) list: Vec<Case<'a>>,
    /// Inputs that were drawn and at which the formula has no value, as in the logarithm of an inverted element's
    /// volume, or a value beyond the range of doubles: their number, and the first ones.
    pub(super) outside: usize,
    pub(super) outside_inputs: Vec<Sample>,
    /// Inputs that were not found in the domain.
    pub(super) missing: usize,
}

/// Draws inputs from a seed; the first `with_truth` get multi-precision blocks.
pub(super) fn cases(subject: &Subject, samples: usize, with_truth: usize, seed: u64) -> Cases<'_> {
    let mut drawing = Drawing { subject, sampler: subject.sampler(seed), outside: 0, outside_inputs: Vec::new() };
    let mut list: Vec<Case<'_>> = Vec::new();
    let mut missing = 0;
    for number in 0..samples {
        // A formula without any value would take all attempts each time.
        let Some(sample) = drawing.sample(number % LATTICE == LATTICE - 1).filter(|_| missing < 3 || !list.is_empty())
        else {
            missing += 1;
            if list.is_empty() && missing >= 3 {
                missing = samples;
                break;
            }
            continue;
        };
        list.push(Case::new(subject, sample, drawing.sampler.rotation(), number < with_truth));
    }
    let Drawing { outside, outside_inputs, .. } = drawing;
    list.iter_mut().for_each(|case| case.is_bounded = outside > 0);
    Cases { list, outside, outside_inputs, missing }
}

struct Drawing<'a> {
    subject: &'a Subject,
    sampler: Sampler<'a>,
    outside: usize,
    outside_inputs: Vec<Sample>,
}

impl Drawing<'_> {
    /// Draws an input at which the formula has a value in the range of doubles; `None` if there seems to be none.
    fn sample(&mut self, is_lattice: bool) -> Option<Sample> {
        for attempt in 0..ATTEMPTS {
            let is_lattice = is_lattice && attempt == 0;
            let sample = if is_lattice { self.sampler.lattice_sample() } else { self.sampler.sample() };
            if self.is_inside(&sample) {
                // Integer coordinates may be degenerate.
                let is_degenerate = is_lattice && is_flagged(self.subject, &sample);
                return Some(if is_degenerate { self.ordinary()? } else { sample });
            }
        }
        self.near_rest()
    }

    fn ordinary(&mut self) -> Option<Sample> {
        for _ in 0..ATTEMPTS {
            let sample = self.sampler.sample();
            if self.is_inside(&sample) {
                return Some(sample);
            }
        }
        self.near_rest()
    }

    /// Draws an input of ever smaller strain or size.
    fn near_rest(&mut self) -> Option<Sample> {
        for step in 0..STRETCHES.len() {
            for _ in 0..ATTEMPTS {
                let strained = self.sampler.strained_sample(STRETCHES[step]);
                let sample = strained.unwrap_or_else(|| self.sampler.scaled_sample(SCALES[step]));
                if self.is_inside(&sample) {
                    return Some(sample);
                }
            }
        }
        None
    }

    fn is_inside(&mut self, sample: &Sample) -> bool {
        let is_outside = self.subject.is_unusable(sample);
        if is_outside {
            self.outside += 1;
            if self.outside_inputs.len() < 2 {
                self.outside_inputs.push(sample.clone());
            }
        }
        !is_outside
    }
}

/// Whether the element flags an input as degenerate, so that no result can be expected.
fn is_flagged(subject: &Subject, sample: &Sample) -> bool {
    subject.answer(sample).is_ok_and(|answer| answer.flags.iter().any(|flags| flags.any()))
}
