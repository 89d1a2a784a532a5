//! Results at singular inputs: finite or flagged, and the limit where there is one.

use energy_dsl::{ForceLaw, Hessian, Potential, energy};

energy! {
    energy Ratio(p: Point) { p.x / p.x + p.y }
    energy ThreeHalves(p: Point) { p.x^1.5 }
    energy Root(p: Point; a: Scalar) { sqrt(p.x + a) }
    energy Logarithm(p: Point; a: Scalar) { log(p.x + a) }
    energy Turn(p: Point) { atan2(p.y, p.x) }
    energy LennardJones(p, q: Point; σ: Scalar) { (σ / norm(p - q))^12 }
    energy Hooke(p, q: Point; k, L: Scalar) { k / 2 * (norm(p - q) - L)^2 }
    energy Rod(a, b, c: Point) { angle(b - a, c - b)^2 }
    energy Far(p: Point; ε: Scalar) { let n = norm(p); if n > ε { n } else { n^2 } }
    energy Size(p: Point) { abs(p.x) + norm_squared(p) }
    energy OneSided(p: Point) { max(p.x, 0)^2 }
    energy DomainEdge(p: Point) { if log(p.y) < 0 { p.x } else { p.x^2 } }
    energy Jump(p: Point) { if p.x > 0 { 1 } else { 0 } }
    energy Joint(p: Point) { max(p.x, 0)^3 - min(p.y, 0)^4 + abs(p.z)^3 + p.x }
    energy Sum(p: Point) { norm(p) * norm(p) + unit(p).x * norm(p) }
    energy Quadratic(p, q: Point; k: Scalar) { k * norm_squared(p - q) }
    energy Deep(p: Point) { (1 - cos(norm(p))) / norm_squared(p) }
    energy Opposite(a, b: Point) { 1 + dot(unit(a), unit(b)) }
    energy Stretched(x0, x1, x2: Point; rest u0, u1, u2: Vec2) {
        rest { let B = inverse(columns(u1 - u0, u2 - u0)); }
        let F = columns(x1 - x0, x2 - x0) * B;
        trace(transpose(F) * F)
    }
    force Pull(p, q: Point; k: Scalar) { [k * unit(p - q) * norm(p - q), k * (q - p)] }
}

const ORIGIN: [f64; 3] = [0.0; 3];

fn flags<const N: usize, H>(of: &Hessian<f64, [[f64; 3]; N], H>) -> (bool, bool)
where
    H: energy_dsl::Array<energy_dsl::Block<f64>>,
{
    (of.flags.degenerate, of.flags.kink)
}

#[test]
fn limits_are_returned_without_a_flag() {
    let ratio = Ratio::<f64>::new().hessian(&[ORIGIN]);
    assert_eq!((ratio.value, ratio.gradient, ratio.hessian), (1.0, [[0.0, 1.0, 0.0]], [[[0.0; 3]; 3]]));
    assert_eq!(flags(&ratio), (false, false));
    let power = ThreeHalves::<f64>::new().gradient(&[ORIGIN]);
    assert_eq!((power.value, power.gradient, power.flags.any()), (0.0, [ORIGIN], false));
    let sum = Sum::<f64>::new().gradient(&[ORIGIN]);
    assert!(sum.value == 0.0 && (sum.gradient[0][0] - 1.0).abs() < 1e-15 && !sum.flags.any());
    assert_eq!(sum.gradient[0][1..], [0.0; 2]);
    let deep = Deep::<f64>::new().hessian(&[ORIGIN]);
    assert!((deep.value - 0.5).abs() < 1e-15 && deep.gradient == [ORIGIN] && flags(&deep) == (false, false));
    for (i, row) in deep.hessian[0].iter().enumerate() {
        for (j, entry) in row.iter().enumerate() {
            let expected = if i == j { -1.0 / 12.0 } else { 0.0 };
            assert!((entry - expected).abs() < 1e-13, "{i}, {j}: {entry}");
        }
    }
}

#[test]
fn a_straight_rod_is_as_stiff_as_a_nearly_straight_one() {
    let at = |y: f64| Rod::<f64>::new().hessian(&[[-1.0, 0.0, 0.0], ORIGIN, [1.0, y, 0.0]]);
    let (straight, bent) = (at(0.0), at(1e-200));
    assert_eq!((straight.value, straight.gradient, flags(&straight)), (0.0, [ORIGIN; 3], (false, false)));
    assert!((straight.hessian[5][1][1] - 2.0).abs() < 1e-13, "{:?}", straight.hessian[5]);
    for (a, b) in straight.hessian.as_flattened().as_flattened().iter().zip(bent.hessian.as_flattened().as_flattened())
    {
        assert!((a - b).abs() < 1e-12, "{a} {b}");
    }
}

#[test]
fn energies_that_grow_beyond_all_bounds_are_infinite_and_flagged() {
    let close = LennardJones::new(1.0).hessian(&[[0.5; 3]; 2]);
    assert_eq!((close.value, close.gradient, flags(&close)), (f64::INFINITY, [ORIGIN; 2], (true, false)));
    assert!(close.hessian.as_flattened().as_flattened().iter().all(|h| *h == 0.0));
    let far = Hooke::new(10.0, 1.0).hessian(&[[f64::INFINITY, 0.0, 0.0], ORIGIN]);
    assert_eq!((far.value, far.flags.degenerate, far.gradient), (f64::INFINITY, true, [ORIGIN; 2]));
    let stretched = Quadratic::new(2.0).hessian(&[[1e200, 0.0, 0.0], ORIGIN]);
    assert!(stretched.value == f64::INFINITY && stretched.flags.degenerate, "it overflows where its terms do");
}

#[test]
fn outside_the_domain_is_flagged() {
    for value in [Root::new(-1.0).hessian(&[ORIGIN]), Logarithm::new(-1.0).hessian(&[ORIGIN])] {
        assert_eq!((value.value, value.gradient, flags(&value)), (f64::INFINITY, [ORIGIN], (true, false)));
    }
    let edge = Root::new(0.0).gradient(&[ORIGIN]);
    assert_eq!((edge.value, edge.gradient, edge.flags.degenerate), (0.0, [ORIGIN], true));
    assert!(!Root::new(0.0).value(&[ORIGIN]).flags.any(), "the root itself is regular");
    let turn = Turn::<f64>::new().hessian(&[ORIGIN]);
    assert_eq!((turn.value, turn.gradient, flags(&turn)), (0.0, [ORIGIN], (true, false)));
    let lost = Hooke::new(10.0, 1.0).hessian(&[[f64::NAN, 0.0, 0.0], ORIGIN]);
    assert!(lost.value.is_nan() && lost.flags.degenerate);
}

#[test]
fn a_branch_that_ends_with_the_domain_of_its_condition_is_a_kink() {
    // If p.y < 0, the logarithm is NaN, and the comparison fails.
    let edge = DomainEdge::<f64>::new();
    let at = edge.gradient(&[[0.5, 0.0, 0.0]]);
    assert!(at.flags.any(), "{at:?}");
    assert!(!edge.gradient(&[[0.5, 0.1, 0.0]]).flags.any() && !edge.gradient(&[[0.5, -0.1, 0.0]]).flags.any());
}

#[test]
fn kinks_have_the_derivatives_of_one_side() {
    let size = Size::<f64>::new().hessian(&[ORIGIN]);
    assert_eq!((size.value, size.gradient, flags(&size)), (0.0, [[1.0, 0.0, 0.0]], (false, true)));
    assert_eq!(size.hessian[0][0], [2.0, 0.0, 0.0]);
    let one_sided = OneSided::<f64>::new();
    assert!(!one_sided.gradient(&[ORIGIN]).flags.any(), "the first derivative is continuous");
    assert_eq!(flags(&one_sided.hessian(&[ORIGIN])), (false, true));
    let jump = Jump::<f64>::new().value(&[ORIGIN]);
    assert_eq!((jump.value, jump.flags.degenerate), (0.0, true));
}

#[test]
fn joints_with_equal_second_derivatives_are_regular() {
    let joint = Joint::<f64>::new().hessian(&[ORIGIN]);
    assert_eq!((joint.value, joint.gradient, flags(&joint)), (0.0, [[1.0, 0.0, 0.0]], (false, false)));
    assert_eq!(joint.hessian[0], [ORIGIN; 3]);
}

#[test]
fn a_branch_that_is_not_taken_does_not_matter() {
    let inside = Far::new(0.1).hessian(&[ORIGIN]);
    assert_eq!((inside.value, inside.gradient, flags(&inside)), (0.0, [ORIGIN], (false, false)));
    assert_eq!(inside.hessian[0], [[2.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 2.0]]);
    assert_eq!(flags(&Far::new(-1.0).hessian(&[ORIGIN])), (true, false));
}

#[test]
fn forces_have_limits_too() {
    let pull = Pull::new(3.0).jacobians(&[ORIGIN; 2], &[ORIGIN; 2]);
    assert_eq!((pull.force, pull.flags.any()), ([ORIGIN; 2], false));
    assert!((pull.by_position[0][0][0] - 3.0).abs() < 1e-14 && pull.by_position[0][0][1] == 0.0);
}

#[test]
fn one_plus_the_cosine_of_opposite_vectors_keeps_its_digits() {
    let tilt = 1e-9;
    let at = Opposite::<f64>::new().gradient(&[[1.0, 0.0, 0.0], [-1.0, tilt, 0.0]]);
    let expected = tilt * tilt / 2.0;
    assert!((at.value / expected - 1.0).abs() < 1e-14, "{}", at.value);
    assert!((at.gradient[1][1] / tilt - 1.0).abs() < 1e-14);
}

#[test]
fn an_inverted_rest_shape_is_refused() {
    assert!(Stretched::new([0.0, 0.0], [1.0, 0.0], [0.0, 1.0]).is_ok());
    for flipped in [[0.0, -1.0], [2.0, 0.0]] {
        let error = Stretched::new([0.0, 0.0], [1.0, 0.0], flipped).unwrap_err();
        assert!(error.to_string().contains("inverted"), "{error}");
    }
}
