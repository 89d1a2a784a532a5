use energy_dsl::{Lane, Level, Mask, Number};

use super::Bounds;

/// The largest number of lanes.
pub(super) const LANES: usize = 16;

/// Boxes in single precision, rounded outwards, by coordinate: lanes compare one box with several.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct RoundedBoxes {
    low: [Vec<f32>; 3],
    high: [Vec<f32>; 3],
}

impl RoundedBoxes {
    /// Takes new boxes.
    pub fn set(&mut self, boxes: &[Bounds]) {
        for axis in 0..3 {
            let (low, high) = (&mut self.low[axis], &mut self.high[axis]);
            low.clear();
            low.extend(boxes.iter().map(|bounds| below(bounds.low[axis])));
            high.clear();
            high.extend(boxes.iter().map(|bounds| -below(-bounds.high[axis])));
            // Lanes read beyond the last box.
            low.resize(boxes.len() + LANES, f32::INFINITY);
            high.resize(boxes.len() + LANES, f32::NEG_INFINITY);
        }
    }

    /// Takes one new box.
    pub fn replace(&mut self, number: usize, bounds: &Bounds) {
        for axis in 0..3 {
            self.low[axis][number] = below(bounds.low[axis]);
            self.high[axis][number] = -below(-bounds.high[axis]);
        }
    }

    /// Calls `found` with each box, of those from one number to another, that overlaps a box of another set.
    #[inline(always)]
    pub fn overlapping<L: Level>(
        &self,
        from: usize,
        to: usize,
        (others, other): (&Self, usize),
        mut found: impl FnMut(usize),
    ) {
        let splat = |values: &[Vec<f32>; 3]| {
            [L::F32::splat(values[0][other]), L::F32::splat(values[1][other]), L::F32::splat(values[2][other])]
        };
        let (low, high) = (splat(&others.low), splat(&others.high));
        for first in (from..to).step_by(L::F32::LANES) {
            let mut overlaps = L::F32::load(&self.low[0][first..]).less_or_equal(high[0]);
            overlaps = overlaps & low[0].less_or_equal(L::F32::load(&self.high[0][first..]));
            for axis in 1..3 {
                overlaps = overlaps & L::F32::load(&self.low[axis][first..]).less_or_equal(high[axis]);
                overlaps = overlaps & low[axis].less_or_equal(L::F32::load(&self.high[axis][first..]));
            }
            let mut bits = overlaps.bits() & (u32::MAX >> (32 - (to - first).min(32)));
            while bits != 0 {
                found(first + bits.trailing_zeros() as usize);
                bits &= bits - 1;
            }
        }
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
