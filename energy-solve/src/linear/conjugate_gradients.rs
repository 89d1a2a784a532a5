use crate::linear::solve::{SolveOptions, SolveReport, StopReason};

/// The vector operations of preconditioned conjugate gradients for one system A x = b.
///
/// Each solver fuses them with its preconditioner and with its threads. Threads that solve one system together run the
/// loop side by side, so each number must be the same in all of them.
pub(crate) trait Steps {
    /// Sets x = 0 and r = b. Returns the unit of the numbers that follow, and ‖r‖² in the norm of the stopping test.
    fn start(&mut self) -> (f64, f64);

    /// Computes z = M⁻¹ r. Returns r · z. `square` is the last ‖r‖².
    fn precondition(&mut self, square: f64) -> f64;

    /// Computes p ← z + β p and A p. Returns p · A p.
    fn conjugate(&mut self, ratio: f64) -> f64;

    /// Computes x ← x + α p and r ← r − α A p. Returns ‖r‖².
    fn advance(&mut self, step: f64) -> f64;

    /// Writes x, in this unit.
    fn finish(&mut self, unit: f64);
}

/// Solves a symmetric positive definite system by preconditioned conjugate gradients, starting from x = 0 (Shewchuk,
/// "An introduction to the conjugate gradient method without the agonizing pain", 1994, B3).
///
/// Stops at a direction of non-positive curvature; see [`StopReason::IndefiniteCurvature`].
#[inline(always)]
pub(crate) fn conjugate_gradients(steps: &mut impl Steps, options: &SolveOptions) -> SolveReport {
    let (unit, initial) = steps.start();
    let target = options.relative_tolerance.powi(2) * initial;
    let (mut square, mut along, mut iterations) = (initial, 0.0, 0);
    let stopped = loop {
        if !square.is_finite() || !unit.is_finite() {
            break StopReason::NonFinite;
        }
        if square <= target {
            break StopReason::Converged;
        }
        if iterations == options.iteration_limit {
            break StopReason::IterationLimit;
        }
        let previous = std::mem::replace(&mut along, steps.precondition(square));
        let curvature = steps.conjugate(if iterations == 0 { 0.0 } else { along / previous });
        if along <= 0.0 || curvature <= 0.0 {
            break StopReason::IndefiniteCurvature;
        }
        square = steps.advance(along / curvature);
        iterations += 1;
    };
    steps.finish(unit);
    let [initial_residual, final_residual] = [initial, square].map(|square| square.sqrt() * unit);
    SolveReport { iterations, initial_residual, final_residual, stopped }
}
