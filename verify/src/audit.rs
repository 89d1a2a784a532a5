//! What is checked of a declared element, and the report of it.

use energy_dsl::{Declaration, Element, Kind, Textbook};
use serde::Serialize;

use crate::blocks::{Answer, Block, BlockName, Evaluate, NoAnswer, evaluate, largest};
use crate::finite_difference::{Stepped, antiderivative, sweep};
use crate::formula::{expected_blocks, rows};
use crate::geometry::{cross, difference, rotate_all};
use crate::sample::{Sample, Sampler, has_points};

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

/// What is looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Check {
    /// Equal to hyper-dual numbers run through the textbook form.
    DualNumbers,
    /// Equal to finite differences of the block one order below.
    FiniteDifferences,
    /// Exactly symmetric.
    Symmetry,
    /// Σ f = 0.
    LinearMomentum,
    /// Σ x × f = 0.
    AngularMomentum,
    /// No number is NaN or infinite, and no condition is flagged, at an ordinary input.
    Finite,
}

impl Check {
    /// How a person calls it.
    #[must_use]
    pub fn title(self) -> &'static str {
        match self {
            Self::DualNumbers => "dual numbers",
            Self::FiniteDifferences => "finite differences",
            Self::Symmetry => "symmetry",
            Self::LinearMomentum => "Σ f = 0",
            Self::AngularMomentum => "Σ x × f = 0",
            Self::Finite => "finite",
        }
    }

    /// The largest error allowed, relative to the largest number of the block (or of what is summed).
    #[must_use]
    pub fn tolerance(self) -> f64 {
        match self {
            // The textbook form loses digits: what it leaves of them.
            Self::DualNumbers => 1e-9,
            Self::FiniteDifferences => 2e-7,
            Self::Symmetry | Self::Finite => 0.0,
            Self::LinearMomentum => 16.0 * f64::EPSILON / 2.0,
            Self::AngularMomentum => 1e-13,
        }
    }
}

/// One line of the report: the worst of a check of a block over all samples.
#[derive(Clone, Debug, Serialize)]
pub struct Line {
    /// The element.
    pub element: &'static str,
    /// The block.
    pub block: BlockName,
    /// What was checked.
    pub check: Check,
    /// The worst relative error.
    pub worst: f64,
    /// The error allowed.
    pub tolerance: f64,
    /// Whether it held.
    pub passed: bool,
    /// The least order of convergence that was observed, of finite differences.
    pub order: Option<f64>,
    /// Which entry, both values, and the input they were found at.
    pub detail: String,
}

/// The audit of one or more elements.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Report {
    /// All lines, element by element.
    pub lines: Vec<Line>,
    /// Elements that could not be audited, with the reason.
    pub refused: Vec<(String, String)>,
}

impl Report {
    /// Whether every check of every element held.
    #[must_use]
    pub fn passed(&self) -> bool {
        self.refused.is_empty() && self.lines.iter().all(|line| line.passed)
    }

    /// The lines that failed.
    pub fn failures(&self) -> impl Iterator<Item = &Line> {
        self.lines.iter().filter(|line| !line.passed)
    }

    /// How many different elements the report is about.
    #[must_use]
    pub fn elements(&self) -> usize {
        let mut names: Vec<&str> =
            self.lines.iter().map(|l| l.element).chain(self.refused.iter().map(|(name, _)| name.as_str())).collect();
        names.sort_unstable();
        names.dedup();
        names.len()
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

/// A failed check in words.
#[must_use]
pub fn describe_failure(line: &Line) -> String {
    format!(
        "{}: {} of block `{}` fails: error {:.2e}, allowed {:.2e}\n{}",
        line.element,
        line.check.title(),
        line.block,
        line.worst,
        line.tolerance,
        line.detail
    )
}

struct Auditor {
    declaration: &'static Declaration,
    evaluate: Evaluate,
    formula: Textbook,
    lines: Vec<Line>,
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
                self.compare(
                    Check::DualNumbers,
                    &sample,
                    block,
                    &expected.numbers,
                    "textbook form by dual numbers",
                    None,
                );
            }
            self.differences(&sample, &answer)?;
            self.symmetry(&sample, &answer);
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

    /// Compares a block with what it should be, number by number, relative to the largest.
    fn compare(
        &mut self,
        check: Check,
        sample: &Sample,
        block: &Block,
        expected: &[f64],
        source: &str,
        order: Option<f64>,
    ) {
        let scale = largest(expected).max(largest(&block.numbers));
        let errors = block.numbers.iter().zip(expected).map(|(got, want)| (got - want).abs());
        let (entry, error) = errors
            .enumerate()
            .fold((0, 0.0_f64), |worst, next| if next.1 > worst.1 || next.1.is_nan() { next } else { worst });
        let relative = if scale == 0.0 { 0.0 } else { error / scale };
        let declaration = self.declaration;
        self.record(check, block.name, relative, order, || {
            format!(
                "  entry {}: generated code gives {:.17e}, {source} gives {:.17e}, at{}",
                entry_name(declaration, block, entry),
                block.numbers[entry],
                expected[entry],
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
            let lower = match (block.name, kind) {
                (BlockName::Jacobian, Kind::Residual) => Some((BlockName::Residual, Stepped::Positions)),
                (BlockName::Jacobian, _) => Some((BlockName::Constraint, Stepped::Positions)),
                (name, _) => antiderivative(name),
            };
            let Some((lower, stepped)) = lower else { continue };
            let length = if stepped == Stepped::Positions { sample.feature_length(self.declaration) } else { 1.0 };
            let found = sweep(sample, stepped, length, &block.numbers, |moved| {
                self.answer(moved).map(|answer| answer.block(lower).numbers.clone())
            })?;
            let source = format!("differences of `{lower}`");
            self.compare(Check::FiniteDifferences, sample, block, &found.best, &source, found.order);
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
                let (linear, angular) = momentum_errors(&sample.positions, &here);
                vec![(BlockName::Force, linear < 1e-10, angular < 1e-10)]
            }
            Kind::Residual => Vec::new(),
        };
        let declaration = self.declaration;
        let detail =
            || format!("  summed over {} points, at{}", declaration.points.len(), sample.describe(declaration));
        for (block, linear_is_law, angular_is_law) in laws {
            let (linear, angular) = momentum_errors(&sample.positions, &answer.block(block).numbers);
            if linear_is_law {
                self.record(Check::LinearMomentum, block, linear, None, detail);
            }
            if angular_is_law {
                self.record(Check::AngularMomentum, block, angular, None, detail);
            }
        }
    }
}

/// |Σ f| and |Σ (x − x₀) × f|, relative to the largest force and the largest torque.
fn momentum_errors(positions: &[f64], force: &[f64]) -> (f64, f64) {
    let (mut sum, mut torque, mut lever) = ([0.0; 3], [0.0; 3], 0.0_f64);
    for (x, f) in positions.chunks(3).zip(force.chunks(3)) {
        let arm = difference(x, &positions[..3]);
        let turning = cross(&arm, f);
        for axis in 0..3 {
            sum[axis] += f[axis];
            torque[axis] += turning[axis];
        }
        lever = lever.max(largest(&arm) * largest(f));
    }
    let relative = |value: f64, scale: f64| if scale == 0.0 { value } else { value / scale };
    (relative(largest(&sum), largest(force)), relative(largest(&torque), lever))
}

/// An entry by points and axes, as in `(x1.y, x3.z)`.
fn entry_name(declaration: &Declaration, block: &Block, entry: usize) -> String {
    let coordinate = |number: usize| {
        let mut number = number;
        for point in declaration.points {
            if number < point.size {
                let axis =
                    if point.size == 1 { String::new() } else { format!(".{}", ["x", "y", "z", "w"][number.min(3)]) };
                return format!("{}{axis}", point.name);
            }
            number -= point.size;
        }
        format!("component {number}")
    };
    let (row, column) = (entry / block.columns.max(1), entry % block.columns.max(1));
    match block.name {
        BlockName::Energy => "U".into(),
        BlockName::Constraint | BlockName::Residual => format!("row {column}"),
        BlockName::Gradient | BlockName::Force => coordinate(column),
        BlockName::Jacobian => format!("(row {row}, {})", coordinate(column)),
        _ => format!("({}, {})", coordinate(row), coordinate(column)),
    }
}
