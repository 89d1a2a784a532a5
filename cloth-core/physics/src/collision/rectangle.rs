//! Triangles and rectangles in a plane.

/// A point in a plane, in m.
pub(super) type PlanePoint = [f64; 2];

/// A part of the length of a rectangle that is too narrow to count as inside.
const INSIDE: f64 = 1e-9;

/// Twice the signed area of a triangle, in m².
pub(super) fn doubled_area([a, b, c]: [PlanePoint; 3]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// The least height of a triangle, in m. 0 for one without area.
pub(super) fn least_height(corners: [PlanePoint; 3]) -> f64 {
    let [a, b, c] = corners;
    let length = |p: PlanePoint, q: PlanePoint| (q[0] - p[0]).hypot(q[1] - p[1]);
    let longest = length(a, b).max(length(b, c)).max(length(c, a));
    // `max` takes 0 for NaN.
    (doubled_area(corners).abs() / longest).max(0.0)
}

/// The inverse of the matrix with the sides b − a and c − a as columns.
pub(super) fn inverse([a, b, c]: [PlanePoint; 3]) -> [[f64; 2]; 2] {
    let determinant = doubled_area([a, b, c]);
    [[c[1] - a[1], a[0] - c[0]], [a[1] - b[1], b[0] - a[0]]].map(|row| row.map(|entry| entry / determinant))
}

/// A rectangle along the axes of a plane.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rectangle {
    pub low: PlanePoint,
    pub high: PlanePoint,
}

impl Rectangle {
    /// The rectangle that contains no point.
    pub const EMPTY: Self = Self { low: [f64::INFINITY; 2], high: [f64::NEG_INFINITY; 2] };

    /// Returns the smallest rectangle around this one and a point.
    pub fn with(self, point: PlanePoint) -> Self {
        let (low, high) = ([0, 1].map(|a| self.low[a].min(point[a])), [0, 1].map(|a| self.high[a].max(point[a])));
        Self { low, high }
    }

    /// The length along an axis, in m.
    pub fn length(&self, axis: usize) -> f64 {
        self.high[axis] - self.low[axis]
    }

    /// The area, in m².
    pub fn area(&self) -> f64 {
        self.length(0) * self.length(1)
    }

    /// Returns the rectangle extended by a margin on every side.
    pub fn extended(&self, margin: f64) -> Self {
        Self { low: self.low.map(|low| low - margin), high: self.high.map(|high| high + margin) }
    }

    /// The part of the rectangle that lies in another one.
    pub fn within(&self, other: &Self) -> Self {
        let low = [0, 1].map(|axis| self.low[axis].max(other.low[axis]));
        Self { low, high: [0, 1].map(|axis| self.high[axis].min(other.high[axis])) }
    }

    /// Whether a part of another rectangle lies inside, and not only on the boundary. The excess of the reach of
    /// searches covers a part that is too narrow to count.
    pub fn has_inside(&self, other: &Self) -> bool {
        (0..2).all(|axis| {
            let inside = INSIDE * self.length(axis);
            other.low[axis] < self.high[axis] - inside && self.low[axis] + inside < other.high[axis]
        })
    }

    /// The area that the rectangle has in common with a triangle, in m².
    pub fn common_area(&self, corners: [PlanePoint; 3]) -> f64 {
        let mut polygon = corners.to_vec();
        for axis in 0..2 {
            polygon = cut(&polygon, |point| self.low[axis] - point[axis]);
            polygon = cut(&polygon, |point| point[axis] - self.high[axis]);
        }
        let fan = polygon.windows(2).map(|side| doubled_area([polygon[0], side[0], side[1]]));
        0.5 * fan.sum::<f64>().abs()
    }
}

/// Returns the part of a convex polygon that is not beyond a line.
fn cut(polygon: &[PlanePoint], beyond: impl Fn(&PlanePoint) -> f64) -> Vec<PlanePoint> {
    let mut kept = Vec::with_capacity(polygon.len() + 1);
    for (number, here) in polygon.iter().enumerate() {
        let next = &polygon[(number + 1) % polygon.len()];
        let (from, to) = (beyond(here), beyond(next));
        if from <= 0.0 {
            kept.push(*here);
        }
        if from * to < 0.0 {
            let part = from / (from - to);
            kept.push([0, 1].map(|axis| here[axis] + part * (next[axis] - here[axis])));
        }
    }
    kept
}
