//! The shadow of a surface: its projection along a direction.

use energy_dsl::Vector3;

use crate::geometry::{add_scaled, cross, dot, norm};

/// Number of lines on which the width of a shadow is measured. The error of the area is about (2/`LINES`)² of it.
const LINES: usize = 4096;

/// The projection of triangles onto a plane. Where several lie over each other, the shadow counts once.
#[derive(Clone, Debug, PartialEq)]
pub struct Shadow {
    triangles: Vec<[[f64; 2]; 3]>,
    /// Area, in m².
    area: f64,
    /// Centroid, in m.
    centroid: [f64; 2],
}

/// Two unit vectors that span the floor, and the direction up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Floor([Vector3<f64>; 2]);

impl Floor {
    /// Creates the floor across a direction; that across z if the direction is zero. For z, its axes are x and y.
    pub(super) fn across(up: Vector3<f64>) -> Self {
        let length = norm(up);
        let up = if length > 0.0 && length.is_finite() { up.map(|part| part / length) } else { [0.0, 0.0, 1.0] };
        let axis = if up[0].abs() < 0.9 { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] };
        let along = add_scaled(axis, -dot(axis, up), up);
        let first = along.map(|part| part / norm(along));
        Self([first, cross(up, first)])
    }

    pub(super) fn project(&self, x: Vector3<f64>) -> [f64; 2] {
        self.0.map(|axis| dot(axis, x))
    }
}

impl Shadow {
    /// Projects triangles along a direction; along z if it is zero. Positions are in m.
    ///
    /// ```
    /// use cloth_core::measure::Shadow;
    /// // A strip of two squares that is folded onto itself: its shadow is one square.
    /// let x = [[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.1], [0.0, 0.0, 0.1]];
    /// let shadow = Shadow::new(&x, &[[0, 1, 2], [0, 2, 3], [3, 2, 4], [3, 4, 5]], [0.0, 0.0, 1.0]);
    /// assert!((shadow.area() - 1.0).abs() < 1e-6);
    /// ```
    #[must_use]
    pub fn new(x: &[Vector3<f64>], triangles: &[[usize; 3]], up: Vector3<f64>) -> Self {
        let floor = Floor::across(up);
        let flat = |corners: &[usize; 3]| corners.map(|corner| floor.project(x[corner]));
        let triangles: Vec<_> = triangles.iter().map(flat).collect();
        let (area, centroid) = area_and_centroid(&triangles);
        Self { triangles, area, centroid }
    }

    /// The area in m²: the mean width on 4,096 lines across the shadow.
    #[must_use]
    pub fn area(&self) -> f64 {
        self.area
    }

    /// The centroid on the floor, in m.
    #[must_use]
    pub fn centroid(&self) -> [f64; 2] {
        self.centroid
    }

    /// The projected triangles, in m.
    #[must_use]
    pub fn triangles(&self) -> &[[[f64; 2]; 3]] {
        &self.triangles
    }
}

fn area_and_centroid(triangles: &[[[f64; 2]; 3]]) -> (f64, [f64; 2]) {
    let heights = || triangles.iter().flatten().map(|point| point[1]);
    let (low, high) = (heights().fold(f64::INFINITY, f64::min), heights().fold(f64::NEG_INFINITY, f64::max));
    let spacing = (high - low) / LINES as f64;
    if spacing.is_nan() || spacing <= 0.0 || !spacing.is_finite() {
        return (0.0, triangles.first().map_or([0.0; 2], |corners| corners[0]));
    }
    let mut lines: Vec<Vec<[f64; 2]>> = vec![Vec::new(); LINES];
    for corners in triangles {
        let [bottom, top] = [f64::min, f64::max].map(|pick| corners.iter().map(|p| p[1]).reduce(pick).unwrap_or(low));
        let number = |height: f64| ((height - low) / spacing - 0.5).ceil().clamp(0.0, LINES as f64) as usize;
        for (line, spans) in lines.iter_mut().enumerate().take(number(top)).skip(number(bottom)) {
            spans.extend(span(corners, low + (line as f64 + 0.5) * spacing));
        }
    }
    let (mut width, mut moments) = (0.0, [0.0; 2]);
    for (line, spans) in lines.iter_mut().enumerate() {
        spans.sort_by(|one, other| one[0].total_cmp(&other[0]));
        let mut end = f64::NEG_INFINITY;
        for &[from, to] in spans.iter() {
            let from = from.max(end);
            if to <= from {
                continue;
            }
            width += to - from;
            moments[0] += 0.5 * (to - from) * (to + from);
            moments[1] += (to - from) * (low + (line as f64 + 0.5) * spacing);
            end = to;
        }
    }
    (width * spacing, moments.map(|moment| moment / width.max(f64::MIN_POSITIVE)))
}

/// Returns the span of a triangle on the line at a height; `None` if it does not reach it.
fn span(corners: &[[f64; 2]; 3], height: f64) -> Option<[f64; 2]> {
    let crossing = |side: usize| {
        let (from, to) = (corners[side], corners[(side + 1) % 3]);
        let is_crossed = (from[1] <= height) != (to[1] <= height);
        is_crossed.then(|| from[0] + (to[0] - from[0]) * (height - from[1]) / (to[1] - from[1]))
    };
    let mut at = (0..3).filter_map(crossing);
    let (one, other) = (at.next()?, at.next()?);
    Some([one.min(other), one.max(other)])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shadow_counts_once_and_its_centroid_is_that_of_the_area() {
        // Two triangles of area ½ that overlap in a quarter: the cross-sections meet at half height.
        let x = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 2.0], [1.0, 0.0, 2.0], [1.0, 1.0, 2.0]];
        let shadow = Shadow::new(&x, &[[0, 1, 2], [3, 4, 5]], [0.0, 0.0, 9.81]);
        assert!((shadow.area() - 0.75).abs() < 1e-6, "{}", shadow.area());
        assert!((shadow.centroid()[0] - 0.5).abs() < 1e-6, "{:?}", shadow.centroid());
        // From the side both are lines.
        assert!(Shadow::new(&x, &[[0, 1, 2], [3, 4, 5]], [1.0, 0.0, 0.0]).area() < 1e-9);
    }
}
