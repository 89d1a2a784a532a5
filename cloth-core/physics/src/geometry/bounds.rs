use energy_dsl::Vector3;

/// An axis-aligned box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// The least coordinates, in m.
    pub low: Vector3<f64>,
    /// The greatest coordinates, in m.
    pub high: Vector3<f64>,
}

/// A box, or one that moves on a straight line.
pub trait Volume: Copy + std::fmt::Debug + PartialEq {
    /// The number of instants at which the box is known: 1, or 2 for the start and the end of a move.
    const INSTANTS: usize;

    /// Returns the volume with these boxes at its instants.
    fn from_fn(at: impl Fn(usize) -> Bounds) -> Self;

    /// The box at an instant.
    fn at(&self, instant: usize) -> &Bounds;

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
    const INSTANTS: usize = 1;

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

    /// Returns the box extended by `margin` on every side.
    pub fn extended(self, margin: f64) -> Self {
        Self(self.0.map(|bounds| bounds.extended(margin)))
    }
}

impl Volume for MovingBounds {
    const INSTANTS: usize = 2;

    #[inline]
    fn from_fn(at: impl Fn(usize) -> Bounds) -> Self {
        Self([at(0), at(1)])
    }

    #[inline(always)]
    fn at(&self, instant: usize) -> &Bounds {
        &self.0[instant]
    }
}

impl Bounds {
    /// The box that contains no point and leaves every other box unchanged in [`Bounds::around`].
    pub const EMPTY: Self = Self { low: [f64::INFINITY; 3], high: [f64::NEG_INFINITY; 3] };

    /// Returns the smallest box around the points.
    pub fn of(points: &[Vector3<f64>]) -> Self {
        let bound = |pick: fn(f64, f64) -> f64, start: f64| -> Vector3<f64> {
            std::array::from_fn(|axis| points.iter().map(|p| p[axis]).fold(start, pick))
        };
        Self { low: bound(f64::min, f64::INFINITY), high: bound(f64::max, f64::NEG_INFINITY) }
    }

    /// Returns the smallest box around both.
    #[inline]
    pub fn around(self, other: Self) -> Self {
        Self {
            low: std::array::from_fn(|axis| self.low[axis].min(other.low[axis])),
            high: std::array::from_fn(|axis| self.high[axis].max(other.high[axis])),
        }
    }

    /// Returns the box extended by `margin` on every side.
    #[inline]
    pub fn extended(self, margin: f64) -> Self {
        Self {
            low: self.low.map(|coordinate| coordinate - margin),
            high: self.high.map(|coordinate| coordinate + margin),
        }
    }

    /// Whether the sum of the edge lengths exceeds that of another box.
    #[inline]
    pub fn is_longer_than(&self, other: &Self) -> bool {
        let length = |bounds: &Self| (0..3).map(|axis| bounds.high[axis] - bounds.low[axis]).sum::<f64>();
        length(self) > length(other)
    }

    /// The middle along an axis.
    pub fn middle(&self, axis: usize) -> f64 {
        0.5 * (self.low[axis] + self.high[axis])
    }

    /// Squared distance of a point, in m²; 0 inside.
    pub fn distance_squared(&self, x: Vector3<f64>) -> f64 {
        let beyond = |axis: usize| (self.low[axis] - x[axis]).max(x[axis] - self.high[axis]).max(0.0);
        (0..3).map(|axis| beyond(axis).powi(2)).sum()
    }
}
