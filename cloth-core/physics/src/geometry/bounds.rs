use energy_dsl::Vector3;

/// An axis-aligned box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// The least coordinates, in m.
    pub low: Vector3<f64>,
    /// The greatest coordinates, in m.
    pub high: Vector3<f64>,
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

    /// Whether the boxes share a point. All comparisons are made: a branch after each of them would be hard to predict.
    #[inline]
    pub fn overlaps(&self, other: &Self) -> bool {
        let along = |axis: usize| (self.low[axis] <= other.high[axis]) & (other.low[axis] <= self.high[axis]);
        along(0) & along(1) & along(2)
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
