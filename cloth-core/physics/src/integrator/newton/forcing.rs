//! How exactly to solve each linear system of a Newton step, and when to look for convergence.

use energy_dsl::Vector3;

use super::{NewtonOptions, largest};

/// Factor of the Eisenstat–Walker forcing term of the second system of a step.
const PROGRESS: f64 = 0.9;
/// The largest factor by which `linear_tolerance` is loosened. Looser systems do not pay: an iteration of Newton's method
/// costs as much as some 30 of multigrid, or 100 of over-relaxation.
const LOOSENING: f64 = 4.0;

/// The accuracy of a linear system.
#[derive(Clone, Copy, Debug)]
pub(super) struct Forcing {
    /// The largest component of ∇E, in kg m.
    pub gradient: f64,
    /// The residual relative to the right-hand side.
    pub tolerance: f64,
    /// Whether it is the first system of its step.
    pub is_first: bool,
}

impl NewtonOptions {
    /// Returns the forcing term of the next linear system, from the progress since the last one (Eisenstat and Walker
    /// 1996, choice 2). From the third system on, convergence is no longer quadratic: the tolerance is then the last
    /// reduction of the gradient.
    pub(super) fn forcing(&self, gradient: f64, last: Option<Forcing>) -> Forcing {
        let tightest = self.linear_tolerance;
        let useful = last.map_or(0.0, |last| {
            let left = gradient / last.gradient;
            if last.is_first { PROGRESS * left.powi(2) } else { left }
        });
        Forcing { gradient, tolerance: useful.min(LOOSENING * tightest).max(tightest), is_first: last.is_none() }
    }

    /// Whether the residual impulse of every vertex is below the tolerance. `downhill` is −∇E.
    pub(super) fn is_balanced(&self, downhill: &[Vector3<f64>], dt: f64) -> bool {
        largest(downhill) < dt * self.impulse_tolerance
    }

    /// Whether the next iterate may be balanced. A solve to relative tolerance t leaves a residual of about t ‖∇E‖: if
    /// that is below the impulse tolerance, forces are evaluated first, and Hessians only if they turn out to be
    /// needed.
    pub(super) fn may_be_balanced(&self, last: Forcing, dt: f64) -> bool {
        last.tolerance * last.gradient < dt * self.impulse_tolerance
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tolerance_follows_progress() {
        let options = NewtonOptions::default();
        let after = |is_first: bool, gradient: f64, last: f64| {
            let last = Forcing { gradient: last, tolerance: 0.01, is_first };
            options.forcing(gradient, Some(last)).tolerance
        };
        let tolerance = |gradient: f64, last: f64| after(true, gradient, last);
        assert_eq!(options.forcing(1.0, None).tolerance, 0.01);
        // A fifth is left: 0.9 × 0.2². Clamped to [0.01, 0.04].
        assert!((tolerance(0.2, 1.0) - 0.9 * 0.04).abs() < 1e-15);
        assert_eq!(tolerance(0.01, 1.0), 0.01);
        assert_eq!(tolerance(3.0, 1.0), 0.04);
        assert_eq!(tolerance(0.0, 0.0), 0.04);
        // The third system: the reduction itself.
        assert_eq!(after(false, 0.03, 1.0), 0.03);
        assert_eq!(after(false, 0.001, 1.0), 0.01);
        assert_eq!(after(false, 0.2, 1.0), 0.04);
    }

    #[test]
    fn forces_are_checked_first_if_impulses_may_be_small() {
        let options = NewtonOptions { impulse_tolerance: 1e-3, ..NewtonOptions::default() };
        let of = |gradient: f64, tolerance: f64| {
            options.may_be_balanced(Forcing { gradient, tolerance, is_first: true }, 0.01)
        };
        assert!(of(9e-4, 0.01) && !of(1.1e-3, 0.01) && !of(9e-4, 0.1));
        assert!(options.is_balanced(&[[0.0, -9e-6, 0.0]], 0.01));
        assert!(!options.is_balanced(&[[0.0, -1.1e-5, 0.0]], 0.01));
    }
}
