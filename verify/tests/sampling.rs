//! The sampling of inputs must not fail, or run forever, on correct elements.

use energy_dsl::energy;
use verify::assert_derivatives;
use verify::audit::{Options, Target, audit_all, describe_failure};
use verify::blocks::BlockName;
use verify::sample::Sample;

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

/// Where the vectors are orthogonal, derivatives of all orders that are compared are 0, and differences only nearly so.
#[test]
fn a_fourth_power_passes_at_its_minimum() {
    let text = "energy HydrogenBond(d, h, a: Point; A, B: Scalar) { let r = norm(h - a); \
                let c = dot(unit(d - h), unit(a - h)); (A / r^12 - B / r^10) * c^4 }";
    let targets = Target::of_text(text, "bond.energy").unwrap();
    let report = audit_all(&targets, None, Options { samples: 60, ..Options::default() });
    assert_eq!(report.failures().map(describe_failure).collect::<Vec<_>>(), [""; 0]);
}

/// A stated range holds for each entry of an array, and for unknowns that are not points.
#[test]
fn unknowns_have_the_range_of_their_input() {
    let text = "#[audit(domain(T = 3..4, d = 0.1..0.9))] energy Hot(x, y: Point, T: Scalar, d: [Scalar; 2]; k: Scalar) { \
                k * (T - 3)^1.5 * norm_squared(x - y) + log(d[0] * d[1]) + log(1 - d[0]) }";
    let subject = Target::of_text(text, "hot.energy").unwrap().remove(0).subject().unwrap();
    let mut sampler = subject.sampler(11);
    for _ in 0..50 {
        let positions = sampler.sample().positions;
        assert!((3.0..4.0).contains(&positions[6]), "{positions:?}");
        assert!(positions[7..].iter().all(|d| (0.1..0.9).contains(d)), "{positions:?}");
    }
}

/// Points at rest may be an array: their deformation has the stated stretches.
#[test]
fn rest_shapes_may_be_arrays() {
    let text = "#[audit(domain(strain = 0.9..1.1))] energy Area(x: [Point; 3]; rest u: [Vec2; 3]; k: Scalar) { \
                rest { let A = det(columns(u[1] - u[0], u[2] - u[0])); } \
                k * norm(cross(x[1] - x[0], x[2] - x[0])) / A }";
    let subject = Target::of_text(text, "area.energy").unwrap().remove(0).subject().unwrap();
    let mut sampler = subject.sampler(12);
    for _ in 0..50 {
        let sample = Sample { parameters: vec![1.0], ..sampler.sample() };
        let ratio = subject.answer(&sample).unwrap().block(BlockName::Energy).numbers[0];
        assert!((0.81..1.21).contains(&ratio), "{ratio}");
    }
}
