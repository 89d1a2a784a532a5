use energy_dsl::Vector3;

use crate::linear::block_jacobi::BlockJacobi;
use crate::linear::solve::{SingularBlock, SolveOptions, SolveReport, StopReason};
use crate::matrix::block_matrix::BlockMatrix;
use crate::matrix::precision::Precision;
use crate::matrix::vector::{add_scaled, dot, scale_and_add};

/// Solves A x = b for any invertible A by BiCGSTAB (van der Vorst 1992), starting from the given x. For force laws,
/// whose Jacobians are not symmetric.
///
/// The diagonal blocks D precondition from the left: D⁻¹A x = D⁻¹b.
///
/// # Errors
/// If a diagonal block is singular or not finite.
pub fn bicgstab(
    matrix: &BlockMatrix<impl Precision>,
    b: &[Vector3<f64>],
    x: &mut [Vector3<f64>],
    options: &SolveOptions,
) -> Result<SolveReport, SingularBlock> {
    let preconditioner = BlockJacobi::new(matrix)?;
    let mut scratch = vec![[0.0; 3]; b.len()];
    let mut multiply = |v: &[Vector3<f64>], out: &mut [Vector3<f64>]| {
        matrix.multiply(v, &mut scratch);
        preconditioner.apply(&scratch, out);
    };
    let mut r = vec![[0.0; 3]; b.len()];
    preconditioner.apply(b, &mut r);
    let target = options.relative_tolerance * norm(&r);
    preconditioner.apply(&residual(matrix, b, x), &mut r);

    let shadow = r.clone();
    let (mut p, mut ap, mut t) = (r.clone(), r.clone(), r.clone());
    let mut rho = dot(&shadow, &r);
    let initial_residual = norm(&r);
    let mut size = initial_residual;
    let mut iterations = 0;
    let stopped = loop {
        if !size.is_finite() || !target.is_finite() {
            break StopReason::NonFinite;
        }
        if size <= target {
            break StopReason::Converged;
        }
        if iterations == options.iteration_limit {
            break StopReason::IterationLimit;
        }
        multiply(&p, &mut ap);
        let along = dot(&shadow, &ap);
        if rho == 0.0 || along == 0.0 {
            break StopReason::Breakdown;
        }
        let step = rho / along;
        add_scaled(&mut r, -step, &ap);
        add_scaled(x, step, &p);
        multiply(&r, &mut t);
        // t = 0 only if the half step already solved the system.
        let tt = dot(&t, &t);
        let smoothing = if tt > 0.0 { dot(&t, &r) / tt } else { 0.0 };
        add_scaled(x, smoothing, &r);
        add_scaled(&mut r, -smoothing, &t);
        size = norm(&r);
        iterations += 1;
        if size > target && smoothing == 0.0 {
            break StopReason::Breakdown;
        }

        let previous = rho;
        rho = dot(&shadow, &r);
        let turn = rho / previous * (step / smoothing);
        for i in 0..p.len() {
            for axis in 0..3 {
                p[i][axis] = r[i][axis] + turn * (p[i][axis] - smoothing * ap[i][axis]);
            }
        }
    };
    Ok(SolveReport { iterations, initial_residual, final_residual: size, stopped })
}

/// Returns b − A x.
fn residual(matrix: &BlockMatrix<impl Precision>, b: &[Vector3<f64>], x: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
    let mut r = vec![[0.0; 3]; b.len()];
    matrix.multiply(x, &mut r);
    scale_and_add(&mut r, -1.0, b);
    r
}

fn norm(a: &[Vector3<f64>]) -> f64 {
    dot(a, a).sqrt()
}
