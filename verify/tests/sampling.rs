//! What the audit draws its inputs from must not make it fail, or run forever, on sound elements.
#![allow(missing_docs)]

use energy_dsl::energy;
use verify::assert_derivatives;

energy! {
    /// One everywhere: derivatives are rounding errors about zero, however they are found.
    energy Constant(p, q: Point; k: Scalar) { k * norm_squared(p - q) / norm(p - q)^2 }

    /// More points than a small box holds far apart from each other.
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
