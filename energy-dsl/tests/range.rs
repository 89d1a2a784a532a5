//! Every result is finite or flagged, also where intermediate results or derivatives overflow.

use energy_dsl::{Block, Hessian, Potential, Real, energy};

energy! {
    energy Tanh(p: Point; k: Scalar) { tanh(k * p.x) }
    energy Loss(p: Point; k: Scalar) { huber(k * p.x, 1) }
    energy Sine(p: Point; k: Scalar) { sin(k * p.x) }
    energy Plus(p: Point; k: Scalar) { softplus(k * p.x) }
    energy Bell(p: Point; k: Scalar) { exp(-(k * p.x)^2) }
    energy Inverse(p: Point; k: Scalar) { atan(k * p.x) }
    energy Law(p, q: Point; K: Scalar) { K * norm(p - q)^3 }
}

type OfPoint<T> = Hessian<T, [[T; 3]; 1], [Block<T>; 1]>;

/// Returns whether all results are finite or flagged.
fn is_sound<T: Real<Mask = bool>>(at: &OfPoint<T>) -> bool {
    let numbers = std::iter::once(&at.value).chain(&at.gradient[0]).chain(at.hessian[0].as_flattened());
    at.flags.any() || numbers.into_iter().all(|x| x.abs().less(T::from_f64(f64::INFINITY)))
}

#[test]
fn slopes_whose_squares_overflow_are_no_silent_nan() {
    for k in [1e100, 1e150, 1e160, 1e200, 1e300] {
        for x in [0.0, 1e-300, 1e-160, 1e-3, 1.0, -1e-160, 1e160] {
            let p = [[x, 0.0, 0.0]];
            assert!(is_sound(&Tanh::<f64>::new(k).hessian(&p)), "tanh, {k:e}, {x:e}");
            assert!(is_sound(&Loss::<f64>::new(k).hessian(&p)), "huber, {k:e}, {x:e}");
            assert!(is_sound(&Sine::<f64>::new(k).hessian(&p)), "sin, {k:e}, {x:e}");
            assert!(is_sound(&Plus::<f64>::new(k).hessian(&p)), "softplus, {k:e}, {x:e}");
            assert!(is_sound(&Bell::<f64>::new(k).hessian(&p)), "exp, {k:e}, {x:e}");
            assert!(is_sound(&Inverse::<f64>::new(k).hessian(&p)), "atan, {k:e}, {x:e}");
        }
    }
    for k in [1e15_f32, 1e20, 1e30] {
        for x in [0.0, 1e-30, 1e-20, 1e-3, 1.0, -1e-20] {
            let p = [[x, 0.0, 0.0]];
            assert!(is_sound(&Tanh::<f32>::new(k).hessian(&p)), "tanh, {k:e}, {x:e}");
            assert!(is_sound(&Loss::<f32>::new(k).hessian(&p)), "huber, {k:e}, {x:e}");
            assert!(is_sound(&Sine::<f32>::new(k).hessian(&p)), "sin, {k:e}, {x:e}");
            assert!(is_sound(&Plus::<f32>::new(k).hessian(&p)), "softplus, {k:e}, {x:e}");
        }
    }
}

/// The value is a number, the Hessian is not.
#[test]
fn derivatives_that_overflow_are_flagged() {
    let at = Law::<f64>::new(1e300).hessian(&[[0.0; 3], [1e9, 0.0, 0.0]]);
    assert!(at.flags.degenerate, "{at:?}");
    let at = Law::<f64>::new(1e306).hessian(&[[0.0; 3], [1e-3, 0.0, 0.0]]);
    assert!(at.value.is_finite() && at.hessian.as_flattened().as_flattened().iter().all(|x| x.is_finite()));
}
