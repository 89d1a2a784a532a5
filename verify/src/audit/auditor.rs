//! An element under audit, and the findings.

use std::collections::BTreeMap;

use energy_dsl::Declaration;

use super::report::{Check, Line};
use super::subject::Subject;
use crate::blocks::{Answer, BlockName, NoAnswer};
use crate::finite_difference::{Stepped, antiderivative};
use crate::sample::Sample;

/// The element under audit, and the findings so far.
pub(super) struct Auditor<'a> {
    pub(super) subject: &'a Subject,
    pub(super) declaration: &'a Declaration,
    pub(super) lines: Vec<Line>,
    places: BTreeMap<(Check, BlockName), usize>,
    /// For each derivative, the number of inputs, and of those where differences stayed on one side of every kink.
    differences: BTreeMap<BlockName, (usize, usize)>,
}

/// The result of one comparison.
pub(super) struct Finding<'a> {
    pub(super) check: Check,
    pub(super) block: BlockName,
    pub(super) error: f64,
    pub(super) order: Option<f64>,
    pub(super) sample: &'a Sample,
}

impl<'a> Auditor<'a> {
    pub(super) fn new(subject: &'a Subject) -> Self {
        Self {
            subject,
            declaration: &subject.declaration,
            lines: Vec::new(),
            places: BTreeMap::new(),
            differences: BTreeMap::new(),
        }
    }

    /// Counts an input at which the differences of a derivative were taken, or could not be.
    pub(super) fn count_differences(&mut self, block: BlockName, taken: bool) {
        if antiderivative(block, self.declaration.kind).is_some() {
            let (inputs, compared) = self.differences.entry(block).or_default();
            *inputs += 1;
            *compared += usize::from(taken);
        }
    }

    /// Returns the largest number of inputs at which no differences of a derivative were taken. Fails the audit if
    /// these are too many to trust the others.
    pub(super) fn rejected_differences(&mut self, sample: &Sample) -> usize {
        let mut most = 0;
        for (block, (inputs, compared)) in self.differences.clone() {
            let rejected = inputs - compared;
            if rejected > 0 {
                most = most.max(rejected);
                let error = rejected as f64 / inputs as f64;
                let finding = Finding { check: Check::OneSide, block, error, order: None, sample };
                self.record(&finding, || {
                    format!(
                        "  at {rejected} of {inputs} inputs, a kink or the boundary of two regions is too near for \
                         differences of any step"
                    )
                });
            }
        }
        most
    }

    pub(super) fn answer(&self, sample: &Sample) -> Result<Answer, NoAnswer> {
        self.subject.answer(sample)
    }

    /// Records a finding. `detail` is evaluated only if it is the worst of its check and block.
    pub(super) fn record(&mut self, finding: &Finding<'_>, detail: impl FnOnce() -> String) {
        let &Finding { check, block, error, order, sample } = finding;
        let tolerance = self.subject.tolerance(check);
        let lines = &mut self.lines;
        let at = *self.places.entry((check, block)).or_insert_with(|| {
            lines.push(Line::new(self.declaration.name.clone(), block, check, tolerance));
            lines.len() - 1
        });
        let line = &mut self.lines[at];
        line.inputs += 1;
        line.passed &= error <= tolerance;
        if let Some(order) = order {
            line.order = Some(line.order.map_or(order, |least: f64| least.min(order)));
        }
        // NaN is worse than any error.
        if line.input.is_none() || error > line.worst || (error.is_nan() && !line.worst.is_nan()) {
            line.worst = error;
            line.detail = detail();
            line.input = Some(sample.clone());
        }
    }

    /// Returns the length over which stepping an input changes an element.
    pub(super) fn length(&self, sample: &Sample, stepped: Stepped) -> f64 {
        if stepped == Stepped::Positions { sample.feature_length(self.declaration) } else { 1.0 }
    }

    /// Returns the natural size of a block. For a derivative, it is the change per length that changes the
    /// antiderivative by its own size. For other blocks, it is the change of the block over a length, by its
    /// derivative. If a block vanishes, every route leaves rounding errors of about one roundoff of this size.
    pub(super) fn natural_size(&self, sample: &Sample, answer: &Answer, block: BlockName) -> f64 {
        let kind = self.declaration.kind;
        if let Some((lower, stepped)) = antiderivative(block, kind) {
            let lower_size = answer.block(lower).largest().max(self.natural_size(sample, answer, lower));
            return lower_size / self.length(sample, stepped);
        }
        self.derivative(block)
            .map_or(0.0, |upper| answer.block(upper).largest() * self.length(sample, Stepped::Positions))
    }

    /// Returns the change of a block over a length, by its derivatives of all orders. If a block vanishes with its
    /// antiderivative, as at a minimum, this is the size that differences have rounding errors of.
    pub(super) fn size_of_derivatives(&self, sample: &Sample, answer: &Answer, block: BlockName) -> f64 {
        let length = self.length(sample, Stepped::Positions);
        let Some(upper) = self.derivative(block) else { return 0.0 };
        length * answer.block(upper).largest().max(self.size_of_derivatives(sample, answer, upper))
    }

    fn derivative(&self, block: BlockName) -> Option<BlockName> {
        let kind = self.declaration.kind;
        BlockName::of(self.declaration).into_iter().find(|&upper| {
            antiderivative(upper, kind).is_some_and(|(lower, stepped)| lower == block && stepped == Stepped::Positions)
        })
    }
}
