use std::sync::Arc;

use crate::least_squares::normal_matrix::NormalMatrix;
use crate::least_squares::normal_solver::{NormalSolver, NormalSolverKind, SolverError};
use crate::least_squares::residual_term::{LeastSquaresTerm, NormalEquations, TermSum};
use crate::matrix::pattern::Pattern;

/// Options of [`GaussNewton`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct GaussNewtonOptions {
    /// The damping μ in (JᵀJ + μ 1) d = −Jᵀr, in the unit of JᵀJ.
    pub damping: f64,
    /// An iteration gives up if a step with this damping does not lower the energy.
    pub largest_damping: f64,
    /// The number of times that a step is halved before the damping is multiplied by 10.
    pub halvings: usize,
    /// The solver of the normal equations.
    pub solver: NormalSolverKind,
    /// Linearise the terms in two groups, on two threads. Sums are then rounded differently than without, and the same
    /// on every machine.
    pub two_threads: bool,
}

impl Default for GaussNewtonOptions {
    /// μ = 10⁻⁴, at most 10⁴; four halvings; Cholesky; one thread.
    fn default() -> Self {
        Self {
            damping: 1e-4,
            largest_damping: 1e4,
            halvings: 4,
            solver: NormalSolverKind::Cholesky,
            two_threads: false,
        }
    }
}

/// The energy of one term.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct TermCost {
    /// Name of the term.
    pub name: String,
    /// λ Σ w ρ(‖r‖²).
    pub energy: f64,
    /// Number of elements.
    pub elements: usize,
    /// Number of elements whose Jacobians are left out because they met a singularity.
    pub degenerate: usize,
}

/// The result of an iteration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// The energy decreased.
    Decreased,
    /// Jᵀr is zero.
    Stationary,
    /// No step lowers the energy, for any damping: only rounding errors remain. The unknowns are unchanged.
    Stalled,
}

/// Statistics of one iteration.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct IterationReport {
    /// Energies of the terms before the step.
    pub terms: Vec<TermCost>,
    /// E before the step.
    pub before: f64,
    /// E after the step.
    pub after: f64,
    /// The decrease of E for the full step if residuals were linear and the weights of the loss constant.
    pub predicted_decrease: f64,
    /// The fraction of the full step that was taken.
    pub fraction: f64,
    /// The damping of the step.
    pub damping: f64,
    /// ‖d‖ of the step taken.
    pub step_length: f64,
    /// Iterations of the linear solver.
    pub solver_iterations: usize,
    /// The result of the iteration.
    pub outcome: Outcome,
}

/// A problem that cannot be solved.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum GaussNewtonError {
    /// An unknown is infinite or NaN.
    #[error("unknown {unknown} of block {block} is not finite")]
    NonFiniteUnknown {
        /// Index of the block.
        block: usize,
        /// Index of the unknown within the block.
        unknown: usize,
    },
    /// The number of blocks differs from that of the pattern.
    #[error("expected {expected} blocks of unknowns, got {found}")]
    WrongLength {
        /// Number of blocks of the pattern.
        expected: usize,
        /// Number of blocks given.
        found: usize,
    },
    /// The energy of a term is infinite or NaN at the start.
    #[error(
        "the energy of `{term}` is not finite{}",
        .element.map_or_else(String::new, |element| format!(", first at element {element}"))
    )]
    NonFiniteEnergy {
        /// Name of the term.
        term: String,
        /// The first element with a non-finite energy; `None` if only the sum overflows.
        element: Option<usize>,
    },
    /// The linear system cannot be solved, for any damping.
    #[error("cannot solve for a step: {0}")]
    Solver(#[from] SolverError),
}

/// Gauss–Newton for sums of squared residuals over blocks of D unknowns, with Levenberg's damping and backtracking.
///
/// ```
/// use std::sync::Arc;
/// use energy_solve::{Couplings, GaussNewton, GaussNewtonOptions, Placed, ResidualTerm};
/// use energy_dsl::energy;
///
/// energy! {
///     /// Rosenbrock's valley as two residuals.
///     residual Valley(x: Vec2) { [10 * (x[1] - x[0]^2), 1 - x[0]] }
/// }
///
/// let pattern = Arc::new(Couplings::pattern(1, [[0].as_slice()]).unwrap());
/// let couplings = Arc::new(Couplings::new(&pattern, &[[0]]).unwrap());
/// let mut valley = ResidualTerm::<Valley, 2>::new("valley", couplings, 1.0);
/// valley.set_elements([Placed { element: Valley::new(), stencil: 0, weight: 1.0 }]);
///
/// let mut x = [[-1.2, 1.0]];
/// let mut solver = GaussNewton::new(pattern, GaussNewtonOptions::default()).unwrap();
/// let iterations = solver.minimise(&[&valley], &mut x, 50, 1e-12).unwrap();
/// assert!((x[0][0] - 1.0).abs() < 1e-9 && (x[0][1] - 1.0).abs() < 1e-9);
/// assert!(iterations.iter().all(|one| one.after <= one.before));
/// ```
#[derive(Debug)]
pub struct GaussNewton<const D: usize> {
    equations: NormalEquations<D>,
    /// Equations of the second group of terms; `None` for one thread.
    second: Option<NormalEquations<D>>,
    solver: NormalSolver,
    /// Damping, backtracking and linear solver.
    pub options: GaussNewtonOptions,
}

impl<const D: usize> GaussNewton<D> {
    /// Creates a solver for terms whose elements couple blocks of the pattern.
    ///
    /// # Errors
    /// If the factorisation does not fit into memory.
    pub fn new(pattern: Arc<Pattern>, options: GaussNewtonOptions) -> Result<Self, SolverError> {
        let solver = NormalSolver::new(options.solver, D, &pattern)?;
        let right = vec![[0.0; D]; pattern.rows()];
        let equations = NormalEquations { matrix: NormalMatrix::zeros(pattern), right };
        let second = options.two_threads.then(|| equations.clone());
        Ok(Self { equations, second, solver, options })
    }

    /// Returns JᵀJ and Jᵀr of the last linearisation.
    #[must_use]
    pub fn equations(&self) -> &NormalEquations<D> {
        &self.equations
    }

    /// Linearises the terms at x: updates JᵀJ and Jᵀr and returns the terms' energies.
    ///
    /// # Errors
    /// If unknowns or energies are not finite.
    pub fn linearise(
        &mut self,
        terms: &[&dyn LeastSquaresTerm<D>],
        x: &[[f64; D]],
    ) -> Result<Vec<TermCost>, GaussNewtonError> {
        self.check(x)?;
        self.equations.clear();
        let sums: Vec<TermSum> = match &mut self.second {
            None => terms.iter().map(|term| term.linearise(x, &mut self.equations)).collect(),
            Some(second) => {
                second.clear();
                let sums = linearise_on_two(terms, x, [&mut self.equations, &mut *second]);
                self.equations.add(second);
                sums
            }
        };
        let mut costs = Vec::with_capacity(terms.len());
        for (term, sum) in terms.iter().zip(sums) {
            if !sum.energy.is_finite() {
                let element = term.find_non_finite(x);
                return Err(GaussNewtonError::NonFiniteEnergy { term: term.name().to_owned(), element });
            }
            costs.push(TermCost {
                name: term.name().to_owned(),
                energy: sum.energy,
                elements: term.len(),
                degenerate: sum.degenerate,
            });
        }
        Ok(costs)
    }

    /// Solves (JᵀJ + μ 1) d = −Jᵀr with the last linearisation. Returns the step d and the number of solver iterations.
    ///
    /// # Errors
    /// If the matrix is not positive definite, or iterations do not converge.
    pub fn solve(&mut self, damping: f64) -> Result<(Vec<[f64; D]>, usize), SolverError> {
        let mut step: Vec<[f64; D]> = self.equations.right.iter().map(|block| block.map(|entry| -entry)).collect();
        let iterations = self.solver.solve(&self.equations.matrix, damping, &mut step)?;
        Ok((step, iterations))
    }

    /// Returns E − ‖r + J d‖² = −2 dᵀJᵀr − dᵀJᵀJ d for the last linearisation.
    #[must_use]
    pub fn predicted_decrease(&self, step: &[[f64; D]]) -> f64 {
        let mut product = vec![[0.0; D]; step.len()];
        self.equations.matrix.multiply_damped(0.0, step, &mut product);
        let (step, product) = (step.as_flattened(), product.as_flattened());
        let right = self.equations.right.as_flattened();
        step.iter().zip(product).zip(right).map(|((d, product), right)| -d * (2.0 * right + product)).sum()
    }

    /// Runs one iteration: linearises at x, solves for a step, and takes as much of it as lowers the energy.
    ///
    /// # Errors
    /// If unknowns or energies are not finite, or the equations cannot be solved for any damping. The unknowns are then
    /// unchanged.
    pub fn iterate(
        &mut self,
        terms: &[&dyn LeastSquaresTerm<D>],
        x: &mut [[f64; D]],
    ) -> Result<IterationReport, GaussNewtonError> {
        let costs = self.linearise(terms, x)?;
        let before: f64 = costs.iter().map(|cost| cost.energy).sum();
        let mut report = IterationReport {
            terms: costs,
            before,
            after: before,
            predicted_decrease: 0.0,
            fraction: 0.0,
            damping: self.options.damping,
            step_length: 0.0,
            solver_iterations: 0,
            outcome: Outcome::Stationary,
        };
        if self.equations.right.as_flattened().iter().all(|&entry| entry == 0.0) {
            return Ok(report);
        }
        report.outcome = Outcome::Stalled;
        loop {
            match self.solve(report.damping) {
                Ok((step, iterations)) => {
                    report.solver_iterations += iterations;
                    report.predicted_decrease = self.predicted_decrease(&step);
                    if self.backtrack(terms, x, &step, &mut report) {
                        return Ok(report);
                    }
                }
                Err(error) if report.damping >= self.options.largest_damping => return Err(error.into()),
                Err(_) => {}
            }
            if report.damping >= self.options.largest_damping {
                return Ok(report);
            }
            report.damping = (10.0 * report.damping).max(1e-12).min(self.options.largest_damping);
        }
    }

    /// Takes the full step, or a half, a quarter, … of it, so that the energy decreases. Returns whether it found such
    /// a step.
    fn backtrack(
        &self,
        terms: &[&dyn LeastSquaresTerm<D>],
        x: &mut [[f64; D]],
        step: &[[f64; D]],
        report: &mut IterationReport,
    ) -> bool {
        let start = x.to_vec();
        let mut fraction = 1.0;
        for _ in 0..=self.options.halvings {
            for (x, d) in x.as_flattened_mut().iter_mut().zip(step.as_flattened()) {
                *x += fraction * d;
            }
            let after: f64 = terms.iter().map(|term| term.energy(x).energy).sum();
            if after < report.before {
                let length = step.as_flattened().iter().map(|d| d * d).sum::<f64>().sqrt();
                report.after = after;
                report.fraction = fraction;
                report.step_length = fraction * length;
                report.outcome = Outcome::Decreased;
                return true;
            }
            x.copy_from_slice(&start);
            fraction /= 2.0;
        }
        false
    }

    /// Iterates until the relative decrease of the energy is at most `relative_decrease`, or the iteration limit is
    /// reached.
    ///
    /// # Errors
    /// See [`Self::iterate`].
    pub fn minimise(
        &mut self,
        terms: &[&dyn LeastSquaresTerm<D>],
        x: &mut [[f64; D]],
        iteration_limit: usize,
        relative_decrease: f64,
    ) -> Result<Vec<IterationReport>, GaussNewtonError> {
        let mut reports = Vec::new();
        while reports.len() < iteration_limit {
            let report = self.iterate(terms, x)?;
            let done = report.outcome != Outcome::Decreased
                || report.before - report.after <= relative_decrease * report.before;
            reports.push(report);
            if done {
                break;
            }
        }
        Ok(reports)
    }

    fn check(&self, x: &[[f64; D]]) -> Result<(), GaussNewtonError> {
        let expected = self.equations.matrix.pattern().rows();
        if x.len() != expected {
            return Err(GaussNewtonError::WrongLength { expected, found: x.len() });
        }
        for (block, numbers) in x.iter().enumerate() {
            if let Some(unknown) = numbers.iter().position(|number| !number.is_finite()) {
                return Err(GaussNewtonError::NonFiniteUnknown { block, unknown });
            }
        }
        Ok(())
    }
}

/// Linearises the terms in two groups with about the same number of elements, at the same time.
fn linearise_on_two<const D: usize>(
    terms: &[&dyn LeastSquaresTerm<D>],
    x: &[[f64; D]],
    [first, second]: [&mut NormalEquations<D>; 2],
) -> Vec<TermSum> {
    let groups = two_groups(&terms.iter().map(|term| term.len()).collect::<Vec<_>>());
    let linearise = |group: bool, equations: &mut NormalEquations<D>| -> Vec<Option<TermSum>> {
        let own = |(term, of): (&&dyn LeastSquaresTerm<D>, &bool)| (*of == group).then(|| term.linearise(x, equations));
        terms.iter().zip(&groups).map(own).collect()
    };
    let (a, b) = std::thread::scope(|scope| {
        let other = scope.spawn(|| linearise(true, second));
        let own = linearise(false, first);
        (own, other.join())
    });
    // A panic of the other thread goes on here.
    let b = b.unwrap_or_else(|panic| std::panic::resume_unwind(panic));
    a.into_iter().zip(b).map(|(a, b)| a.or(b).unwrap_or_default()).collect()
}

/// Divides numbers into two groups with similar sums: the largest first, each to the smaller group.
fn two_groups(sizes: &[usize]) -> Vec<bool> {
    let mut order: Vec<usize> = (0..sizes.len()).collect();
    order.sort_by_key(|&at| std::cmp::Reverse(sizes[at]));
    let (mut sums, mut groups) = ([0, 0], vec![false; sizes.len()]);
    for at in order {
        groups[at] = sums[1] < sums[0];
        sums[usize::from(groups[at])] += sizes[at];
    }
    groups
}

#[cfg(test)]
mod tests {
    use super::two_groups;

    #[test]
    fn groups_are_balanced() {
        assert_eq!(two_groups(&[5, 3, 5, 1]), [false, false, true, true]);
        assert_eq!(two_groups(&[]), [false; 0]);
    }
}
