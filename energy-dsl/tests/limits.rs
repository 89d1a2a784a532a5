//! Functions return their limits where these exist, else a documented value and a flag.

use energy_dsl::energy;
use energy_dsl::{Potential, Residual};

energy! {
    energy Log1p(p: Point) { log1p(p.x) }
    energy Log1pmx(p: Point) { log1pmx(p.x) }
    energy Expm1(p: Point) { expm1(p.x) }
    energy Softplus(p: Point) { softplus(p.x) }
    energy Sinc(p: Point) { sinc(p.x) }
    energy Cosc(p: Point) { cosc(p.x) }
    energy SincSqrt(p: Point) { sinc_sqrt(p.x) }
    energy Sinh(p: Point) { sinh(p.x) }
    energy Cosh(p: Point) { cosh(p.x) }
    energy Tanh(p: Point) { tanh(p.x) }
    energy Atan(p: Point) { atan(p.x) }
    energy Erf(p: Point) { erf(p.x) }
    energy Arcs(p: Point) { asin(p.x) + acos(p.y) }
    energy Huber(p: Point) { huber(p.x, 0.5) }
    residual Blend(q: DualQuat; p: Vec3) { transform(unit(q), p) }
}

/// Returns value, first and second derivative, and whether a flag is set.
fn at<E: Potential<f64, Points = [[f64; 3]; 1], Triangle = [[[f64; 3]; 3]; 1]>>(
    e: &E,
    x: f64,
) -> (f64, f64, f64, bool) {
    let at = e.hessian(&[[x, 0.0, 0.0]]);
    (at.value, at.gradient[0][0], at.hessian[0][0][0], at.flags.any())
}

#[test]
fn removable_singularities_return_the_limit() {
    let (value, first, second, flag) = at(&Sinc::new(), 0.0);
    assert_eq!((value, first, flag), (1.0, 0.0, false));
    assert!((second + 1.0 / 3.0).abs() < 1e-16);
    let (value, first, second, flag) = at(&Cosc::new(), 0.0);
    assert_eq!((value, first, flag), (0.5, 0.0, false));
    assert!((second + 1.0 / 12.0).abs() < 1e-16);
    let (value, first, second, flag) = at(&SincSqrt::new(), 0.0);
    assert_eq!((value, first, flag), (1.0, -1.0 / 6.0, false));
    assert!((second - 1.0 / 60.0).abs() < 1e-17);
    assert_eq!(at(&Log1p::new(), 0.0), (0.0, 1.0, -1.0, false));
    assert_eq!(at(&Log1pmx::new(), 0.0), (0.0, 0.0, -1.0, false));
    assert_eq!(at(&Log1pmx::new(), 1e-200).0, 0.0);
    assert_eq!(at(&Log1pmx::new(), 1e-100).0, -5e-201);
    assert_eq!(at(&Expm1::new(), 0.0), (0.0, 1.0, 1.0, false));
}

#[test]
fn large_arguments_neither_overflow_nor_vanish() {
    assert_eq!(at(&Expm1::new(), f64::INFINITY).0, f64::INFINITY);
    assert_eq!(at(&Expm1::new(), f64::NEG_INFINITY), (-1.0, 0.0, 0.0, false));
    assert_eq!(at(&Expm1::new(), -800.0).0, -1.0);
    assert_eq!(at(&Log1p::new(), f64::INFINITY).0, f64::INFINITY);
    assert_eq!(at(&Log1p::new(), -1.0).0, f64::NEG_INFINITY);
    assert_eq!(at(&Log1pmx::new(), -1.0).0, f64::NEG_INFINITY);
    assert_eq!(at(&Log1p::new(), 1e300).0, 1e300_f64.ln());
    assert_eq!(at(&Softplus::new(), 1e300), (1e300, 1.0, 0.0, false));
    assert_eq!(at(&Softplus::new(), -800.0), (0.0, 0.0, 0.0, false));
    assert_eq!(at(&Softplus::new(), 0.0), (2.0_f64.ln(), 0.5, 0.25, false));
}

#[test]
fn sigmoids_reach_their_limits() {
    for x in [40.0, 1e200, f64::INFINITY] {
        for sign in [1.0, -1.0] {
            assert_eq!(at(&Erf::new(), sign * x), (sign, 0.0, 0.0, false));
            let (value, first, second, flag) = at(&Atan::new(), sign * x);
            assert_eq!((value, flag), ((sign * x).atan(), false));
            assert!(first.is_finite() && second.is_finite() && second * sign <= 0.0, "{x}: {first}, {second}");
            let (value, first, second, flag) = at(&Tanh::new(), sign * x);
            assert_eq!((value, flag), (sign, false));
            assert!(first < 1e-30 && second * sign <= 0.0 && second.abs() < 1e-30);
        }
    }
    assert_eq!(at(&Erf::new(), 0.0), (0.0, std::f64::consts::FRAC_2_SQRT_PI, 0.0, false));
    for element in [at(&Tanh::new(), 0.0), at(&Atan::new(), 0.0), at(&Sinh::new(), 0.0)] {
        assert_eq!(element, (0.0, 1.0, 0.0, false));
    }
    assert_eq!(at(&Cosh::new(), 0.0), (1.0, 0.0, 1.0, false));
    let (value, first, second, _) = at(&Cosh::new(), 709.0);
    assert!(value.is_finite() && value == first && value == second && value == at(&Sinh::new(), 709.0).0);
    assert_eq!(at(&Sinh::new(), -711.0).0, f64::NEG_INFINITY);
    assert_eq!(at(&Tanh::new(), -1e-300).0, -1e-300);
}

/// The same functions in single precision, against those in double precision.
#[test]
fn sigmoids_in_single_precision() {
    macro_rules! compare {
        ($($name:ident),*) => {$(
            for i in -40..=40 {
                let x = i as f32 / 4.0 + 0.01;
                let (single, double) = ($name::<f32>::new(), $name::<f64>::new());
                let (single, double) = (single.hessian(&[[x, 0.0, 0.0]]), double.hessian(&[[f64::from(x), 0.0, 0.0]]));
                let pairs = [
                    (single.value, double.value),
                    (single.gradient[0][0], double.gradient[0][0]),
                    (single.hessian[0][0][0], double.hessian[0][0][0]),
                ];
                for (single, double) in pairs {
                    let error = (f64::from(single) - double).abs();
                    let smallest = f64::from(f32::MIN_POSITIVE);
                    assert!(error <= 16.0 * 2.0_f64.powi(-24) * double.abs() + smallest, "{x}: {single} {double}");
                }
            }
        )*};
    }
    compare!(Sinh, Cosh, Tanh, Atan, Erf);
}

#[test]
fn arcs_are_clamped_and_flagged() {
    let right = std::f64::consts::FRAC_PI_2;
    for (x, flagged) in [(1.0, false), (1.5, true), (-1.0, false), (-2.0, true)] {
        let value = Arcs::<f64>::new().value(&[[x, x, 0.0]]);
        assert_eq!(value.flags.degenerate, flagged, "{x}");
        assert!((value.value - right).abs() < 1e-15, "asin + acos = π/2, at {x}");
        let hessian = Arcs::<f64>::new().hessian(&[[x, x, 0.0]]);
        assert!(hessian.flags.degenerate && hessian.gradient == [[0.0; 3]] && hessian.hessian == [[[0.0; 3]; 3]]);
    }
}

#[test]
fn losses_change_over_at_their_threshold() {
    assert_eq!(at(&Huber::new(), 0.25), (0.03125, 0.25, 1.0, false));
    assert_eq!(at(&Huber::new(), 0.5), (0.125, 0.5, 1.0, true));
    assert_eq!(at(&Huber::new(), -2.0), (0.875, -0.5, 0.0, false));
}

/// A blend that cancels has no direction.
#[test]
fn no_motion_is_flagged() {
    let at = Blend::<f64>::new([1.0, 2.0, 3.0]).jacobian(&[0.0, 0.0, 0.0, 0.0, 1.0, 2.0, 3.0, 4.0]);
    assert!(at.flags.degenerate);
    assert!(at.value.iter().chain(&at.jacobian).all(|x| x.is_finite()), "{at:?}");
}
