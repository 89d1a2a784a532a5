//! Inputs outside of a formula's domain: an energy is infinite there, everything else 0, and all of it is flagged.

use std::time::{Duration, Instant};

use energy_dsl::{Constraint, ForceLaw, Potential, ReducedPotential, Residual, energy};

energy! {
    energy Hencky(x0, x1, x2, x3: Point; μ, λ: Scalar) {
        let s = singular_values(columns(x1 - x0, x2 - x0, x3 - x0));
        let a = log(s[0]);
        let b = log(s[1]);
        let c = log(s[2]);
        μ * (a^2 + b^2 + c^2) + λ / 2 * (a + b + c)^2
    }
    energy NeoHooke(x0, x1, x2: Point; μ, λ: Scalar) {
        let a = x1 - x0;
        let b = x2 - x0;
        let J = a.x * b.y - a.y * b.x;
        μ / 2 * (norm_squared(a) + norm_squared(b) - 2 - 2 * log(J)) + λ / 2 * log(J)^2
    }
    energy Gent(p: Point; J_m: Scalar) { -J_m / 2 * log(1 - norm_squared(p) / J_m) }
    energy Successor(p: Point) { -log1p(p.x) }
    energy Root(p: Point) { sqrt(p.x) * p.y }
    energy Power(p: Point; n: Scalar) { p.x^n }
    energy Branches(p: Point) { if p.x > 0 { log(p.x) } else { p.x^2 } }
    energy Condition(p: Point) { if log(p.x) > 0 { 1 } else { p.y } }
    energy Cancelling(p: Point) { log((p.x + 1e8)^2 - p.x^2 - 2e8 * p.x - 1e16 + p.y) }
    energy Refused(p: Point; k: Scalar[N]) { if p.x <= 0 { infinity } else { -k * p.x } }
    constraint Depth(p: Point) { log(p.x) }
    force Pull(p: Point) { [log(p.x) * p] }
    residual Distance(p: Vec2) { [sqrt(p[0]), p[1]] }
}

#[test]
fn energies_are_infinite_and_their_derivatives_zero() {
    let flat = [[0.0; 3], [1.1, 0.0, 0.0], [0.2, -0.9, 0.1]];
    let at = NeoHooke::<f64>::new(1.0, 1.0).hessian(&flat);
    assert!(at.value == f64::INFINITY && at.flags.degenerate && !at.flags.kink);
    assert_eq!((at.gradient, at.hessian), ([[0.0; 3]; 3], [[[0.0; 3]; 3]; 6]));
    let inverted = [[0.0; 3], [1.1, 0.1, 0.0], [0.2, 0.9, 0.1], [0.3, 0.1, -0.8]];
    let hencky = Hencky::<f64>::new(1.0, 1.0);
    let at = hencky.gradient(&inverted);
    assert!(at.value == f64::INFINITY && at.flags.degenerate && at.gradient == [[0.0; 3]; 4]);
    let at = hencky.reduced_hessian(&inverted);
    assert!(at.value == f64::INFINITY && at.flags.degenerate && at.hessian.iter().all(|entry| *entry == 0.0));
    assert_eq!(hencky.hessian_vector(&inverted, &[[1.0; 3]; 4]).product, [[0.0; 3]; 4]);
    let single = Hencky::<f32>::new(1.0, 1.0).value(&inverted.map(|point| point.map(|x| x as f32)));
    assert!(single.value == f32::INFINITY && single.flags.degenerate);
    assert_eq!(Gent::<f64>::new(3.0).value(&[[2.0, 0.0, 0.0]]).value, f64::INFINITY);
    assert_eq!(Successor::<f64>::new().value(&[[-1.5, 0.0, 0.0]]).value, f64::INFINITY);
    assert_eq!(Root::<f64>::new().value(&[[-1.0, 0.0, 0.0]]).value, f64::INFINITY);
}

#[test]
fn sizes_without_a_square_are_outside_too() {
    for size in [1e-170, 1e170] {
        let at = NeoHooke::<f64>::new(1.0, 1.0).value(&[[0.0; 3], [size, 0.0, 0.0], [0.0, -size, 0.0]]);
        assert!(at.value == f64::INFINITY && at.flags.degenerate, "{size}: {at:?}");
    }
}

#[test]
fn powers_with_integer_exponents_have_no_boundary() {
    let at = Power::<f64>::new(3.0).hessian(&[[-2.0, 0.0, 0.0]]);
    assert!(at.value == -8.0 && at.gradient[0][0] == 12.0 && !at.flags.any(), "{at:?}");
    let at = Power::<f64>::new(2.5).hessian(&[[-2.0, 0.0, 0.0]]);
    assert!(at.value == f64::INFINITY && at.flags.degenerate, "{at:?}");
}

#[test]
fn a_branch_that_is_not_taken_has_no_domain() {
    let at = Branches::<f64>::new().hessian(&[[-3.0, 0.0, 0.0]]);
    assert!(at.value == 9.0 && at.gradient[0][0] == -6.0 && at.hessian[0][0][0] == 2.0 && !at.flags.any(), "{at:?}");
    // A condition without a value fails.
    let at = Condition::<f64>::new().gradient(&[[-1.0, 4.0, 0.0]]);
    assert!(at.value == 4.0 && at.gradient[0] == [0.0, 1.0, 0.0] && !at.flags.any(), "{at:?}");
}

#[test]
fn formulas_may_be_infinite() {
    let wall = Refused::<f64>::new(3.0);
    let at = wall.hessian(&[[-1.0, 0.0, 0.0]]);
    assert!(at.value == f64::INFINITY && at.flags.degenerate && at.gradient == [[0.0; 3]], "{at:?}");
    assert!(at.hessian == [[[0.0; 3]; 3]]);
    let at = wall.gradient(&[[2.0, 0.0, 0.0]]);
    assert!(at.value == -6.0 && at.gradient[0][0] == -3.0 && !at.flags.any(), "{at:?}");
    let single = Refused::<f32>::new(3.0).value(&[[-1.0, 0.0, 0.0]]);
    assert!(single.value == f32::INFINITY && single.flags.degenerate);
}

/// Within the rounding errors of the argument, its sign is unknown, and rays decide.
#[test]
fn rounding_errors_do_not_lead_outside() {
    let at = Cancelling::<f64>::new().value(&[[0.3, 0.0, 0.0]]);
    assert!(at.value == f64::NEG_INFINITY || at.value.is_finite() || at.flags.degenerate, "{at:?}");
    assert!(Cancelling::<f64>::new().value(&[[0.3, -1e3, 0.0]]).value == f64::INFINITY);
}

#[test]
fn constraints_forces_and_residuals_are_zero() {
    let at = Depth::<f64>::new(2.0, 1.0).constraint_jacobian(&[[-1.0, 0.0, 0.0]]);
    assert!(at.value == [0.0] && at.jacobian == [[0.0; 3]] && at.flags.degenerate);
    // ½ k C² is an energy.
    assert_eq!(Depth::<f64>::new(2.0, 1.0).value(&[[-1.0, 0.0, 0.0]]).value, f64::INFINITY);
    let at = Pull::<f64>::new().force(&[[-1.0, 2.0, 0.0]], &[[0.0; 3]]);
    assert!(at.force == [[0.0; 3]] && at.flags.degenerate);
    let at = Distance::<f64>::new().jacobian(&[-1.0, 2.0]);
    assert!(at.value == [0.0; 2] && at.jacobian == [0.0; 4] && at.flags.degenerate);
}

/// One call took 158 ms while rays looked for a limit.
#[test]
fn no_ray_is_followed() {
    let (hencky, inverted) =
        (Hencky::<f64>::new(1.0, 1.0), [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.1, 0.2, -1.0]]);
    let start = Instant::now();
    for _ in 0..100 {
        assert!(hencky.value(&inverted).flags.degenerate);
    }
    assert!(start.elapsed() < Duration::from_secs(1), "{:?} for 100 calls", start.elapsed());
}
