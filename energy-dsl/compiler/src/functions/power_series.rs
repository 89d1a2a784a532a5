//! Power series as polynomials of low degree.

use crate::graph::{Graph, NodeId};

/// Returns Σ cₖ yᵏ by Horner's rule.
pub(super) fn polynomial(g: &mut Graph, y: NodeId, mut coefficients: Vec<f64>) -> NodeId {
    let mut sum = g.constant(coefficients.pop().expect("a polynomial has coefficients"));
    for coefficient in coefficients.into_iter().rev() {
        let (coefficient, product) = (g.constant(coefficient), g.mul(y, sum));
        sum = g.add(coefficient, product);
    }
    sum
}

/// The interval on which a polynomial replaces a series.
#[derive(Clone, Copy)]
pub(super) enum Interval {
    /// [0, b].
    FromZero(f64),
    /// [−b, b].
    AroundZero(f64),
}

impl Interval {
    fn end(self) -> f64 {
        match self {
            Self::FromZero(end) | Self::AroundZero(end) => end,
        }
    }

    /// Returns the coefficients of the Chebyshev polynomial T_n that stays within ±1 on the interval.
    fn chebyshev(self, n: usize) -> Vec<f64> {
        // The interval is mapped to [−1, 1] by slope · x + shift. T₀ and T₋₁ = T₁, then T_{m+1}(x) = 2x T_m(x) −
        // T_{m−1}(x).
        let (shift, slope) = match self {
            Self::FromZero(end) => (-1.0, 2.0 / end),
            Self::AroundZero(end) => (0.0, 1.0 / end),
        };
        let (mut before, mut at) = (vec![shift, slope], vec![1.0]);
        for _ in 0..n {
            let mut next = vec![0.0; at.len() + 1];
            for (k, &c) in at.iter().enumerate() {
                next[k] += 2.0 * shift * c;
                next[k + 1] += 2.0 * slope * c;
            }
            for (k, &c) in before.iter().enumerate() {
                next[k] -= c;
            }
            (before, at) = (at, next);
        }
        at
    }
}

/// Returns a power series as a polynomial of low degree (Lanczos' economisation). The term of highest degree is
/// replaced by lower ones, using x² times the Chebyshev polynomial with the same leading coefficient, while this
/// changes the sum by at most 2⁻⁵⁶ of its first term. The first two terms stay: rounding them again would cost more.
pub(super) fn economised(coefficient: impl Fn(u32) -> f64, interval: Interval) -> Vec<f64> {
    let (end, budget) = (interval.end(), coefficient(0).abs() * 2.0_f64.powi(-56));
    let negligible = |k: u32| coefficient(k).abs() * end.powi(k as i32) < budget * 2.0_f64.powi(-10);
    // Every other coefficient may be 0.
    let last = (0..).find(|&k| negligible(k) && negligible(k + 1)).expect("a series converges");
    let mut coefficients: Vec<f64> = (0..last).map(&coefficient).collect();
    let mut error = 0.0;
    while coefficients.len() > 3 {
        let degree = coefficients.len() - 3;
        let chebyshev = interval.chebyshev(degree);
        let factor = coefficients[degree + 2] / chebyshev[degree];
        error += factor.abs() * end * end;
        if error > budget {
            break;
        }
        coefficients[2..].iter_mut().zip(&chebyshev).for_each(|(c, t)| *c -= factor * t);
        coefficients.pop();
    }
    coefficients
}
