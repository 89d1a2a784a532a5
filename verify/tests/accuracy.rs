//! Functions of one number, with first and second derivatives, against 600-bit fixed-point series, within the bounds
//! that the table of functions states.

use std::ops::{Add, Div, Mul, Neg, Sub};

use energy_dsl::Potential;
use energy_dsl::energy;
use num_bigint::BigInt;
use num_traits::{Signed, ToPrimitive};

energy! {
    energy Log1p(p: Point) { log1p(p.x) }
    energy Log1pmx(p: Point) { log1pmx(p.x) }
    energy Expm1(p: Point) { expm1(p.x) }
    energy Softplus(p: Point) { softplus(p.x) }
    energy Sinc(p: Point) { sinc(p.x) }
    energy Cosc(p: Point) { cosc(p.x) }
    energy CosSqrt(p: Point) { cos_sqrt(p.x) }
    energy SincSqrt(p: Point) { sinc_sqrt(p.x) }
    energy Tan(p: Point) { tan(p.x) }
    energy Asin(p: Point) { asin(p.x) }
    energy PseudoHuber(p: Point) { pseudo_huber(p.x, 0.75) }
    energy Atan(p: Point) { atan(p.x) }
    energy Sinh(p: Point) { sinh(p.x) }
    energy Cosh(p: Point) { cosh(p.x) }
    energy Tanh(p: Point) { tanh(p.x) }
    energy Erf(p: Point) { erf(p.x) }
    energy Versine(p: Point) { one_minus_cos(p.x) }
}

const BITS: u32 = 600;

/// A fixed-point number.
#[derive(Clone, Debug)]
struct Fixed(BigInt);

impl Fixed {
    fn of(value: f64) -> Self {
        let bits = value.to_bits();
        let exponent = (bits >> 52 & 0x7ff) as i32;
        let mantissa = (bits & ((1 << 52) - 1)) | if exponent == 0 { 0 } else { 1 << 52 };
        let shift = BITS as i32 + exponent.max(1) - 1075;
        let magnitude = if shift >= 0 { BigInt::from(mantissa) << shift } else { BigInt::from(mantissa) >> -shift };
        Self(if value < 0.0 { -magnitude } else { magnitude })
    }

    fn sqrt(&self) -> Self {
        Self((self.0.clone() << BITS).sqrt())
    }

    /// Returns Σ termₖ with termₖ₊₁ = termₖ · ratio(k), until the terms vanish.
    fn series(first: Self, ratio: impl Fn(i32) -> Self) -> Self {
        let (mut sum, mut term) = (first.clone(), first);
        for k in 0.. {
            term = term * ratio(k);
            if term.0.abs() <= BigInt::from(1) {
                break;
            }
            sum = sum + term.clone();
        }
        sum
    }

    fn exp(&self) -> Self {
        Self::series(Self::of(1.0), |k| self.clone() / Self::of(f64::from(k + 1)))
    }

    fn expm1(&self) -> Self {
        Self::series(self.clone(), |k| self.clone() / Self::of(f64::from(k + 2)))
    }

    /// Returns 2 artanh(x/(2 + x)), for −½ ≤ x ≤ 1.
    fn log1p(&self) -> Self {
        let z = self.clone() / (Self::of(2.0) + self.clone());
        let square = z.clone() * z.clone();
        let ratio = |k: i32| square.clone() * Self::of(f64::from(2 * k + 1)) / Self::of(f64::from(2 * k + 3));
        Self::of(2.0) * Self::series(z, ratio)
    }

    /// Returns the m-th derivative of Σ (−1)ᵏ yᵏ/(2k + offset)!.
    fn even(&self, offset: i32, m: i32) -> Self {
        let first: f64 = (1..=m).map(f64::from).product();
        let factorial: f64 = (1..=2 * m + offset).map(f64::from).product();
        let sign = if m % 2 == 0 { 1.0 } else { -1.0 };
        let first = Self::of(sign * first) / Self::of(factorial);
        Self::series(first, |k| {
            let k = k + m;
            let ratio = Self::of(f64::from(k + 1)) / Self::of(f64::from(k + 1 - m));
            -(self.clone() * ratio / Self::of(f64::from((2 * k + offset + 1) * (2 * k + offset + 2))))
        })
    }
}

macro_rules! operator {
    ($trait:ident, $method:ident, |$a:ident, $b:ident| $result:expr) => {
        impl $trait for Fixed {
            type Output = Self;
            fn $method(self, other: Self) -> Self {
                let ($a, $b) = (self.0, other.0);
                Self($result)
            }
        }
    };
}
operator!(Add, add, |a, b| a + b);
operator!(Sub, sub, |a, b| a - b);
operator!(Mul, mul, |a, b| (a * b) >> BITS);
operator!(Div, div, |a, b| (a << BITS) / b);

impl Neg for Fixed {
    type Output = Self;
    fn neg(self) -> Self {
        Self(-self.0)
    }
}

/// |value − truth| / |truth| in units of roundoff.
fn error(value: f64, truth: &Fixed) -> f64 {
    let difference = (Fixed::of(value) - truth.clone()).0.abs();
    if difference == BigInt::from(0) {
        return 0.0;
    }
    let scaled = (difference << 160_u32) / truth.0.abs().max(BigInt::from(1));
    scaled.to_f64().unwrap() / 2.0_f64.powi(160 - 53)
}

/// Returns numbers from 1e-30 to `most`, of both signs if `negative`.
fn arguments(most: f64, negative: bool) -> Vec<f64> {
    let mut arguments = Vec::new();
    let mut random = fastrand::Rng::with_seed(7);
    for _ in 0..300 {
        let x = most * 10.0_f64.powf(-30.0 * random.f64().powi(4));
        arguments.extend([x, most * random.f64()]);
        if negative {
            arguments.extend([-x, -most * random.f64()]);
        }
    }
    arguments
}

/// Checks value, first and second derivative against bounds in units of roundoff.
fn check<E: Potential<f64, Points = [[f64; 3]; 1]>>(
    element: &E,
    arguments: &[f64],
    bounds: [f64; 3],
    truth: impl Fn(Fixed) -> [Fixed; 3],
) where
    E::Triangle: AsRef<[[[f64; 3]; 3]]>,
{
    let name = &E::DECLARATION.name;
    let mut worst = [0.0_f64; 3];
    for &x in arguments {
        let at = element.hessian(&[[x, 0.0, 0.0]]);
        assert!(!at.flags.any(), "{name} at {x:e} is flagged");
        let found = [at.value, at.gradient[0][0], at.hessian.as_ref()[0][0][0]];
        for (order, (found, truth)) in found.into_iter().zip(truth(Fixed::of(x))).enumerate() {
            let error = error(found, &truth);
            assert!(
                error <= bounds[order],
                "{name}: derivative {order} at {x:e} is {found:e}, {error:.2} u from the truth"
            );
            worst[order] = worst[order].max(error);
        }
    }
    println!("{name}: {worst:.2?} u");
}

fn one() -> Fixed {
    Fixed::of(1.0)
}

#[test]
fn logarithms_and_exponentials() {
    let mut near = arguments(0.5, true);
    near.extend(arguments(1.0, false));
    check(&Log1p::new(), &near, [4.0, 2.0, 4.0], |x| {
        let inverse = one() / (one() + x.clone());
        [x.log1p(), inverse.clone(), -(inverse.clone() * inverse)]
    });
    check(&Log1pmx::new(), &near, [8.0, 3.0, 4.0], |x| {
        let inverse = one() / (one() + x.clone());
        [x.log1p() - x.clone(), -(x * inverse.clone()), -(inverse.clone() * inverse)]
    });
    check(&Expm1::new(), &arguments(30.0, true), [4.0, 1.0, 1.0], |x| [x.expm1(), x.exp(), x.exp()]);
    check(&Softplus::new(), &arguments(30.0, true), [4.0, 3.0, 5.0], |x| {
        let decay = (-Fixed(x.0.abs())).exp();
        let larger = one() / (one() + decay.clone());
        let smaller = one() - larger.clone();
        let positive = if x.0.is_negative() { Fixed::of(0.0) } else { x.clone() };
        let first = if x.0.is_negative() { smaller.clone() } else { larger.clone() };
        [positive + decay.log1p(), first, larger * smaller]
    });
}

#[test]
fn sines_over_angles() {
    check(&SincSqrt::new(), &arguments(6.5, false), [5.0, 6.0, 10.0], |y| [y.even(1, 0), y.even(1, 1), y.even(1, 2)]);
    check(&CosSqrt::new(), &arguments(1.5, false), [4.0, 3.0, 6.0], |y| [y.even(0, 0), y.even(0, 1), y.even(0, 2)]);
    check(&Sinc::new(), &arguments(1.5, true), [2.0, 6.0, 12.0], |x| {
        let y = x.clone() * x.clone();
        let (two, four) = (Fixed::of(2.0), Fixed::of(4.0));
        let second = two.clone() * y.even(1, 1) + four * y.clone() * y.even(1, 2);
        [y.even(1, 0), two * x * y.even(1, 1), second]
    });
    check(&Cosc::new(), &arguments(1.5, true), [5.0, 9.0, 16.0], |x| {
        let y = x.clone() * x.clone();
        let (two, four) = (Fixed::of(2.0), Fixed::of(4.0));
        let second = two.clone() * y.even(2, 1) + four * y.clone() * y.even(2, 2);
        [y.even(2, 0), two * x * y.even(2, 1), second]
    });
}

/// Returns sin x and cos x.
fn sine_and_cosine(x: &Fixed) -> (Fixed, Fixed) {
    let y = x.clone() * x.clone();
    (x.clone() * y.even(1, 0), y.even(0, 0))
}

#[test]
fn trigonometric_functions() {
    check(&Tan::new(), &arguments(1.5, true), [3.0, 5.0, 7.0], |x| {
        let (sine, cosine) = sine_and_cosine(&x);
        let (tangent, inverse) = (sine / cosine.clone(), one() / cosine);
        let first = inverse.clone() * inverse;
        [tangent.clone(), first.clone(), Fixed::of(2.0) * tangent * first]
    });
    check(&Versine::new(), &arguments(1.5, true), [3.0, 2.0, 2.0], |x| {
        let (sine, cosine) = sine_and_cosine(&x);
        let half = x.clone() / Fixed::of(2.0);
        let (half_sine, _) = sine_and_cosine(&half);
        [Fixed::of(2.0) * half_sine.clone() * half_sine, sine, cosine]
    });
    check(&Asin::new(), &arguments(0.999, true), [3.0, 3.0, 8.0], |x| {
        let other = (one() - x.clone() * x.clone()).sqrt();
        // Newton's method from the rounded angle.
        let mut angle = Fixed::of((x.0.to_f64().unwrap() / 2.0_f64.powi(BITS as i32)).asin());
        for _ in 0..5 {
            let (sine, cosine) = sine_and_cosine(&angle);
            angle = angle + (x.clone() - sine) / cosine;
        }
        let first = one() / other.clone();
        [angle, first.clone(), x * first.clone() * first.clone() * first]
    });
}

#[test]
fn inverse_tangent() {
    let check_on = |arguments: &[f64]| {
        check(&Atan::new(), arguments, [1.0, 4.0, 6.0], |x| {
            // Newton's method for tan from the rounded angle.
            let mut angle = Fixed::of((x.0.to_f64().unwrap() / 2.0_f64.powi(BITS as i32)).atan());
            for _ in 0..5 {
                let (sine, cosine) = sine_and_cosine(&angle);
                angle = angle + (x.clone() * cosine.clone() - sine.clone()) / (cosine + x.clone() * sine);
            }
            let first = one() / (one() + x.clone() * x.clone());
            [angle, first.clone(), -(Fixed::of(2.0) * x * first.clone() * first)]
        });
    };
    check_on(&arguments(1.5, true));
    check_on(&arguments(1e6, true));
}

/// Returns sinh x and cosh x.
fn hyperbolic(x: &Fixed) -> (Fixed, Fixed) {
    let two = Fixed::of(2.0);
    let (grown, fallen) = (x.expm1(), (-x.clone()).expm1());
    ((grown.clone() - fallen.clone()) / two.clone(), one() + (grown + fallen) / two)
}

#[test]
fn hyperbolic_functions() {
    check(&Sinh::new(), &arguments(30.0, true), [2.0, 2.0, 2.0], |x| {
        let (sine, cosine) = hyperbolic(&x);
        [sine.clone(), cosine, sine]
    });
    check(&Cosh::new(), &arguments(30.0, true), [2.0, 2.0, 2.0], |x| {
        let (sine, cosine) = hyperbolic(&x);
        [cosine.clone(), sine, cosine]
    });
    check(&Tanh::new(), &arguments(30.0, true), [4.0, 5.0, 7.0], |x| {
        let (sine, cosine) = hyperbolic(&x);
        let (tangent, inverse) = (sine / cosine.clone(), one() / cosine);
        let first = inverse.clone() * inverse;
        [tangent.clone(), first.clone(), -(Fixed::of(2.0) * tangent * first)]
    });
}

/// Returns π by Machin's formula.
fn pi() -> Fixed {
    let arctangent_of_inverse = |n: f64| {
        let square = Fixed::of(n * n);
        Fixed::series(one() / Fixed::of(n), |k| {
            -(Fixed::of(f64::from(2 * k + 1)) / (square.clone() * Fixed::of(f64::from(2 * k + 3))))
        })
    };
    Fixed::of(16.0) * arctangent_of_inverse(5.0) - Fixed::of(4.0) * arctangent_of_inverse(239.0)
}

#[test]
fn error_function() {
    assert!(error(std::f64::consts::PI, &pi()) <= 1.0);
    let factor = Fixed::of(2.0) / pi().sqrt();
    let mut all = arguments(8.0, true);
    all.extend(arguments(1.5, true));
    check(&Erf::new(), &all, [2.0, 3.0, 4.0], |x| {
        let square = x.clone() * x.clone();
        let gaussian = factor.clone() * (-square.clone()).exp();
        // The alternating series, which cancels: exp(64) takes 93 of 600 bits.
        let ratio = |k: i32| {
            let odd = Fixed::of(f64::from(2 * k + 1)) / Fixed::of(f64::from((k + 1) * (2 * k + 3)));
            -(square.clone() * odd)
        };
        let value = Fixed::series(factor.clone() * x.clone(), ratio);
        [value, gaussian.clone(), -(Fixed::of(2.0) * x * gaussian)]
    });
}

#[test]
fn losses() {
    check(&PseudoHuber::new(), &arguments(50.0, true), [4.0, 4.0, 8.0], |x| {
        let delta = Fixed::of(0.75);
        let ratio = x.clone() / delta;
        let s = (one() + ratio.clone() * ratio).sqrt();
        let value = x.clone() * x.clone() / (one() + s.clone());
        [value, x / s.clone(), one() / (s.clone() * s.clone() * s)]
    });
}
