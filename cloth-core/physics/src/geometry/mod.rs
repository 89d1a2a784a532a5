//! Vector arithmetic, rigid motions, boxes and hierarchies of boxes.

mod bounds;
mod hierarchy;
mod near;
mod overlap;
mod pose;
mod rounded_boxes;

use energy_dsl::Real;

pub use bounds::{Bounds, Coordinate, MovingBounds, RoundedMovingBounds, Volume};
pub use hierarchy::Hierarchy;
pub use pose::Pose;

// Vectors of numbers, or of SIMD lanes of numbers. They are written out by components: closures that build arrays would
// stay calls, which SIMD levels cannot compile for themselves.

/// a − b.
#[inline(always)]
pub fn subtract<V: Real>(a: [V; 3], b: [V; 3]) -> [V; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// a × b.
#[inline(always)]
pub fn cross<V: Real>(a: [V; 3], b: [V; 3]) -> [V; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// a · b.
#[inline(always)]
pub fn dot<V: Real>(a: [V; 3], b: [V; 3]) -> V {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// ‖a‖.
#[inline(always)]
pub fn norm<V: Real>(a: [V; 3]) -> V {
    dot(a, a).sqrt()
}

/// a + s b.
#[inline(always)]
pub fn add_scaled<V: Real>(a: [V; 3], s: V, b: [V; 3]) -> [V; 3] {
    [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]]
}
