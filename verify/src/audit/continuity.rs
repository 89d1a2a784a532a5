//! Continuity of a value where branches of the formula meet: a kink is allowed, a jump is not.

use energy_dsl::Kind;

use super::auditor::Auditor;
use super::cases::Case;
use super::report::Check;
use crate::blocks::{Block, BlockName};
use crate::chart;
use crate::sample::{Sample, has_points};

/// Bisections of a path: enough to bring both ends to adjacent doubles.
const HALVINGS: usize = 70;

impl Auditor<'_> {
    /// Walks from the input to others. Where the branches of the formula change, the values on both sides must agree. A
    /// force may jump, as Coulomb friction does, and so may a residual: blended rotations choose a hemisphere.
    pub(super) fn continuity(&mut self, case: &Case<'_>, other: &Sample, typical: f64) {
        let value = match self.declaration.kind {
            Kind::Energy => BlockName::Energy,
            Kind::Constraint => BlockName::Constraint,
            Kind::Residual | Kind::Force => return,
        };
        if self.subject.branches(&case.sample).is_empty() {
            return;
        }
        for end in self.destinations(case, other) {
            if case.is_bounded && self.subject.is_outside(&end) {
                continue;
            }
            if let Some([before, after]) = self.crossing(&case.sample, &end) {
                self.compare_sides((value, typical), &before, &after, [&case.sample, &end]);
            }
        }
    }

    /// Returns where the walks from an input end: another input, another orientation and, unless the declaration limits
    /// its domain, a tenth of the size.
    fn destinations(&self, case: &Case<'_>, other: &Sample) -> Vec<Sample> {
        let positions = &case.sample.positions;
        let mut ends = vec![other.positions.clone()];
        if has_points(self.declaration) {
            ends.push(case.turned(positions));
        }
        if self.subject.formula.program().audit_scope.ranges.is_empty() {
            ends.push(positions.iter().map(|x| 0.1 * x).collect());
        }
        ends.into_iter().map(|positions| self.at(&case.sample, positions)).collect()
    }

    /// Returns neighbouring inputs on both sides of a change of branches between two inputs; `None` if both ends take
    /// the same branches.
    fn crossing(&self, from: &Sample, to: &Sample) -> Option<[Sample; 2]> {
        let here = self.subject.branches(from);
        if self.subject.branches(to) == here {
            return None;
        }
        let (mut before, mut after) = (from.clone(), to.clone());
        for _ in 0..HALVINGS {
            let middle = self.between(&before, &after);
            if middle == before || middle == after {
                break;
            }
            let side = if self.subject.branches(&middle) == here { &mut before } else { &mut after };
            *side = middle;
        }
        Some([before, after])
    }

    fn between(&self, a: &Sample, b: &Sample) -> Sample {
        let positions = a.positions.iter().zip(&b.positions).map(|(a, b)| a + (b - a) / 2.0).collect();
        self.at(a, positions)
    }

    /// Returns an input with other positions, where rotations have unit length.
    fn at(&self, sample: &Sample, mut positions: Vec<f64>) -> Sample {
        chart::normalise(self.declaration, &mut positions);
        Sample { positions, ..sample.clone() }
    }

    /// Compares the values of neighbouring inputs. The scale is that of the values there, at both ends of the walk, and
    /// a small part of the typical one: where a barrier ends, all others vanish.
    fn compare_sides(
        &mut self,
        (block, typical): (BlockName, f64),
        before: &Sample,
        after: &Sample,
        ends: [&Sample; 2],
    ) {
        let sizes = ends.map(|end| self.answer(end).map_or(0.0, |answer| answer.block(block).largest()));
        let (Ok(left), Ok(right)) = (self.answer(before), self.answer(after)) else { return };
        // A flagged result is documented: the value has no limit there.
        if left.flags[0].degenerate || right.flags[0].degenerate {
            return;
        }
        let (left, right) = (left.block(block), right.block(block));
        let natural = sizes.into_iter().filter(|size| size.is_finite()).fold(0.0, f64::max);
        let scale = left.largest().max(right.largest()).max(natural).max(1e-6 * typical);
        let pairs = || left.numbers.iter().zip(&right.numbers);
        if !scale.is_finite() {
            return;
        }
        let jump = pairs().map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        let is_steep = || self.change_nearby(block, [before, after], ends).is_some_and(|change| 100.0 * jump < change);
        let jump = if jump > 1e-9 * scale && is_steep() { 0.0 } else { jump };
        let declaration = self.declaration;
        self.note(Check::Continuity, block, if jump == 0.0 { 0.0 } else { jump / scale }, before, || {
            let sides: Vec<String> = pairs().map(|(a, b)| format!("{a:.17e} and {b:.17e}")).collect();
            format!("  the two sides of a change of branches: {}, at{}", sides.join("; "), before.describe(declaration))
        });
    }

    /// Returns how much the values change a little farther from the change of branches. Next to a jump they stay about
    /// the same. If slopes are infinite, as those of a root are, they change more than between neighbouring doubles.
    fn change_nearby(&self, block: BlockName, sides: [&Sample; 2], ends: [&Sample; 2]) -> Option<f64> {
        let mut most = 0.0_f64;
        for (from, to) in sides.into_iter().zip(ends) {
            let positions =
                from.positions.iter().zip(&to.positions).map(|(from, to)| from + 1e-8 * (to - from)).collect();
            let moved = self.answer(&self.at(from, positions)).ok()?;
            let here = self.answer(from).ok()?;
            let pairs = here.block(block).numbers.iter().zip(&moved.block(block).numbers);
            most = pairs.map(|(a, b)| (a - b).abs()).fold(most, f64::max);
        }
        Some(most)
    }
}

/// Returns the median size of the values at all inputs, of those that do not vanish.
pub(super) fn typical_value(cases: &[Case<'_>]) -> f64 {
    let size = |case: &Case<'_>| case.duals().first().map_or(0.0, Block::largest);
    let mut sizes: Vec<f64> = cases.iter().map(size).filter(|&size| size > 0.0 && size.is_finite()).collect();
    sizes.sort_by(f64::total_cmp);
    sizes.get(sizes.len() / 2).copied().unwrap_or(0.0)
}
