use energy_dsl::Vector3;

use crate::linear::preconditioner::Preconditioner;
use crate::linear::solve::{SolveOptions, SolveReport, StopReason, residual};
use crate::matrix::block_matrix::BlockMatrix;
use crate::matrix::precision::Precision;
use crate::matrix::vector::{add_scaled, dot, scale_and_add};

/// Solves A x = b for a symmetric positive definite A by preconditioned conjugate gradients, starting from the given x
/// (Shewchuk, "An introduction to the conjugate gradient method without the agonizing pain", 1994, B3).
///
/// Stops at a direction of non-positive curvature; see [`StopReason::IndefiniteCurvature`].
pub fn conjugate_gradients(
    matrix: &BlockMatrix<impl Precision>,
    preconditioner: &impl Preconditioner,
    b: &[Vector3<f64>],
    x: &mut [Vector3<f64>],
    options: &SolveOptions,
) -> SolveReport {
    let mut z = vec![[0.0; 3]; b.len()];
    preconditioner.apply(b, &mut z);
    let target = options.relative_tolerance * dot(b, &z).sqrt();

    let mut r = residual(matrix, b, x);
    preconditioner.apply(&r, &mut z);
    let mut p = z.clone();
    let mut ap = vec![[0.0; 3]; b.len()];
    let mut rho = dot(&r, &z);
    let initial_residual = rho.abs().sqrt();
    let mut iterations = 0;
    let stopped = loop {
        if !preconditioner.is_positive_definite() {
            break StopReason::IndefiniteCurvature; // a diagonal block is indefinite, and so is the matrix
        }
        if !rho.is_finite() || !target.is_finite() {
            break StopReason::NonFinite;
        }
        if rho.sqrt() <= target {
            break StopReason::Converged;
        }
        if iterations == options.iteration_limit {
            break StopReason::IterationLimit;
        }
        matrix.multiply(&p, &mut ap);
        let curvature = dot(&p, &ap);
        if curvature <= 0.0 {
            break StopReason::IndefiniteCurvature;
        }
        let step = rho / curvature;
        add_scaled(x, step, &p);
        add_scaled(&mut r, -step, &ap);
        preconditioner.apply(&r, &mut z);
        let previous = rho;
        rho = dot(&r, &z);
        scale_and_add(&mut p, rho / previous, &z);
        iterations += 1;
    };
    SolveReport { iterations, initial_residual, final_residual: rho.abs().sqrt(), stopped }
}
