//! The error function of Gauss' integral.

use std::f64::consts::FRAC_2_SQRT_PI;

use super::elementary::one_scalar;
use super::power_series::{Interval, economised, polynomial};
use super::{Function, Lowered, Units};
use crate::graph::{Form, Graph, NodeId, Primitive, Rule};

pub(super) const FUNCTIONS: &[Function] = &[Function {
    name: "erf",
    usage: "erf(x)",
    docs: "Error function 2/√π ∫₀ˣ exp(−t²) dt, accurate near 0. The derivative is 2/√π exp(−x²).",
    shape: one_scalar,
    units: Units::Plain,
    lower: |g, a| Lowered::scalar(erf(g, a[0].node())),
    accuracy: "2 / 3 / 4",
}];

/// From here on, exp(−x²) is 0 in double precision.
const GAUSSIAN_VANISHES: f64 = 28.0;

/// A polynomial in s = 14.4/(x + 3) − 2.6 that approximates exp(x²) (1 − erf x) on 1 ≤ x ≤ 6, where |s| ≤ 1. A weighted
/// least-squares fit; its contribution to the error of erf is 0.1 units of roundoff.
const COMPLEMENT: [f64; 12] = [
    0.20798329133343044,
    0.15436117429428164,
    0.049698445403972835,
    0.012713147698072401,
    0.0024793146632945493,
    0.00033160306682778184,
    1.9563580146188395e-05,
    -2.426354235142894e-06,
    -5.518055257281388e-07,
    1.165952520788243e-09,
    1.4124397070154538e-08,
    -1.0148075227947788e-09,
];

/// Creates erf x. The second derivative is −2x times the first.
fn erf(g: &mut Graph, x: NodeId) -> NodeId {
    if g.form() == Form::Textbook {
        return textbook(g, x);
    }
    let (null, one, bound) = (g.constant(0.0), g.constant(1.0), g.constant(GAUSSIAN_VANISHES));
    let magnitude = g.abs(x);
    let size = g.min(magnitude, bound);
    let gaussian = gaussian(g, size);

    let square = g.mul(size, size);
    // (−1)ᵏ/(k! (2k + 1))
    let coefficient = |k: u32| {
        let factorial: f64 = (1..=k).map(f64::from).product();
        (if k.is_multiple_of(2) { FRAC_2_SQRT_PI } else { -FRAC_2_SQRT_PI }) / (factorial * f64::from(2 * k + 1))
    };
    let series = polynomial(g, square, economised(coefficient, Interval::FromZero(1.0)));
    let near = g.mul(size, series);

    let complement = complement(g, size, gaussian);
    let far = g.sub(one, complement);
    let is_near = g.less(magnitude, one);
    let positive = g.select(is_near, near, far);
    let (opposite, negative) = (g.neg(positive), g.less(x, null));
    let value = g.select(negative, opposite, positive);

    let factor = g.constant(FRAC_2_SQRT_PI);
    let first = g.mul(factor, gaussian);
    let (backward, minus_two) = (g.neg(size), g.constant(-2.0));
    let signed = g.select(negative, backward, size);
    let second = g.product(None, &[minus_two, signed, first]);
    g.add_rule(Rule::smooth(Primitive::ErrorFunction, vec![x], value, vec![first], vec![second]), &[])
}

/// Returns exp(−x²). The rounding error of x² would cost up to x² units of roundoff.
fn gaussian(g: &mut Graph, x: NodeId) -> NodeId {
    let (square, error) = (g.mul(x, x), g.product_error(x, x));
    let exponent = g.neg(square);
    let rounded = g.exp(exponent);
    let correction = g.mul(rounded, error);
    g.sub(rounded, correction)
}

/// Returns 1 − erf x for x ≥ 1. From 6 on it is below the roundoff of 1.
fn complement(g: &mut Graph, x: NodeId, gaussian: NodeId) -> NodeId {
    let [six, three, numerator, shift] = [6.0, 3.0, 14.4, -2.6].map(|value| g.constant(value));
    let bounded = g.min(x, six);
    let denominator = g.add(bounded, three);
    let quotient = g.div(numerator, denominator);
    let s = g.add(quotient, shift);
    let scaled = polynomial(g, s, COMPLEMENT.to_vec());
    g.mul(scaled, gaussian)
}

/// Creates 2/√π exp(−x²) Σ 2ᵏ x²ᵏ⁺¹/(2k + 1)!!, whose terms have one sign. For |x| ≤ 8 the terms suffice for 100
/// digits; beyond, the result is 1 to 28 digits.
fn textbook(g: &mut Graph, x: NodeId) -> NodeId {
    const TERMS: i32 = 320;
    let (null, one, two, eight, pi) = (g.constant(0.0), g.constant(1.0), g.constant(2.0), g.constant(8.0), g.pi());
    let square = g.mul(x, x);
    let doubled = g.mul(two, square);
    let mut sum = one;
    for k in (0..TERMS).rev() {
        let odd = g.constant(f64::from(2 * k + 3));
        let ratio = g.div(doubled, odd);
        let term = g.mul(ratio, sum);
        sum = g.add(one, term);
    }
    let (exponent, root) = (g.neg(square), g.sqrt(pi));
    let (gaussian, factor) = (g.exp(exponent), g.div(two, root));
    let near = g.product(None, &[factor, gaussian, x, sum]);
    let (minus_one, magnitude) = (g.constant(-1.0), g.abs(x));
    let (far, negative) = (g.less(eight, magnitude), g.less(x, null));
    let limit = g.select(negative, minus_one, one);
    g.select(far, limit, near)
}
