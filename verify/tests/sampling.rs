//! The sampling of inputs must not fail, or run forever, on correct elements.

use energy_dsl::energy;
use verify::assert_derivatives;

energy! {
    /// Constant: all derivatives are rounding errors around zero, by every route.
    energy Constant(p, q: Point; k: Scalar) { k * norm_squared(p - q) / norm(p - q)^2 }

    /// More points than fit into a small box at large distances.
    energy Crowd(a, b, c, d, e, f, g, h, i, j: Point; k: Scalar) {
        k * norm_squared(a - b) * norm_squared(c - d) + norm_squared(e - f) * dot(g - h, i - j)
    }
}

#[test]
fn a_derivative_that_vanishes_passes() {
    assert_derivatives::<Constant>(50);
}

#[test]
fn ten_points_can_be_drawn() {
    assert_derivatives::<Crowd>(2);
}
