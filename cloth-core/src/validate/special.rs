//! Special functions and root finding, for exact results.

/// Returns a zero of a function between two points where it has different signs, by bisection.
pub(super) fn zero_between(mut low: f64, mut high: f64, f: impl Fn(f64) -> f64) -> f64 {
    let sign = f(low).signum();
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if f(middle).signum() == sign { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

/// Returns (x/2)^−ν Γ(ν + 1) J_ν(x) = Σ (−x²/4)^k / (k! (ν + 1)…(ν + k)), which has the zeros of the Bessel function
/// J_ν.
pub(super) fn bessel_core(nu: f64, x: f64) -> f64 {
    let (mut term, mut sum) = (1.0, 1.0);
    for k in 1..60 {
        let k = f64::from(k);
        term *= -0.25 * x * x / (k * (nu + k));
        sum += term;
    }
    sum
}

/// Returns the Laguerre polynomial L_n(x).
pub(super) fn laguerre(n: usize, x: f64) -> f64 {
    let (mut before, mut here) = (1.0, 1.0 - x);
    if n == 0 {
        return before;
    }
    for k in 1..n {
        let k = k as f64;
        (before, here) = (here, ((2.0 * k + 1.0 - x) * here - k * before) / (k + 1.0));
    }
    here
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zeros_match_the_tables() {
        assert!((zero_between(2.0, 3.0, |x| bessel_core(0.0, x)) - 2.404_825_557_695_773).abs() < 1e-14);
        // Greenhill: Γ = 9/4 j², where j is the first zero of the Bessel function of order −1/3.
        let j = zero_between(1.5, 2.2, |x| bessel_core(-1.0 / 3.0, x));
        assert!((2.25 * j * j - 7.837_347).abs() < 1e-6);
        assert!((zero_between(0.1, 1.0, |x| laguerre(2, x)) - (2.0 - 2.0_f64.sqrt())).abs() < 1e-14);
    }
}
