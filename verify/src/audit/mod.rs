//! What is checked of a declared element, and the report of it.

mod entry;
mod momentum;
mod properties;
mod report;

use energy_dsl::{Declaration, Element, Kind, Textbook};

use crate::blocks::{Answer, Block, BlockName, Evaluate, NoAnswer, evaluate, largest};
use crate::finite_difference::{Stepped, antiderivative, sweep};
use crate::formula::{expected_blocks, rows};
use crate::geometry::rotate_all;
use crate::sample::{Sample, Sampler, has_points};

use self::entry::entry_name;
use self::momentum::momentum_errors;
pub use self::report::{Check, Line, Report, describe_failure};

/// How thorough an audit is.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// Random inputs for each element.
    pub samples: usize,
    /// What the inputs are drawn from.
    pub seed: u64,
}

impl Default for Options {
    fn default() -> Self {
        Self { samples: 200, seed: 1 }
    }
}

/// An audit of the elements of the catalogue with these names; of all of them for an empty list.
///
/// # Errors
/// The first name that the catalogue does not have.
pub fn audit_catalogue(names: &[&str], options: Options) -> Result<Report, String> {
    let catalogue = energy_elements::catalogue();
    if let Some(unknown) = names.iter().find(|name| energy_elements::find(name).is_none()) {
        let known = catalogue.iter().map(|entry| entry.declaration.name).collect::<Vec<_>>().join(", ");
        return Err(format!("no declared element is called {unknown}; there are {known}"));
    }
    let mut report = Report::default();
    for entry in catalogue.iter().filter(|e| names.is_empty() || names.contains(&e.declaration.name)) {
        let part = audit(entry.declaration, entry.evaluate, options);
        report.lines.extend(part.lines);
        report.refused.extend(part.refused);
    }
    Ok(report)
}

/// Audits one element.
#[must_use]
pub fn audit(declaration: &'static Declaration, evaluate: Evaluate, options: Options) -> Report {
    let mut report = Report::default();
    match Textbook::from_source(declaration.source) {
        Ok(formula) => {
            let mut auditor = Auditor { declaration, evaluate, formula, lines: Vec::new() };
            match auditor.run(options) {
                Ok(()) => report.lines = auditor.lines,
                Err(error) => report.refused.push((declaration.name.into(), error.to_string())),
            }
        }
        Err(errors) => report.refused.push((declaration.name.into(), errors.to_string())),
    }
    report
}

/// Audits an element in a test.
///
/// # Panics
/// When a check fails, with the element, the block, the entry, both values and the input.
pub fn assert_derivatives<E: Element>(samples: usize) {
    let options = Options { samples, ..Options::default() };
    let report = audit(E::DECLARATION, E::evaluate::<f64>, options);
    let mut problems: Vec<String> =
        report.refused.iter().map(|(name, why)| format!("{name} cannot be audited: {why}")).collect();
    problems.extend(report.failures().map(describe_failure));
    assert!(problems.is_empty(), "\n{}", problems.join("\n"));
}

struct Auditor {
    declaration: &'static Declaration,
    evaluate: Evaluate,
    formula: Textbook,
    lines: Vec<Line>,
}

/// A block found another way.
struct Route<'a> {
    name: String,
    numbers: &'a [f64],
    /// The order of convergence, where it was observed.
    order: Option<f64>,
}

impl Auditor {
    fn run(&mut self, options: Options) -> Result<(), NoAnswer> {
        let mut sampler = Sampler::new(self.declaration, options.seed);
        for _ in 0..options.samples {
            let sample = sampler.sample();
            let turn = sampler.rotation();
            let answer = self.answer(&sample)?;
            self.finite(&sample, &answer);
            for (block, expected) in answer.blocks.iter().zip(self.expected(&sample, &answer)) {
                let route =
                    Route { name: "textbook form by dual numbers".into(), numbers: &expected.numbers, order: None };
                self.compare(Check::DualNumbers, &sample, &answer, block, &route);
            }
            self.differences(&sample, &answer)?;
            self.symmetry(&sample, &answer);
            self.claims(&sample, &answer, |vectors| rotate_all(&turn, vectors))?;
            if has_points(self.declaration) && self.declaration.translation_invariant {
                self.momenta(&sample, &answer, |vectors| rotate_all(&turn, vectors));
            }
        }
        Ok(())
    }

    fn answer(&self, sample: &Sample) -> Result<Answer, NoAnswer> {
        evaluate(self.declaration, self.evaluate, &sample.inputs())
    }

    /// The expected blocks in the order of the answer's.
    fn expected(&self, sample: &Sample, answer: &Answer) -> Vec<Block> {
        let expected = expected_blocks(self.declaration, &self.formula, sample);
        answer
            .blocks
            .iter()
            .map(|block| {
                expected.iter().find(|e| e.name == block.name).expect("the same kind has the same blocks").clone()
            })
            .collect()
    }

    fn record(
        &mut self,
        check: Check,
        block: BlockName,
        error: f64,
        order: Option<f64>,
        detail: impl FnOnce() -> String,
    ) {
        let passed = error <= check.tolerance();
        let at = self.lines.iter().position(|l| l.check == check && l.block == block);
        let at = at.unwrap_or_else(|| {
            self.lines.push(Line {
                element: self.declaration.name,
                block,
                check,
                worst: -1.0,
                tolerance: check.tolerance(),
                passed: true,
                order: None,
                detail: String::new(),
            });
            self.lines.len() - 1
        });
        let line = &mut self.lines[at];
        line.passed &= passed;
        if let Some(order) = order {
            line.order = Some(line.order.map_or(order, |least: f64| least.min(order)));
        }
        // A NaN is worse than anything.
        if error > line.worst || (error.is_nan() && !line.worst.is_nan()) {
            line.worst = error;
            line.detail = detail();
        }
    }

    /// The length over which stepping an input changes an element.
    fn length(&self, sample: &Sample, stepped: Stepped) -> f64 {
        if stepped == Stepped::Positions { sample.feature_length(self.declaration) } else { 1.0 }
    }

    /// How large a block is by nature: what its antiderivative would need to change by its own size over a length. A derivative
    /// that vanishes is rounding error of about a unit of roundoff of this, on every route.
    fn natural_size(&self, sample: &Sample, answer: &Answer, block: BlockName) -> f64 {
        antiderivative(block, self.declaration.kind).map_or(0.0, |(lower, stepped)| {
            let lower_size = answer.block(lower).largest().max(self.natural_size(sample, answer, lower));
            lower_size / self.length(sample, stepped)
        })
    }

    /// Compares a block with what it should be, number by number, relative to the largest (or its natural size).
    fn compare(&mut self, check: Check, sample: &Sample, answer: &Answer, block: &Block, route: &Route<'_>) {
        let scale =
            largest(route.numbers).max(largest(&block.numbers)).max(self.natural_size(sample, answer, block.name));
        let errors = block.numbers.iter().zip(route.numbers).map(|(got, want)| (got - want).abs());
        let (entry, error) = errors
            .enumerate()
            .fold((0, 0.0_f64), |worst, next| if next.1 > worst.1 || next.1.is_nan() { next } else { worst });
        let relative = if scale == 0.0 { 0.0 } else { error / scale };
        let declaration = self.declaration;
        self.record(check, block.name, relative, route.order, || {
            format!(
                "  entry {}: generated code gives {:.17e}, {} gives {:.17e}, at{}",
                entry_name(declaration, block, entry),
                block.numbers[entry],
                route.name,
                route.numbers[entry],
                sample.describe(declaration)
            )
        });
    }

    fn finite(&mut self, sample: &Sample, answer: &Answer) {
        let declaration = self.declaration;
        for block in &answer.blocks {
            let bad = block.numbers.iter().position(|x| !x.is_finite());
            let flagged = answer.flags[block.name.order(declaration.kind)].any();
            let error = if bad.is_some() || flagged { f64::INFINITY } else { 0.0 };
            self.record(Check::Finite, block.name, error, None, || match bad {
                Some(entry) => format!(
                    "  entry {} is {}, at{}",
                    entry_name(declaration, block, entry),
                    block.numbers[entry],
                    sample.describe(declaration)
                ),
                None => format!("  flagged as degenerate or a kink, at{}", sample.describe(declaration)),
            });
        }
    }

    fn differences(&mut self, sample: &Sample, answer: &Answer) -> Result<(), NoAnswer> {
        let kind = self.declaration.kind;
        for block in &answer.blocks {
            let Some((lower, stepped)) = antiderivative(block.name, kind) else { continue };
            let length = self.length(sample, stepped);
            let found = sweep(sample, stepped, length, &block.numbers, |moved| {
                self.answer(moved).map(|answer| answer.block(lower).numbers.clone())
            })?;
            let route = Route { name: format!("differences of `{lower}`"), numbers: &found.best, order: found.order };
            self.compare(Check::FiniteDifferences, sample, answer, block, &route);
        }
        Ok(())
    }

    fn symmetry(&mut self, sample: &Sample, answer: &Answer) {
        let declaration = self.declaration;
        let Some(hessian) = answer.blocks.iter().find(|b| b.name == BlockName::Hessian) else { return };
        let n = hessian.columns;
        let transposed: Vec<f64> = (0..n * n).map(|e| hessian.numbers[e % n * n + e / n]).collect();
        let worst = (0..n * n).find(|&e| hessian.numbers[e] != transposed[e]);
        self.record(Check::Symmetry, hessian.name, if worst.is_some() { 1.0 } else { 0.0 }, None, || match worst {
            Some(entry) => format!(
                "  entry {} is {:.17e}, its mirror image {:.17e}, at{}",
                entry_name(declaration, hessian, entry),
                hessian.numbers[entry],
                transposed[entry],
                sample.describe(declaration)
            ),
            None => String::new(),
        });
    }

    /// Σ f = 0 follows from translation invariance for whatever has a potential, and so does Σ x × f = 0 from rotation
    /// invariance; a force that has none may keep either law or not, so it must keep what its own textbook form keeps.
    fn momenta(&mut self, sample: &Sample, answer: &Answer, turn: impl Fn(&[f64]) -> Vec<f64>) {
        let close = |a: f64, b: f64| (a - b).abs() <= 1e-10 * a.abs().max(b.abs());
        let here = rows(&self.formula, sample);
        let mut turned = sample.clone();
        turned.positions = turn(&sample.positions);
        let there = rows(&self.formula, &turned);
        let invariant = here.iter().zip(&there).all(|(a, b)| close(*a, *b));
        let squared = |rows: &[f64]| rows.iter().map(|c| c * c).sum::<f64>();
        let laws = match self.declaration.kind {
            Kind::Energy => vec![(BlockName::Gradient, true, invariant)],
            // ½ k CᵀC turns with the points if ‖C‖ does; its damping force only if every row of C does.
            Kind::Constraint => vec![
                (BlockName::Gradient, true, close(squared(&here), squared(&there))),
                (BlockName::Force, true, invariant),
            ],
            Kind::Force => {
                let (linear, angular) = momentum_errors(&sample.positions, &here, 0.0);
                vec![(BlockName::Force, linear < 1e-10, angular < 1e-10)]
            }
            Kind::Residual => Vec::new(),
        };
        let declaration = self.declaration;
        let detail =
            || format!("  summed over {} points, at{}", declaration.points.len(), sample.describe(declaration));
        for (block, linear_is_law, angular_is_law) in laws {
            let natural = self.natural_size(sample, answer, block);
            let (linear, angular) = momentum_errors(&sample.positions, &answer.block(block).numbers, natural);
            if linear_is_law {
                self.record(Check::LinearMomentum, block, linear, None, detail);
            }
            if angular_is_law {
                self.record(Check::AngularMomentum, block, angular, None, detail);
            }
        }
    }
}
