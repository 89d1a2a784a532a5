//! Laws that hold for any formula: blocks are finite, symmetric and balanced, and do not depend on the origin or the
//! units.

use energy_compiler::unit_exponents;
use energy_dsl::{Declaration, Field, Kind};

use super::accuracy::enters_as_edges;
use super::auditor::{Auditor, Finding};
use super::cases::Case;
use super::entry::entry_name;
use super::momentum::momentum_errors;
use super::remedy::domain;
use super::report::Check;
use crate::blocks::{Answer, Block, BlockName, NoAnswer, largest};
use crate::eigenvalues::eigenvalues;
use crate::formula::rows;
use crate::sample::{Sample, has_points};

impl Auditor<'_> {
    /// Checks every law at one input.
    pub(super) fn laws(&mut self, case: &Case<'_>, answer: &Answer) -> Result<(), NoAnswer> {
        let has_points = has_points(self.declaration);
        self.finite(&case.sample, answer);
        self.repeats(&case.sample, answer);
        self.symmetry(&case.sample, answer);
        self.claims(case, answer)?;
        self.units(&case.sample)?;
        if has_points && self.declaration.translation_invariant {
            self.momenta(case, answer);
        }
        if enters_as_edges(self.declaration) {
            self.translation(&case.sample)?;
        }
        if has_points && self.subject.has_velocities() {
            self.damping(&case.sample, answer)?;
        }
        Ok(())
    }

    pub(super) fn finite(&mut self, sample: &Sample, answer: &Answer) {
        let declaration = self.declaration;
        for block in &answer.blocks {
            let bad = block.numbers.iter().position(|x| !x.is_finite());
            let flagged = answer.flags[block.name.order(declaration.kind)].any();
            let error = if bad.is_some() || flagged { f64::INFINITY } else { 0.0 };
            self.note(Check::Finite, block.name, error, sample, || match bad {
                Some(entry) => {
                    format!(
                        "  entry {} is {}, at{}\n  if the formula is not used there, state where it is, as in {}",
                        entry_name(declaration, block, entry),
                        block.numbers[entry],
                        sample.describe(declaration),
                        domain(declaration)
                    )
                }
                None => format!("  flagged as degenerate or a kink, at{}", sample.describe(declaration)),
            });
        }
    }

    /// Checks that a value where the formula is undefined is flagged.
    pub(super) fn outside(&mut self, sample: &Sample) {
        let Ok(answer) = self.answer(sample) else { return };
        let Some(block) = answer.blocks.first() else { return };
        if !rows(&self.subject.formula, sample).iter().any(|row| row.is_nan()) {
            // The value overflows, or only the next state has none. Its routine has separate flags.
            return;
        }
        let error = if answer.flags[0].degenerate { 0.0 } else { f64::INFINITY };
        let declaration = self.declaration;
        self.note(Check::Outside, block.name, error, sample, || {
            format!(
                "  the formula has no value, but the result is {:?} without a flag, at{}",
                block.numbers,
                sample.describe(declaration)
            )
        });
    }

    /// Records a finding without an order of convergence.
    pub(super) fn note(
        &mut self,
        check: Check,
        block: BlockName,
        error: f64,
        sample: &Sample,
        detail: impl FnOnce() -> String,
    ) {
        self.record(&Finding { check, block, error, order: None, sample }, detail);
    }

    /// Routines also return blocks of lower order, which must be the same from each routine.
    fn repeats(&mut self, sample: &Sample, answer: &Answer) {
        let declaration = self.declaration;
        for (routine, repeat) in &answer.repeats {
            let block = answer.block(repeat.name);
            let (entry, error) = worst(&block.numbers, &repeat.numbers);
            let scale = block.largest().max(self.natural_size(sample, answer, block.name));
            let relative = if error == 0.0 { 0.0 } else { error / scale };
            self.note(Check::Routines, block.name, relative, sample, || {
                format!(
                    "  entry {}: {:.17e}, but `{routine}` returns {:.17e}, at{}",
                    entry_name(declaration, block, entry),
                    block.numbers[entry],
                    repeat.numbers[entry],
                    sample.describe(declaration)
                )
            });
        }
    }

    fn symmetry(&mut self, sample: &Sample, answer: &Answer) {
        let declaration = self.declaration;
        let Some(hessian) = answer.blocks.iter().find(|b| b.name == BlockName::Hessian) else { return };
        let n = hessian.columns;
        let mirrored = |e: usize| hessian.numbers[e % n * n + e / n];
        let worst = (0..n * n).find(|&e| hessian.numbers[e] != mirrored(e));
        let error = if worst.is_some() { 1.0 } else { 0.0 };
        self.note(Check::Symmetry, hessian.name, error, sample, || match worst {
            Some(entry) => format!(
                "  entry {} is {:.17e}, its mirror image {:.17e}, at{}",
                entry_name(declaration, hessian, entry),
                hessian.numbers[entry],
                mirrored(entry),
                sample.describe(declaration)
            ),
            None => String::new(),
        });
    }

    /// Checks momentum balance. With a potential, translation invariance implies Σ f = 0 and rotation invariance
    /// implies Σ x × f = 0. A force without a potential may obey either law or not, and must do what its own textbook
    /// form does.
    fn momenta(&mut self, case: &Case<'_>, answer: &Answer) {
        let sample = &case.sample;
        let close = |a: f64, b: f64| (a - b).abs() <= 1e-10 * a.abs().max(b.abs());
        let formula = &self.subject.formula;
        let here = rows(formula, sample);
        let there = rows(formula, &Sample { positions: case.turned(&sample.positions), ..sample.clone() });
        let invariant = here.iter().zip(&there).all(|(a, b)| close(*a, *b));
        let squared = |rows: &[f64]| rows.iter().map(|c| c * c).sum::<f64>();
        let laws = match self.declaration.kind {
            Kind::Energy => vec![(BlockName::Gradient, true, invariant)],
            // ½ k CᵀC is rotation invariant if ‖C‖ is; the damping force only if every row of C is.
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
                self.note(Check::LinearMomentum, block, linear, sample, detail);
            }
            if angular_is_law {
                self.note(Check::AngularMomentum, block, angular, sample, detail);
            }
        }
    }

    /// Checks that a translation that preserves every coordinate difference exactly preserves all bits.
    fn translation(&mut self, sample: &Sample) -> Result<(), NoAnswer> {
        const GRID: f64 = (1 << 20) as f64;
        const SHIFT: [f64; 3] = [64.0, -128.0, 32.0];
        let here = Sample {
            positions: sample.positions.iter().map(|x| (x * GRID).round() / GRID).collect(),
            ..sample.clone()
        };
        let positions = here.positions.iter().enumerate().map(|(i, x)| x + SHIFT[i % 3]).collect();
        let there = Sample { positions, ..here.clone() };
        self.same_bits(Check::Translation, &here, &there, "moved by (64, −128, 32)", |_| 0)
    }

    /// Checks that a change of units to 8 kg, ¼ m and 2 s multiplies each block by a power of two. Skipped unless all
    /// units are known.
    fn units(&mut self, sample: &Sample) -> Result<(), NoAnswer> {
        let declaration = self.declaration;
        let result = match declaration.kind {
            Kind::Energy => [1.0, 2.0, -2.0, 0.0],
            Kind::Force => [1.0, 1.0, -2.0, 0.0],
            Kind::Constraint | Kind::Residual => return Ok(()),
        };
        if !has_points(declaration) || !scaled_fields(declaration).all(|field| !field.unit.is_empty()) {
            return Ok(());
        }
        let annotated = scaled_fields(declaration).any(|field| field.unit != "1" && field.unit != "rad");
        let Some(exponents) = fields(declaration).collect::<Option<Vec<_>>>() else { return Ok(()) };
        if !annotated {
            return Ok(());
        }
        let mut exponents = exponents.into_iter();
        let mut scaled = |numbers: &[f64]| -> Vec<f64> {
            numbers.iter().map(|x| x * f64::from(power(exponents.next().unwrap_or(NUMBER))).exp2()).collect()
        };
        let (rest, parameters) = (scaled(&sample.rest), scaled(&sample.parameters));
        let by = |numbers: &[f64], unit: [f64; 4]| -> Vec<f64> {
            numbers.iter().map(|x| x * f64::from(power(unit)).exp2()).collect()
        };
        let there = Sample {
            parameters,
            rest,
            positions: by(&sample.positions, LENGTH),
            velocities: by(&sample.velocities, [0.0, 1.0, -1.0, 0.0]),
        };
        // Each derivative divides by a length or a velocity.
        let shift = |block: BlockName| {
            let lengths = match block {
                BlockName::Gradient | BlockName::ForceByPosition => 1,
                BlockName::Hessian => 2,
                _ => 0,
            };
            let velocities = i32::from(block == BlockName::ForceByVelocity);
            power(result) - lengths * power(LENGTH) - velocities * power([0.0, 1.0, -1.0, 0.0])
        };
        self.same_bits(Check::Units, sample, &there, "in kilograms of 8, metres of ¼, seconds of 2", shift)
    }

    /// Whether two lists of numbers are equal up to a power of two.
    fn same_bits(
        &mut self,
        check: Check,
        here: &Sample,
        there: &Sample,
        how: &str,
        shift: impl Fn(BlockName) -> i32,
    ) -> Result<(), NoAnswer> {
        let (before, after) = (self.answer(here)?, self.answer(there)?);
        let declaration = self.declaration;
        // The blocks of a state have units of their own.
        let of_kind = BlockName::of_kind(declaration.kind);
        let pairs = before.blocks.iter().zip(&after.blocks).filter(|(block, _)| of_kind.contains(&block.name));
        for (a, b) in pairs {
            let expected: Vec<f64> = a.numbers.iter().map(|x| x * f64::from(shift(a.name)).exp2()).collect();
            let (entry, error) = worst(&expected, &b.numbers);
            let scale = largest(&expected);
            let relative = if error == 0.0 { 0.0 } else { error / scale };
            self.note(check, a.name, relative, here, || {
                format!(
                    "  entry {}: {:.17e} was to become {:.17e}, but is {:.17e} {how}, at{}",
                    entry_name(declaration, a, entry),
                    a.numbers[entry],
                    expected[entry],
                    b.numbers[entry],
                    here.describe(declaration)
                )
            });
        }
        Ok(())
    }

    /// Checks that the static force of a constraint is −∇U, and that the velocity-dependent part of a force dissipates
    /// power.
    fn damping(&mut self, sample: &Sample, answer: &Answer) -> Result<(), NoAnswer> {
        let declaration = self.declaration;
        let still = self.answer(&Sample { velocities: vec![0.0; sample.velocities.len()], ..sample.clone() })?;
        let (moving, at_rest) = (answer.block(BlockName::Force), still.block(BlockName::Force));
        if declaration.kind == Kind::Constraint {
            let gradient = answer.block(BlockName::Gradient);
            let expected: Vec<f64> = gradient.numbers.iter().map(|g| -g).collect();
            self.minus_gradient(sample, at_rest, &expected, "this energy");
        }
        let added: Vec<f64> = moving.numbers.iter().zip(&at_rest.numbers).map(|(a, b)| a - b).collect();
        if declaration.velocity_dependent && is_damping(&added, answer.block(BlockName::ForceByVelocity)) {
            let power: f64 = added.iter().zip(&sample.velocities).map(|(f, v)| f * v).sum();
            let scale = largest(&added).max(f64::EPSILON * moving.largest()) * largest(&sample.velocities);
            let error = if power <= 0.0 { 0.0 } else { power / scale };
            self.note(Check::Dissipation, BlockName::Force, error, sample, || {
                format!("  the velocity-dependent force adds the power {power:e}, at{}", sample.describe(declaration))
            });
        }
        Ok(())
    }

    /// Checks that a force is minus the gradient of an energy.
    pub(super) fn minus_gradient(&mut self, sample: &Sample, force: &Block, expected: &[f64], of: &str) {
        let declaration = self.declaration;
        let (entry, error) = worst(&force.numbers, expected);
        let scale = force.largest().max(largest(expected));
        let relative = if error == 0.0 { 0.0 } else { error / scale };
        self.note(Check::MinusGradient, BlockName::Force, relative, sample, || {
            format!(
                "  entry {}: the force without velocities is {:.17e}, −∇U of {of} is {:.17e}, at{}",
                entry_name(declaration, force, entry),
                force.numbers[entry],
                expected[entry],
                sample.describe(declaration)
            )
        });
    }

    /// Checks that the Hessian at the rest shape has no negative eigenvalue.
    pub(super) fn semi_definite_at_rest(&mut self, sample: &Sample, hessian: &Block) {
        let declaration = self.declaration;
        let values = eigenvalues(hessian.columns, &hessian.numbers);
        let (least, most) = values.iter().fold((0.0_f64, 0.0_f64), |(l, m), &x| (l.min(x), m.max(x.abs())));
        let error = if least == 0.0 { 0.0 } else { -least / most };
        self.note(Check::RestStability, BlockName::Hessian, error, sample, || {
            format!(
                "  its least eigenvalue at rest is {least:e}, its largest {most:e}, at{}",
                sample.describe(declaration)
            )
        });
    }
}

/// Whether the velocity-dependent part of a force should dissipate: if ∂f/∂v is symmetric, or a common velocity of all
/// points has no effect. Lift and drive forces do neither.
fn is_damping(added: &[f64], by_velocity: &Block) -> bool {
    let n = by_velocity.columns;
    let entry = |i: usize, j: usize| by_velocity.numbers[i * n + j];
    let largest_entry = by_velocity.largest();
    let symmetric = (0..n).all(|i| (0..i).all(|j| (entry(i, j) - entry(j, i)).abs() <= 1e-12 * largest_entry));
    let total = (0..3).map(|axis| added.iter().skip(axis).step_by(3).sum::<f64>().abs()).fold(0.0, f64::max);
    symmetric || total <= 1e-12 * largest(added)
}

const NUMBER: [f64; 4] = [0.0; 4];
const LENGTH: [f64; 4] = [0.0, 1.0, 0.0, 0.0];

/// Returns log₂ of the factor by which a quantity's number changes in units of 8 kg, ¼ m, 2 s and 1 K.
fn power([kilograms, metres, seconds, _]: [f64; 4]) -> i32 {
    // Exponents of declared units are integers here; a half would not give a power of two, and fails the check.
    (-3.0 * kilograms + 2.0 * metres - seconds).round() as i32
}

/// Lists the inputs whose numbers change with the units: rest shape, parameters and state.
fn scaled_fields(declaration: &Declaration) -> impl Iterator<Item = &Field> {
    declaration.rest.iter().chain(&*declaration.parameters).chain(&*declaration.state)
}

/// Returns the unit of each number of the rest shape, then of the parameters and of the state.
fn fields(declaration: &Declaration) -> impl Iterator<Item = Option<[f64; 4]>> {
    scaled_fields(declaration).flat_map(|field| std::iter::repeat_n(unit_exponents(&field.unit), field.size))
}

/// Returns the position and size of the largest difference.
fn worst(a: &[f64], b: &[f64]) -> (usize, f64) {
    let errors = a.iter().zip(b).map(|(x, y)| (x - y).abs()).enumerate();
    errors.fold((0, 0.0_f64), |most, next| if next.1 > most.1 || next.1.is_nan() { next } else { most })
}
