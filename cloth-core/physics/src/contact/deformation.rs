//! Meshes that deform over time, such as animated characters.

use std::sync::Arc;

use energy_dsl::Vector3;

use crate::collision::{Closest, PairKind};
use crate::geometry::{add_scaled, cross, dot, norm, subtract};
use crate::motion::{Key, Motion};

/// The vertices of a mesh in frames at a constant rate. They move on straight lines from frame to frame, and rest after
/// the last one.
#[derive(Clone, Debug, PartialEq)]
pub struct Deformation {
    /// The vertices of each frame, in m; at least one frame.
    frames: Arc<[Vec<Vector3<f64>>]>,
    /// Frames per second.
    rate: f64,
}

impl Deformation {
    /// Creates a deformation from frames with the same number of vertices, in m, and their rate in 1/s.
    ///
    /// ```
    /// use cloth_physics::contact::Deformation;
    ///
    /// let frames = vec![vec![[0.0, 0.0, 0.0]], vec![[1.0, 0.0, 0.0]]];
    /// let deformation = Deformation::new(frames, 2.0);
    /// assert_eq!(deformation.vertices(0.25), [[0.5, 0.0, 0.0]]);
    /// assert_eq!(deformation.vertices(9.0), [[1.0, 0.0, 0.0]]);
    /// ```
    ///
    /// # Panics
    /// Without a frame, or if frames have different numbers of vertices.
    #[must_use]
    pub fn new(frames: Vec<Vec<Vector3<f64>>>, rate: f64) -> Self {
        assert!(frames.windows(2).all(|pair| pair[0].len() == pair[1].len()), "frames of one mesh");
        assert!(!frames.is_empty(), "at least one frame");
        Self { frames: frames.into(), rate }
    }

    /// Returns the vertices at a time, in m.
    #[must_use]
    pub fn vertices(&self, time: f64) -> Vec<Vector3<f64>> {
        let (before, part) = self.frame_at(time);
        let [from, to] = [before, before + 1].map(|frame| &self.frames[frame.min(self.frames.len() - 1)]);
        from.iter().zip(to).map(|(from, to)| add_scaled(*from, part, subtract(*to, *from))).collect()
    }

    /// Whether vertices may move between two times, in s.
    #[must_use]
    pub fn moves(&self, from: f64, to: f64) -> bool {
        self.frame_at(from) != self.frame_at(to)
    }

    /// The frame before a time, and the part of the way to the next one.
    fn frame_at(&self, time: f64) -> (usize, f64) {
        let last = self.frames.len() - 1;
        let frames = (time * self.rate).clamp(0.0, last as f64);
        let frame = (frames as usize).min(last);
        (frame, frames - frame as f64)
    }

    /// Returns the motion of a point that is fixed to the nearest of some triangles at the start: it keeps its position
    /// relative to the corners and the normal.
    pub fn carried(&self, x: Vector3<f64>, triangles: &[[usize; 3]]) -> Motion {
        let start = &self.frames[0];
        let closest = |triangle: &[usize; 3]| {
            let [a, b, c] = triangle.map(|corner| start[corner]);
            Closest::between(PairKind::PointTriangle, &[x, a, b, c])
        };
        let distances = triangles.iter().map(|triangle| (*triangle, closest(triangle)));
        let nearest = distances.min_by(|a, b| a.1.distance.total_cmp(&b.1.distance));
        let Some((triangle, Closest { weights: [_, u, v, w], .. })) = nearest else { return Motion::default() };
        // The weights of the triangle's corners are negative.
        let foot = |frame: &[Vector3<f64>]| {
            let corners = triangle.map(|corner| frame[corner]);
            corners.iter().zip([-u, -v, -w]).fold([0.0; 3], |sum, (corner, weight)| add_scaled(sum, weight, *corner))
        };
        let away = subtract(x, foot(start));
        let local = axes(triangle.map(|corner| start[corner])).map(|axis| dot(axis, away));
        let at = |frame: &[Vector3<f64>]| {
            let axes = axes(triangle.map(|corner| frame[corner]));
            axes.iter().zip(local).fold(foot(frame), |sum, (axis, length)| add_scaled(sum, length, *axis))
        };
        let key = |(number, frame): (usize, &Vec<Vector3<f64>>)| Key {
            time: number as f64 / self.rate,
            translate: subtract(at(frame), at(start)),
            ..Key::default()
        };
        Motion { keys: self.frames.iter().enumerate().map(key).collect(), ..Motion::default() }
    }
}

/// Unit vectors along the first side of a triangle, across it in the plane, and along the normal.
fn axes([a, b, c]: [Vector3<f64>; 3]) -> [Vector3<f64>; 3] {
    let unit = |v: Vector3<f64>| v.map(|component| component / norm(v));
    let along = unit(subtract(b, a));
    let normal = unit(cross(subtract(b, a), subtract(c, a)));
    [along, cross(normal, along), normal]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_carried_point_keeps_its_place_on_a_triangle_that_moves_and_turns() {
        let first = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [5.0, 5.0, 5.0]];
        // A quarter turn about the third axis, and a step up.
        let second = vec![[0.0, 0.0, 2.0], [0.0, 1.0, 2.0], [-1.0, 0.0, 2.0], [5.0, 5.0, 5.0]];
        let deformation = Deformation::new(vec![first, second], 10.0);
        let x = [0.25, 0.125, 0.5];
        let motion = deformation.carried(x, &[[0, 1, 2], [1, 2, 3]]);
        assert_eq!(motion.pose(0.0).transform(x), x);
        let end = motion.pose(0.1).transform(x);
        assert!(norm(subtract(end, [-0.125, 0.25, 2.5])) < 1e-14, "{end:?}");
        assert!(deformation.moves(0.0, 0.05) && !deformation.moves(0.1, 0.2));
    }
}
