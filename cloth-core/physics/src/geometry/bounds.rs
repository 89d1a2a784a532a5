use energy_dsl::Vector3;

use super::rounded_boxes::LANES;

/// An axis-aligned box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds<T = f64> {
    /// The least coordinates, in m.
    pub low: [T; 3],
    /// The greatest coordinates, in m.
    pub high: [T; 3],
}

/// A coordinate in double or single precision.
pub trait Coordinate: Copy + std::fmt::Debug + PartialOrd + std::ops::Neg<Output = Self> + Into<f64> {
    /// A number above all others.
    const INFINITY: Self;
    /// A number below all others.
    const NEG_INFINITY: Self;

    /// A number that is at most this one, in single precision.
    fn below(self) -> f32;

    /// A number that is at least this one, in single precision.
    #[inline(always)]
    fn above(self) -> f32 {
        -(-self).below()
    }

    /// The smaller of two numbers.
    #[inline(always)]
    fn least(self, other: Self) -> Self {
        if other < self { other } else { self }
    }

    /// The larger of two numbers.
    #[inline(always)]
    fn greatest(self, other: Self) -> Self {
        if other > self { other } else { self }
    }
}

impl Coordinate for f64 {
    const INFINITY: Self = Self::INFINITY;
    const NEG_INFINITY: Self = Self::NEG_INFINITY;

    /// The subtraction exceeds the error of rounding, and has no branches.
    #[inline(always)]
    fn below(self) -> f32 {
        let near = (self as f32).min(f32::MAX);
        near - near.abs() * f32::EPSILON - f32::MIN_POSITIVE
    }
}

impl Coordinate for f32 {
    const INFINITY: Self = Self::INFINITY;
    const NEG_INFINITY: Self = Self::NEG_INFINITY;

    #[inline(always)]
    fn below(self) -> f32 {
        self
    }
}

/// A box, or one that moves on a straight line.
pub trait Volume: Copy + std::fmt::Debug + PartialEq {
    /// The number type of the coordinates.
    type Number: Coordinate;

    /// The number of instants at which the box is known: 1, or 2 for the start and the end of a move.
    const INSTANTS: usize;

    /// The largest number of items in a leaf of a hierarchy.
    const LEAF: usize;

    /// Returns the volume with these boxes at its instants.
    fn from_fn(at: impl Fn(usize) -> Bounds<Self::Number>) -> Self;

    /// The box at an instant.
    fn at(&self, instant: usize) -> &Bounds<Self::Number>;

    /// The volume that contains no point and leaves every other one unchanged in [`Volume::joined`].
    fn empty() -> Self {
        Self::from_fn(|_| Bounds::EMPTY)
    }

    /// Returns the smallest volume around both.
    #[inline]
    fn joined(self, other: Self) -> Self {
        Self::from_fn(|instant| self.at(instant).around(*other.at(instant)))
    }

    /// Whether boxes may share a point at any time. Along an axis, coordinates of boxes on straight lines are linear in
    /// time: if one box is beyond the other at both ends, it is so all the time. All comparisons are made: a branch
    /// after each of them would be hard to predict.
    #[inline(always)]
    fn overlaps(&self, other: &Self) -> bool {
        let mut overlaps = true;
        for axis in 0..3 {
            let (mut begins, mut ends) = (false, false);
            for instant in 0..Self::INSTANTS {
                let (own, other) = (self.at(instant), other.at(instant));
                begins |= own.low[axis] <= other.high[axis];
                ends |= other.low[axis] <= own.high[axis];
            }
            overlaps &= begins & ends;
        }
        overlaps
    }
}

impl Volume for Bounds {
    type Number = f64;

    const INSTANTS: usize = 1;

    /// All items of a leaf are compared to find the nearest one.
    const LEAF: usize = 4;

    #[inline]
    fn from_fn(at: impl Fn(usize) -> Bounds) -> Self {
        at(0)
    }

    #[inline(always)]
    fn at(&self, _: usize) -> &Bounds {
        self
    }
}

/// A box at the start and at the end of a straight move.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MovingBounds(pub [Bounds; 2]);

impl MovingBounds {
    /// A box that does not move.
    pub fn fixed(bounds: Bounds) -> Self {
        Self([bounds; 2])
    }

    /// Returns the box extended by `margin` on every side, rounded outwards.
    #[inline]
    pub fn rounded(&self, margin: f64) -> RoundedMovingBounds {
        let [start, end] = &self.0;
        RoundedMovingBounds([start.extended(margin).rounded(), end.extended(margin).rounded()])
    }
}

/// A [`MovingBounds`] in single precision: hierarchies of many boxes are bound by memory.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RoundedMovingBounds([Bounds<f32>; 2]);

impl RoundedMovingBounds {
    /// Returns the smallest such box that certainly contains a volume.
    #[inline(always)]
    pub(super) fn around<B: Volume>(volume: &B) -> Self {
        Self([volume.at(0).rounded(), volume.at(B::INSTANTS - 1).rounded()])
    }
}

impl Volume for RoundedMovingBounds {
    type Number = f32;

    const INSTANTS: usize = 2;

    const LEAF: usize = LANES;

    #[inline]
    fn from_fn(at: impl Fn(usize) -> Bounds<f32>) -> Self {
        Self([at(0), at(1)])
    }

    #[inline(always)]
    fn at(&self, instant: usize) -> &Bounds<f32> {
        &self.0[instant]
    }
}

impl<T: Coordinate> Bounds<T> {
    /// The box that contains no point and leaves every other box unchanged in [`Bounds::around`].
    pub const EMPTY: Self = Self { low: [T::INFINITY; 3], high: [T::NEG_INFINITY; 3] };

    /// Returns the smallest box around both.
    #[inline]
    pub fn around(self, other: Self) -> Self {
        Self {
            low: std::array::from_fn(|axis| self.low[axis].least(other.low[axis])),
            high: std::array::from_fn(|axis| self.high[axis].greatest(other.high[axis])),
        }
    }

    /// Returns the smallest box in single precision that certainly contains this one.
    #[inline(always)]
    pub fn rounded(&self) -> Bounds<f32> {
        let ([a, b, c], [d, e, f]) = (self.low, self.high);
        Bounds { low: [a.below(), b.below(), c.below()], high: [d.above(), e.above(), f.above()] }
    }

    /// The length along an axis, in m.
    #[inline]
    pub fn length(&self, axis: usize) -> f64 {
        self.high[axis].into() - self.low[axis].into()
    }

    /// Whether the sum of the edge lengths exceeds that of another box.
    #[inline]
    pub fn is_longer_than(&self, other: &Self) -> bool {
        let length = |bounds: &Self| (0..3).map(|axis| bounds.length(axis)).sum::<f64>();
        length(self) > length(other)
    }

    /// The middle along an axis.
    pub fn middle(&self, axis: usize) -> f64 {
        0.5 * (self.low[axis].into() + self.high[axis].into())
    }
}

impl Bounds {
    /// Returns the smallest box around the points.
    pub fn of(points: &[Vector3<f64>]) -> Self {
        let bound = |pick: fn(f64, f64) -> f64, start: f64| -> Vector3<f64> {
            std::array::from_fn(|axis| points.iter().map(|p| p[axis]).fold(start, pick))
        };
        Self { low: bound(f64::min, f64::INFINITY), high: bound(f64::max, f64::NEG_INFINITY) }
    }

    /// Returns the box extended by `margin` on every side.
    #[inline]
    pub fn extended(self, margin: f64) -> Self {
        let ([a, b, c], [d, e, f]) = (self.low, self.high);
        Self { low: [a - margin, b - margin, c - margin], high: [d + margin, e + margin, f + margin] }
    }

    /// Squared distance of a point, in m²; 0 inside.
    pub fn distance_squared(&self, x: Vector3<f64>) -> f64 {
        let beyond = |axis: usize| (self.low[axis] - x[axis]).max(x[axis] - self.high[axis]).max(0.0);
        (0..3).map(|axis| beyond(axis).powi(2)).sum()
    }
}
