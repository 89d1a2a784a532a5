//! The heavy elastica: a strip clamped horizontally that bends under its own weight.

use std::f64::consts::FRAC_PI_2;

/// The shape of a strip of length 1, clamped horizontally at one end, with Γ = σ g L³/D.
///
/// The angle from the vertical, δ = π/2 − θ, obeys δ″ = Γ (1 − s) sin δ with δ′(1) = 0 and δ(0) = π/2. It is found by
/// shooting from the free end, on the logarithm of δ(1), which can be arbitrarily small.
#[derive(Clone, Debug, PartialEq)]
pub struct Elastica {
    /// Reach, drop and downward angle θ, at equal steps of arc length from the clamp.
    pub points: Vec<[f64; 3]>,
}

/// Steps of the classical Runge–Kutta method along the strip.
const STEPS: usize = 1000;

impl Elastica {
    /// Computes the shape for Γ > 0.
    ///
    /// ```
    /// use cloth_core::validate::Elastica;
    /// let strip = Elastica::new(1.0);
    /// assert!((strip.drop_over_reach() - 0.124_561_77).abs() < 1e-8);
    /// assert!((strip.tip_angle().to_degrees() - 9.460).abs() < 1e-3);
    /// ```
    #[must_use]
    pub fn new(gamma: f64) -> Self {
        let clamped = |logarithm: f64| shoot(gamma, logarithm.exp(), |_, _| {}) - FRAC_PI_2;
        // Bisection: δ(0) grows with δ(1).
        let (mut low, mut high) = (-2.0 * gamma.sqrt() - 10.0, FRAC_PI_2.ln());
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if clamped(middle) > 0.0 { high = middle } else { low = middle }
        }
        let mut angles = vec![0.0; 2 * STEPS + 1];
        shoot(gamma, (0.5 * (low + high)).exp(), |half_step, delta| angles[half_step] = delta);
        Self { points: integrate(&angles) }
    }

    /// Returns H/W, the drop of the tip over its reach.
    #[must_use]
    pub fn drop_over_reach(&self) -> f64 {
        let [reach, drop, _] = self.points[STEPS];
        drop / reach
    }

    /// Returns θ(1), in radians.
    #[must_use]
    pub fn tip_angle(&self) -> f64 {
        self.points[STEPS][2]
    }

    /// Returns reach and drop at arc length s; continues straight beyond the ends.
    #[must_use]
    pub fn at(&self, s: f64) -> [f64; 2] {
        let place = (s * STEPS as f64).clamp(0.0, STEPS as f64 - 1.0);
        let (before, part) = (place.floor() as usize, s * STEPS as f64 - place.floor());
        let [a, b] = [self.points[before], self.points[before + 1]];
        [a[0] + part * (b[0] - a[0]), a[1] + part * (b[1] - a[1])]
    }

    /// Returns the Γ of the strip with this H/W.
    #[must_use]
    pub fn fit(drop_over_reach: f64) -> f64 {
        // Secants: ln H/W grows almost linearly with ln Γ, with slopes from ½ to 1.
        let miss = |logarithm: f64| (Self::new(logarithm.exp()).drop_over_reach() / drop_over_reach).ln();
        let mut last = (8.0 * drop_over_reach).ln();
        let mut off = miss(last);
        let mut here = last - off;
        for _ in 0..40 {
            let next = miss(here);
            if (here - last).abs() < 1e-11 || next == off {
                break;
            }
            let slope = ((next - off) / (here - last)).clamp(0.3, 1.2);
            (last, off, here) = (here, next, here - next / slope);
        }
        here.exp()
    }
}

/// Integrates from the free end to the clamp and returns δ there. Calls `report` with δ at every whole and half step.
fn shoot(gamma: f64, tip: f64, mut report: impl FnMut(usize, f64)) -> f64 {
    let h = 0.5 / STEPS as f64;
    // In t = 1 − s: δ″ = Γ t sin δ.
    let rate = |t: f64, [delta, slope]: [f64; 2]| [slope, gamma * t * delta.sin()];
    let mut y = [tip, 0.0];
    report(2 * STEPS, y[0]);
    for step in 0..2 * STEPS {
        let t = step as f64 * h;
        let along = |k: [f64; 2], part: f64| [y[0] + part * k[0], y[1] + part * k[1]];
        let k1 = rate(t, y);
        let k2 = rate(t + 0.5 * h, along(k1, 0.5 * h));
        let k3 = rate(t + 0.5 * h, along(k2, 0.5 * h));
        let k4 = rate(t + h, along(k3, h));
        for i in 0..2 {
            y[i] += h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]);
        }
        if y[0] > 4.0 {
            return y[0];
        }
        report(2 * STEPS - step - 1, y[0]);
    }
    y[0]
}

/// Integrates by Simpson's rule over whole steps, given δ at whole and half steps.
fn integrate(angles: &[f64]) -> Vec<[f64; 3]> {
    let h = 1.0 / STEPS as f64;
    let mut points = vec![[0.0, 0.0, FRAC_PI_2 - angles[0]]];
    for step in 0..STEPS {
        let [a, m, b] = [angles[2 * step], angles[2 * step + 1], angles[2 * step + 2]];
        let mean = |f: fn(f64) -> f64| h / 6.0 * (f(a) + 4.0 * f(m) + f(b));
        let [reach, drop, _] = points[step];
        points.push([reach + mean(f64::sin), drop + mean(f64::cos), FRAC_PI_2 - b]);
    }
    points
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Γ, H/W and the tip's angle in degrees, from two independent solvers.
    const TABLE: [(f64, f64, f64); 10] = [
        (0.1, 0.012_499_55, 0.955),
        (0.5, 0.062_444_46, 4.763),
        (1.0, 0.124_561_77, 9.460),
        (2.0, 0.246_673_21, 18.426),
        (5.0, 0.585_721_18, 39.935),
        (10.0, 1.066_802_3, 60.312),
        (20.0, 1.863_930_1, 76.748),
        (50.0, 3.705_561_0, 87.459),
        (100.0, 5.888_104_6, 89.617),
        (1000.0, 21.335_441, 90.000),
    ];

    #[test]
    fn shapes_match_the_table() {
        for (gamma, ratio, degrees) in TABLE {
            let strip = Elastica::new(gamma);
            let found = strip.drop_over_reach();
            // Half a unit of the last printed digit.
            assert!(
                (found - ratio).abs() < f64::max(5.001e-9, 5e-8 * ratio),
                "Γ = {gamma}: got {found}, expected {ratio}"
            );
            assert!((strip.tip_angle().to_degrees() - degrees).abs() < 6e-4, "Γ = {gamma}: {}", strip.tip_angle());
        }
        assert!((Elastica::fit(3.705_561_0) / 50.0 - 1.0).abs() < 1e-6);
    }
}
