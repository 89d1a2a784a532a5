//! Properties that a declaration claims and the compiler does not prove.

use energy_dsl::{Kind, Property};

use super::auditor::Auditor;
use super::cases::Case;
use super::report::Check;
use crate::blocks::{Answer, BlockName, NoAnswer, largest};
use crate::sample::Sample;

impl Auditor<'_> {
    /// Checks each claim at one input.
    pub(super) fn claims(&mut self, case: &Case<'_>, answer: &Answer) -> Result<(), NoAnswer> {
        let sample = &case.sample;
        let turn = |vectors: &[f64]| case.turned(vectors);
        for property in &*self.declaration.properties {
            let (moved, expected) = match property {
                // The compiler proved this property.
                Property::TranslationInvariant => continue,
                Property::RotationInvariant => (turned(sample, &turn), Expected::Turned),
                Property::Even => (mirrored(sample), Expected::Same),
                Property::ZeroForceAtRest => (at_rest(sample), Expected::Zero),
            };
            let there = self.answer(&moved)?;
            if *property == Property::ZeroForceAtRest && self.declaration.kind == Kind::Energy {
                self.semi_definite_at_rest(&moved, there.block(BlockName::Hessian));
            }
            let block = compared(self.declaration.kind, expected);
            let (here, there) = (&answer.block(block).numbers, &there.block(block).numbers);
            let wanted = match expected {
                Expected::Turned if block == BlockName::Force => turn(here),
                Expected::Turned | Expected::Same => here.clone(),
                Expected::Zero => vec![0.0; here.len()],
            };
            let scale = largest(here).max(self.natural_size(sample, answer, block));
            let worst = there
                .iter()
                .zip(&wanted)
                .map(|(a, b)| (a - b).abs())
                .fold(0.0_f64, |m, e| if e > m || e.is_nan() { e } else { m });
            let error = if worst == 0.0 { 0.0 } else { worst / scale };
            let declaration = self.declaration;
            self.note(Check::Claims, block, error, sample, || {
                format!(
                    "  it claims #[{}], but `{block}` is {there:?} where {wanted:?} was expected, after moving{}",
                    property.attribute(),
                    sample.describe(declaration)
                )
            });
        }
        Ok(())
    }
}

/// The expected relation between a block before and after the points have moved.
#[derive(Clone, Copy, PartialEq)]
enum Expected {
    Same,
    Turned,
    Zero,
}

/// Returns the block that a claim is about.
fn compared(kind: Kind, expected: Expected) -> BlockName {
    match (kind, expected) {
        (Kind::Energy | Kind::Constraint, Expected::Zero) => BlockName::Gradient,
        // The rows of a constraint may rotate; its energy ½ k CᵀC may not.
        (Kind::Energy | Kind::Constraint, _) => BlockName::Energy,
        (Kind::Force, _) => BlockName::Force,
        (Kind::Residual, _) => BlockName::Residual,
    }
}

fn turned(sample: &Sample, turn: &impl Fn(&[f64]) -> Vec<f64>) -> Sample {
    Sample { positions: turn(&sample.positions), velocities: turn(&sample.velocities), ..sample.clone() }
}

fn mirrored(sample: &Sample) -> Sample {
    Sample { positions: sample.positions.iter().map(|x| -x).collect(), ..sample.clone() }
}

/// Moves the points to the rest shape; a plane one lies in the plane z = 0.
fn at_rest(sample: &Sample) -> Sample {
    let points = sample.positions.len() / 3;
    let dimension = sample.rest.len() / points.max(1);
    let places = sample.rest.chunks(dimension.max(1));
    let positions = places.flat_map(|place| (0..3).map(|axis| place.get(axis).copied().unwrap_or(0.0))).collect();
    Sample { positions, velocities: vec![0.0; sample.velocities.len()], ..sample.clone() }
}
