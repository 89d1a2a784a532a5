use energy_dsl::Vector3;

use crate::geometry::{Bounds, MovingBounds};

/// A ball for each vertex, which moves on a straight line.
#[derive(Clone, Copy, Debug)]
pub struct MovingBalls<'a> {
    /// The centres at the start and at the end.
    pub ends: [&'a [Vector3<f64>]; 2],
    /// The radii, in m.
    pub radii: &'a [f64],
}

impl MovingBalls<'_> {
    /// Returns the box around the ball of a vertex.
    #[inline]
    pub fn bounds(&self, vertex: usize) -> MovingBounds {
        let ball = |centre: Vector3<f64>| Bounds { low: centre, high: centre }.extended(self.radii[vertex]);
        let [start, end] = self.ends;
        MovingBounds([ball(start[vertex]), ball(end[vertex])])
    }
}
