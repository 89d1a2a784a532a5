use energy_dsl::{Lane, Level, Mask, Number};
use energy_solve::index;

use super::{Bounds, RoundedMovingBounds, Volume};

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
        // Lanes read beyond the last box.
        for Corners { low, high } in self.instants.iter_mut().take(B::INSTANTS) {
            low.iter_mut().for_each(|low| low.resize(boxes.len() + LANES, f32::INFINITY));
            high.iter_mut().for_each(|high| high.resize(boxes.len() + LANES, f32::NEG_INFINITY));
        }
        for (number, bounds) in boxes.iter().enumerate() {
            self.replace(number, bounds);
        }
    }

    /// Takes one new box.
    pub fn replace<B: Volume>(&mut self, number: usize, bounds: &B) {
        let rounded = RoundedMovingBounds::around(bounds);
        for (instant, Corners { low, high }) in self.instants.iter_mut().enumerate().take(B::INSTANTS) {
            let one = rounded.at(instant);
            for axis in 0..3 {
                (low[axis][number], high[axis][number]) = (one.low[axis], one.high[axis]);
            }
        }
    }

    /// Returns which boxes, of at most 32 from one number to another, overlap another box; see [`Volume::overlaps`].
    #[inline(always)]
    pub fn overlapping<L: Level, B: Volume>(&self, from: usize, to: usize, other: &RoundedMovingBounds) -> Overlapping {
        let mut bits = 0;
        for first in (from..to).step_by(L::F32::LANES) {
            let mut overlaps = self.along::<L, B>(0, first, other);
            for axis in 1..3 {
                overlaps = overlaps & self.along::<L, B>(axis, first, other);
            }
            bits |= overlaps.bits() << (first - from);
        }
        let valid = u32::MAX.checked_shr(32 - index(to - from)).unwrap_or(0);
        Overlapping { first: from, bits: bits & valid }
    }

    /// Whether boxes from number `first` on overlap another one along an axis.
    #[inline(always)]
    fn along<L: Level, B: Volume>(
        &self,
        axis: usize,
        first: usize,
        other: &RoundedMovingBounds,
    ) -> <L::F32 as Number>::Mask {
        let (mut begins, mut ends) = self.instants[0].overlap_masks::<L>(axis, first, other.at(0));
        for instant in 1..B::INSTANTS {
            let (one, two) = self.instants[instant].overlap_masks::<L>(axis, first, other.at(instant));
            (begins, ends) = (begins | one, ends | two);
        }
        begins & ends
    }
}

/// Numbers of boxes, ascending.
pub(super) struct Overlapping {
    first: usize,
    bits: u32,
}

impl Iterator for Overlapping {
    type Item = usize;

    #[inline(always)]
    fn next(&mut self) -> Option<usize> {
        if self.bits == 0 {
            return None;
        }
        let next = self.first + self.bits.trailing_zeros() as usize;
        self.bits &= self.bits - 1;
        Some(next)
    }
}

impl Corners {
    /// Whether boxes from number `first` on begin before another one ends along an axis, and end after it begins.
    #[inline(always)]
    fn overlap_masks<L: Level>(
        &self,
        axis: usize,
        first: usize,
        other: &Bounds<f32>,
    ) -> (<L::F32 as Number>::Mask, <L::F32 as Number>::Mask) {
        let begins = L::F32::load(&self.low[axis][first..]).less_or_equal(L::F32::splat(other.high[axis]));
        let ends = L::F32::splat(other.low[axis]).less_or_equal(L::F32::load(&self.high[axis][first..]));
        (begins, ends)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use crate::geometry::Coordinate;

    proptest! {
        #[test]
        fn rounded_numbers_are_below_by_little(x in prop_oneof![-1e7..1e7_f64, -1e-3..1e-3_f64, Just(0.0)]) {
            let rounded = f64::from(x.below());
            prop_assert!(rounded < x && x - rounded <= 4e-7 * x.abs() + 1e-37, "{x:e} {rounded:e}");
        }
    }

    #[test]
    fn numbers_out_of_range_are_rounded_too() {
        assert!(1e300.below() >= 3e38 && 1e300.below().is_finite());
        assert_eq!((-1e300).below(), f32::NEG_INFINITY);
    }
}
