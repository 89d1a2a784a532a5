//! The audit rejects elements with one wrong sign or one dropped term, with a message that names element, block and
//! entry.

use std::panic::catch_unwind;

use energy_dsl::{Declaration, Element, Flags, Inputs, Mask, Outputs, Real, RestError, energy};
use energy_elements::{BridsonForceDamped, HairBend, QuadraticHinge, Spring, StVK};
use verify::assert_derivatives;

/// Declares an element whose output is changed on the way.
macro_rules! broken {
    ($name:ident, $of:ty, $block:literal, |$numbers:ident| $change:expr) => {
        #[derive(Clone, Copy)]
        struct $name;

        impl Element for $name {
            const DECLARATION: &'static Declaration = <$of as Element>::DECLARATION;
            type Over<T: Real> = Self;

            fn evaluate<T: Real>(inputs: &Inputs<'_, T>) -> Result<Outputs<T>, RestError> {
                let mut outputs = <$of as Element>::evaluate(inputs)?;
                let found = outputs.blocks.iter_mut().find(|(name, _)| *name == $block);
                let $numbers = &mut found.expect("a block of that name").1;
                $change;
                Ok(outputs)
            }
        }
    };
}

fn message<E: Element>() -> String {
    let panic = catch_unwind(|| assert_derivatives::<E>(20)).expect_err("the audit must fail");
    panic.downcast_ref::<String>().cloned().unwrap_or_default()
}

/// Asserts that the audit of a broken element fails with a message of these parts.
fn assert_message_has<E: Element>(parts: &[&str]) {
    let message = message::<E>();
    for part in parts {
        assert!(message.contains(part), "no {part} in\n{message}");
    }
}

broken!(GradientSign, HairBend<f64>, "grad", |g| g[4] = -g[4]);
broken!(HessianSign, QuadraticHinge<f64>, "hess", |h| {
    h[3 * 12 + 10] = -h[3 * 12 + 10];
    h[10 * 12 + 3] = -h[10 * 12 + 3];
});
broken!(ForceSign, BridsonForceDamped<f64>, "force", |f| f[7] = -f[7]);
broken!(VelocitySign, Spring<f64>, "dfdv", |d| d[0] = -d[0]);
broken!(Lopsided, StVK<f64>, "hess", |h| h[1] = h[1] * number(1.0 + 1e-12, h[1]));
broken!(SevenTimes, Spring<f64>, "force", |f| f.iter_mut().for_each(|f| *f = *f * number(7.0, *f)));
broken!(NotANumber, HairBend<f64>, "energy", |u| u[0] = u[0] * number(f64::NAN, u[0]));

/// Converts a number to the type of `_like`.
fn number<T: Real>(value: f64, _like: T) -> T {
    T::from_f64(value)
}

energy! {
    /// A logarithm, which has no value for half of all inputs.
    energy LogDifference(p, q: Point; k: Scalar) { k * log((p - q).x) }
}

/// A logarithm without flags.
#[derive(Clone, Copy)]
struct Unflagged;

impl Element for Unflagged {
    const DECLARATION: &'static Declaration = <LogDifference<f64> as Element>::DECLARATION;
    type Over<T: Real> = Self;

    fn evaluate<T: Real>(inputs: &Inputs<'_, T>) -> Result<Outputs<T>, RestError> {
        let outputs = <LogDifference<f64> as Element>::evaluate(inputs)?;
        Ok(Outputs { flags: [Flags::clear(); 3], ..outputs })
    }
}

/// A spring whose gradient is NaN at nearly coincident points.
#[derive(Clone, Copy)]
struct NaNNearby;

impl Element for NaNNearby {
    const DECLARATION: &'static Declaration = <Spring<f64> as Element>::DECLARATION;
    type Over<T: Real> = Self;

    fn evaluate<T: Real>(inputs: &Inputs<'_, T>) -> Result<Outputs<T>, RestError> {
        let mut outputs = <Spring<f64> as Element>::evaluate(inputs)?;
        let x = inputs.positions;
        let sum = (0..3).fold(T::from_f64(0.0), |sum, axis| sum + (x[axis] - x[3 + axis]).abs());
        let found = outputs.blocks.iter_mut().find(|(name, _)| *name == "grad");
        let numbers = &mut found.expect("a block of that name").1;
        if sum.less(T::from_f64(1e-3)).any() {
            numbers[0] = T::from_f64(f64::NAN);
        }
        Ok(outputs)
    }
}

#[test]
fn a_value_without_a_flag_outside_of_the_domain_is_found() {
    assert_message_has::<Unflagged>(&["flagged outside", "no value"]);
    assert_derivatives::<LogDifference<f64>>(20);
}

#[test]
fn a_nan_near_a_singularity_is_found() {
    assert_message_has::<NaNNearby>(&["`grad`", "nearly coincident", "NaN without a flag"]);
}

#[test]
fn a_flipped_sign_in_a_gradient_is_named() {
    let message = message::<GradientSign>();
    for part in ["HairBend", "`grad`", "p1.y", "dual numbers", "finite differences"] {
        assert!(message.contains(part), "no {part} in\n{message}");
    }
}

#[test]
fn a_flipped_sign_in_a_hessian_is_named() {
    let message = message::<HessianSign>();
    for part in ["QuadraticHinge", "`hess`", "(x2.x, x4.y)"] {
        assert!(message.contains(part), "no {part} in\n{message}");
    }
}

#[test]
fn a_flipped_sign_in_a_force_is_named() {
    let message = message::<ForceSign>();
    for part in ["BridsonForceDamped", "`force`", "x3.y"] {
        assert!(message.contains(part), "no {part} in\n{message}");
    }
}

#[test]
fn a_flipped_sign_in_the_damping_is_named() {
    let message = message::<VelocitySign>();
    for part in ["Spring", "`dfdv`", "(p_k.x, p_k.x)"] {
        assert!(message.contains(part), "no {part} in\n{message}");
    }
}

#[test]
fn an_asymmetry_in_the_last_digits_is_found() {
    assert!(message::<Lopsided>().contains("symmetry"));
}

/// Seven times the force still obeys Σ f = 0 and Σ x × f = 0, which are necessary conditions only.
#[test]
fn seven_times_the_force_is_found_although_it_keeps_the_laws() {
    let message = message::<SevenTimes>();
    assert!(message.contains("dual numbers of block `force`") && !message.contains('Σ'), "{message}");
}

#[test]
fn a_nan_is_found() {
    assert!(message::<NotANumber>().contains("`energy`"));
}

#[test]
fn a_sound_element_passes() {
    assert_derivatives::<Spring>(20);
}
