//! The outline of a shadow, r(φ) about a centre, and its nodes.

use std::f64::consts::TAU;

use super::Shadow;

/// Number of directions of an outline.
const DIRECTIONS: usize = 1440;

/// The farthest point of a shadow in each direction about a centre.
#[derive(Clone, Debug, PartialEq)]
pub struct Outline {
    radii: Vec<f64>,
}

impl Outline {
    /// Creates the outline of a shadow about a centre on the floor, in m. A direction without shadow has the radius 0.
    #[must_use]
    pub fn new(shadow: &Shadow, centre: [f64; 2]) -> Self {
        let mut outline = Self { radii: vec![0.0; DIRECTIONS] };
        for corners in shadow.triangles() {
            let around = corners.map(|point| [point[0] - centre[0], point[1] - centre[1]]);
            (0..3).for_each(|side| outline.add_segment(around[side], around[(side + 1) % 3]));
        }
        outline
    }

    /// Creates an outline from radii in directions that divide the circle evenly, in m.
    #[must_use]
    pub fn of_radii(radii: Vec<f64>) -> Self {
        Self { radii }
    }

    /// The radii in directions that divide the circle evenly, the first along the first axis of the floor, in m.
    #[must_use]
    pub fn radii(&self) -> &[f64] {
        &self.radii
    }

    /// Extends the outline to a segment.
    fn add_segment(&mut self, from: [f64; 2], to: [f64; 2]) {
        let spacing = TAU / self.radii.len() as f64;
        let [start, end] = [from, to].map(|point| point[1].atan2(point[0]));
        let turn = (end - start + 1.5 * TAU).rem_euclid(TAU) - 0.5 * TAU;
        let (first, last) = (start.min(start + turn) / spacing, start.max(start + turn) / spacing);
        if !(first.is_finite() && last.is_finite()) {
            return;
        }
        let way = [to[0] - from[0], to[1] - from[1]];
        let farther = from[0].hypot(from[1]).max(to[0].hypot(to[1]));
        let across = from[0] * way[1] - from[1] * way[0];
        for number in (first - 1e-9).ceil() as i64..=(last + 1e-9).floor() as i64 {
            let (sine, cosine) = (number as f64 * spacing).sin_cos();
            let radius = across / (cosine * way[1] - sine * way[0]);
            let place = number.rem_euclid(self.radii.len() as i64) as usize;
            // A segment along the direction meets it up to its farther end.
            if radius.is_finite() {
                self.radii[place] = self.radii[place].max(radius.min(farther));
            }
        }
    }

    /// Returns the number of maxima of the outline with at least a prominence, in m: the depth to which the outline
    /// falls on both sides before it rises above the maximum; for the largest one, down to the smallest radius.
    ///
    /// ```
    /// use cloth_core::measure::Outline;
    /// let radius = |step: usize| 0.12 + 0.01 * (5.0 * f64::to_radians(step as f64)).cos();
    /// let outline = Outline::of_radii((0..360).map(radius).collect());
    /// assert_eq!((outline.nodes(0.019), outline.nodes(0.021)), (5, 0));
    /// ```
    #[must_use]
    pub fn nodes(&self, prominence: f64) -> usize {
        self.prominences().into_iter().filter(|&depth| depth > 0.0 && depth >= prominence).count()
    }

    /// Returns the prominence of each maximum, in m: floods the circle from its highest point downwards. Where two
    /// islands meet, the lower peak gets its prominence.
    fn prominences(&self) -> Vec<f64> {
        let count = self.radii.len();
        let mut order: Vec<usize> = (0..count).collect();
        order.sort_by(|&one, &other| self.radii[other].total_cmp(&self.radii[one]));
        let mut found = Vec::new();
        // The island of each direction that has emerged, by its peak.
        let mut parent: Vec<Option<usize>> = vec![None; count];
        fn peak(parent: &mut [Option<usize>], mut at: usize) -> usize {
            while let Some(next) = parent[at].filter(|next| *next != at) {
                parent[at] = parent[next];
                at = next;
            }
            at
        }
        for &at in &order {
            parent[at] = Some(at);
            for neighbour in [(at + 1) % count, (at + count - 1) % count] {
                if parent[neighbour].is_none() {
                    continue;
                }
                let [one, other] = [peak(&mut parent, at), peak(&mut parent, neighbour)];
                let (low, high) = if self.radii[one] < self.radii[other] { (one, other) } else { (other, one) };
                if one != other {
                    found.push(self.radii[low] - self.radii[at]);
                    parent[low] = Some(high);
                }
            }
        }
        if let (Some(&highest), Some(&lowest)) = (order.first(), order.last()) {
            found.push(self.radii[highest] - self.radii[lowest]);
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_waves_on_large_ones_are_no_nodes() {
        let waves = |step: usize| {
            let phi = TAU * step as f64 / 1440.0;
            0.12 + 0.01 * (7.0 * phi + 0.3).cos() + 0.0005 * (90.0 * phi).cos()
        };
        let outline = Outline::of_radii((0..1440).map(waves).collect());
        assert_eq!(outline.nodes(0.003), 7);
        assert!(outline.nodes(1e-6) > 30);
        assert_eq!(Outline::of_radii(vec![0.1; 90]).nodes(0.0), 0);
        assert_eq!(Outline::of_radii(Vec::new()).nodes(0.0), 0);
    }
}
