//! Newton's method with the solvers of this project.

use std::sync::Arc;

use energy_dsl::Vector3;
use energy_solve::{BlockCholesky, BlockMatrix, Curvature, State};

use super::assembly::{Assembly, Failure, Wanted};

/// How a minimisation ended.
pub struct Minimised {
    pub x: Vec<Vector3<f64>>,
    pub energy: f64,
    /// The largest component of the gradient at a free vertex.
    pub gradient: f64,
    pub iterations: usize,
    pub converged: bool,
}

/// The problem, and the accuracy to reach.
pub struct Goal<'a> {
    /// The factor of ½ Σ mᵢ ‖xᵢ − tᵢ‖².
    pub mass: f64,
    /// The positions tᵢ; empty if `mass` is 0.
    pub target: &'a [Vector3<f64>],
    /// The largest component of the gradient at the end.
    pub tolerance: f64,
    pub iterations: usize,
}

/// The part of the predicted decrease that a step must reach (Armijo's rule).
const SUFFICIENT: f64 = 1e-4;
/// The shortest step of the line search, as a part of Newton's.
const SHORTEST: f64 = 1e-12;

/// Minimises U(x) + mass/2 Σ mᵢ ‖xᵢ − tᵢ‖² over the free vertices by Newton's method with line search. The Hessian is
/// exact where it is positive definite; elsewhere, those of elements are projected.
pub fn minimise(assembly: &mut Assembly, mut x: Vec<Vector3<f64>>, goal: &Goal<'_>) -> Result<Minimised, Failure> {
    let still = vec![[0.0; 3]; x.len()];
    let mut cholesky = None;
    let mut energy = energy_at(assembly, &x, goal)?;
    let mut iterations = 0;
    loop {
        let (gradient, solved) = newton_step(assembly, &x, &still, goal, &mut cholesky)?;
        let size = gradient.iter().flatten().fold(0.0, |size: f64, g| size.max(g.abs()));
        let done = |converged| Minimised { x: Vec::new(), energy, gradient: size, iterations, converged };
        let (Some(step), true) = (solved, size > goal.tolerance && iterations < goal.iterations) else {
            return Ok(Minimised { x, ..done(size <= goal.tolerance) });
        };
        let slope: f64 = gradient.iter().flatten().zip(step.iter().flatten()).map(|(g, s)| g * s).sum();
        let free = assembly.dofs().free().to_vec();
        let moved = |length: f64| {
            let mut trial = x.clone();
            for (&vertex, step) in free.iter().zip(&step) {
                for axis in 0..3 {
                    trial[vertex][axis] += length * step[axis];
                }
            }
            trial
        };
        // Decreases below the roundoff of the energy cannot be seen.
        let roundoff = 8.0 * f64::EPSILON * energy.abs();
        let mut length = 1.0;
        let (next, found) = loop {
            let trial = moved(length);
            let found = energy_at(assembly, &trial, goal)?;
            if found <= energy + SUFFICIENT * length * slope + roundoff {
                break (trial, found);
            }
            length /= 2.0;
            if length < SHORTEST {
                return Ok(Minimised { x, ..done(false) });
            }
        };
        if next == x {
            return Ok(Minimised { x, ..done(false) });
        }
        (x, energy) = (next, found);
        iterations += 1;
    }
}

/// The gradient at the free vertices, and Newton's step; `None` without one.
type GradientAndStep = (Vec<Vector3<f64>>, Option<Vec<Vector3<f64>>>);

/// Returns the gradient at the free vertices, and the step −H⁻¹ g; `None` if no shift of H helps.
fn newton_step(
    assembly: &mut Assembly,
    x: &[Vector3<f64>],
    still: &[Vector3<f64>],
    goal: &Goal<'_>,
    cholesky: &mut Option<BlockCholesky>,
) -> Result<GradientAndStep, Failure> {
    let mut gradient = Vec::new();
    for curvature in [Curvature::Exact, Curvature::Clamped] {
        let wanted = Wanted { position: -1.0, velocity: 0.0, mass: goal.mass, curvature };
        let force = assembly.linearise(State { x, v: still }, wanted)?;
        gradient =
            assembly.dofs().free().iter().map(|&vertex| gradient_at(assembly, vertex, &force, x, goal)).collect();
        if gradient.iter().flatten().all(|g| g.abs() <= goal.tolerance) {
            return Ok((gradient, None));
        }
        let matrix = assembly.matrix();
        let mut factor = match cholesky.take() {
            Some(factor) => factor,
            None => match BlockCholesky::new(matrix.pattern()) {
                Ok(factor) => factor,
                Err(_) => return Ok((gradient, None)),
            },
        };
        let mut is_factored = factor.factor(matrix).is_ok();
        if !is_factored && curvature == Curvature::Clamped {
            is_factored = factor_shifted(&mut factor, matrix);
        }
        let solution = is_factored.then(|| {
            let descent: Vec<Vector3<f64>> = gradient.iter().map(|g| g.map(|g| -g)).collect();
            let mut step = vec![[0.0; 3]; gradient.len()];
            factor.solve(&descent, &mut step);
            step
        });
        *cholesky = Some(factor);
        if let Some(step) = solution.filter(|step| step.iter().flatten().all(|s| s.is_finite())) {
            return Ok((gradient, Some(step)));
        }
    }
    Ok((gradient, None))
}

/// Factors the matrix with a growing multiple of its largest diagonal entry on the diagonal. Slack cloth has no
/// stiffness in some directions.
fn factor_shifted(factor: &mut BlockCholesky, matrix: &BlockMatrix) -> bool {
    let rows = matrix.pattern().rows();
    let entries = (0..rows).flat_map(|row| (0..3).map(move |axis| matrix.diagonal(row)[axis][axis].abs()));
    let largest = entries.fold(f64::MIN_POSITIVE, f64::max);
    let mut shifted = BlockMatrix::zeros(Arc::clone(matrix.pattern()));
    (0..9).map(|power| 1e-12 * largest * 100_f64.powi(power)).any(|shift| {
        shifted.values_mut().copy_from_slice(matrix.values());
        for row in 0..rows {
            (0..3).for_each(|axis| shifted.diagonal_mut(row)[axis][axis] += shift);
        }
        factor.factor(&shifted).is_ok()
    })
}

fn gradient_at(
    assembly: &Assembly,
    vertex: usize,
    force: &[Vector3<f64>],
    x: &[Vector3<f64>],
    goal: &Goal<'_>,
) -> Vector3<f64> {
    let pull = |axis: usize| match goal.mass {
        0.0 => 0.0,
        factor => factor * assembly.masses[vertex] * (x[vertex][axis] - goal.target[vertex][axis]),
    };
    std::array::from_fn(|axis| pull(axis) - force[vertex][axis])
}

fn energy_at(assembly: &mut Assembly, x: &[Vector3<f64>], goal: &Goal<'_>) -> Result<f64, Failure> {
    let mut energy = assembly.energy(x)?;
    if goal.mass != 0.0 {
        for (vertex, mass) in assembly.masses.iter().enumerate().filter(|(vertex, _)| !assembly.pinned[*vertex]) {
            let distance = (0..3).map(|axis| (x[vertex][axis] - goal.target[vertex][axis]).powi(2)).sum::<f64>();
            energy += 0.5 * goal.mass * mass * distance;
        }
    }
    Ok(energy)
}
