use energy_dsl::{Lane, Level, Mask, Number};

use super::Volume;

/// The largest number of lanes.
pub(super) const LANES: usize = 16;

/// Boxes in single precision, rounded outwards, by instant and coordinate: lanes compare one box with several.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct RoundedBoxes {
    instants: [Corners; 2],
}

/// The least and the greatest coordinates of boxes.
#[derive(Clone, Debug, Default, PartialEq)]
struct Corners {
    low: [Vec<f32>; 3],
    high: [Vec<f32>; 3],
}

impl RoundedBoxes {
    /// Takes new boxes.
    pub fn set<B: Volume>(&mut self, boxes: &[B]) {
        for (instant, Corners { low, high }) in self.instants.iter_mut().enumerate().take(B::INSTANTS) {
            for axis in 0..3 {
                let (low, high) = (&mut low[axis], &mut high[axis]);
                low.clear();
                low.extend(boxes.iter().map(|bounds| below(bounds.at(instant).low[axis])));
                high.clear();
                high.extend(boxes.iter().map(|bounds| -below(-bounds.at(instant).high[axis])));
                // Lanes read beyond the last box.
                low.resize(boxes.len() + LANES, f32::INFINITY);
                high.resize(boxes.len() + LANES, f32::NEG_INFINITY);
            }
        }
    }

    /// Takes one new box.
    pub fn replace<B: Volume>(&mut self, number: usize, bounds: &B) {
        for (instant, Corners { low, high }) in self.instants.iter_mut().enumerate().take(B::INSTANTS) {
            for axis in 0..3 {
                low[axis][number] = below(bounds.at(instant).low[axis]);
                high[axis][number] = -below(-bounds.at(instant).high[axis]);
            }
        }
    }

    /// Calls `found` with each box, of those from one number to another, that overlaps a box of another set; see
    /// [`Volume::overlaps`].
    #[inline(always)]
    pub fn overlapping<L: Level, B: Volume>(
        &self,
        from: usize,
        to: usize,
        (others, other): (&Self, usize),
        mut found: impl FnMut(usize),
    ) {
        for first in (from..to).step_by(L::F32::LANES) {
            let mut overlaps = self.along::<L, B>(0, first, others, other);
            for axis in 1..3 {
                overlaps = overlaps & self.along::<L, B>(axis, first, others, other);
            }
            let mut bits = overlaps.bits() & (u32::MAX >> (32 - (to - first).min(32)));
            while bits != 0 {
                found(first + bits.trailing_zeros() as usize);
                bits &= bits - 1;
            }
        }
    }

    /// Whether boxes from number `first` on overlap another one along an axis.
    #[inline(always)]
    fn along<L: Level, B: Volume>(
        &self,
        axis: usize,
        first: usize,
        others: &Self,
        other: usize,
    ) -> <L::F32 as Number>::Mask {
        let (mut begins, mut ends) = self.instants[0].meet::<L>(axis, first, &others.instants[0], other);
        for instant in 1..B::INSTANTS {
            let (one, two) = self.instants[instant].meet::<L>(axis, first, &others.instants[instant], other);
            (begins, ends) = (begins | one, ends | two);
        }
        begins & ends
    }
}

impl Corners {
    /// Whether boxes from number `first` on begin before another one ends along an axis, and end after it begins.
    #[inline(always)]
    fn meet<L: Level>(
        &self,
        axis: usize,
        first: usize,
        others: &Self,
        other: usize,
    ) -> (<L::F32 as Number>::Mask, <L::F32 as Number>::Mask) {
        let begins = L::F32::load(&self.low[axis][first..]).less_or_equal(L::F32::splat(others.high[axis][other]));
        let ends = L::F32::splat(others.low[axis][other]).less_or_equal(L::F32::load(&self.high[axis][first..]));
        (begins, ends)
    }
}

/// A number just below x. The subtraction exceeds the error of rounding, and has no branches.
#[inline]
fn below(x: f64) -> f32 {
    let near = (x as f32).min(f32::MAX);
    near - near.abs() * f32::EPSILON - f32::MIN_POSITIVE
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn rounded_numbers_are_below_by_little(x in prop_oneof![-1e7..1e7_f64, -1e-3..1e-3_f64, Just(0.0)]) {
            let rounded = f64::from(below(x));
            prop_assert!(rounded < x && x - rounded <= 4e-7 * x.abs() + 1e-37, "{x:e} {rounded:e}");
        }
    }

    #[test]
    fn numbers_out_of_range_are_rounded_too() {
        assert!(below(1e300) >= 3e38 && below(1e300).is_finite());
        assert_eq!(below(-1e300), f32::NEG_INFINITY);
    }
}
