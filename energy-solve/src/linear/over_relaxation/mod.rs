mod domain;

use std::ops::Range;
use std::sync::{Arc, RwLock};

use energy_dsl::{Kernel, Level, Vector3, dispatch};

use self::domain::Domain;
use crate::linear::domains::{InverseFactor, Meeting, Precision, Scaling, Shared, Unit, Wide, divided, invert, ranges};
use crate::linear::preconditioner::SingularBlock;
use crate::linear::solve::{SolveOptions, SolveReport, StopReason};
use crate::matrix::block_matrix::BlockMatrix;
use crate::matrix::pattern::{Pattern, Storage};
use crate::threads::{for_each, in_parts, split_mut};

/// ω. From 1.4 to 1.8 the iterations on sheets of cloth, soft and stiff, fine and coarse, differ by a fifth.
const RELAXATION: f64 = 1.6;

/// Conjugate gradients with the preconditioner of symmetric successive over-relaxation, at the price of conjugate gradients without:
/// Eisenstat's method (SIAM J. Sci. Stat. Comput. 2, 1981).
///
/// With A = D + L + Lᵀ, D its diagonal blocks and C Cᵀ = D/ω, the matrix is scaled to C⁻¹ A C⁻ᵀ = ω I + L̃ + L̃ᵀ. What conjugate
/// gradients then multiply by,
///
/// (I + L̃)⁻¹ (ω I + L̃ + L̃ᵀ) (I + L̃ᵀ)⁻¹ p = t + (I + L̃)⁻¹ (p + (ω − 2) t),  t = (I + L̃ᵀ)⁻¹ p,
///
/// takes two triangular solutions and no product with A. There is nothing to factor but the diagonal blocks, and the blocks above
/// the diagonal are all that is read.
///
/// Numbers are stored, and computed with, in `T`: `f32` halves what is read from memory, which is what the time goes into, and serves
/// where a solution is wanted to a part in a hundred, as by Newton's method; products of vectors are summed up in doubles.
///
/// Large matrices are divided into domains of consecutive rows, and relaxation is confined to each; what couples them, Ẽ, is added to what is
/// multiplied by: p + (ω − 2) t + Ẽ t. How many there are depends on the matrix alone, and sums run over them in order: the solution is the same,
/// to the last bit, for any number of threads among which they are divided.
///
/// Made for matrices that change and patterns that do not: [`OverRelaxation::scale`] reuses everything.
#[derive(Debug)]
pub struct OverRelaxation<T> {
    pattern: Arc<Pattern>,
    threads: usize,
    /// C⁻¹ of each row.
    inverses: Vec<InverseFactor<T>>,
    domains: Vec<Domain<T>>,
    /// Of each domain t in the rows that others are coupled with.
    borders: Vec<RwLock<Vec<Wide<T>>>>,
}

impl<T: Precision> OverRelaxation<T> {
    /// Prepares for matrices of a pattern, to be solved by one thread.
    ///
    /// # Panics
    /// When it is not the upper triangle of a symmetric one.
    #[must_use]
    pub fn new(pattern: &Arc<Pattern>) -> Self {
        Self::with_threads(pattern, 1)
    }

    /// Prepares for matrices of a pattern, to be solved by at most so many threads.
    ///
    /// # Panics
    /// When it is not the upper triangle of a symmetric one.
    #[must_use]
    pub fn with_threads(pattern: &Arc<Pattern>, threads: usize) -> Self {
        assert_eq!(pattern.storage(), Storage::Upper, "only symmetric matrices are solved by conjugate gradients");
        let domains = divided(pattern, &ranges(pattern.rows())).into_iter();
        let domains: Vec<_> = domains.map(|(triangle, couplings)| Domain::new(triangle, couplings)).collect();
        let border = |domain: &Domain<T>| RwLock::new(vec![[T::from_f64(0.0); 4]; domain.couplings.border().len()]);
        let borders = domains.iter().map(border).collect();
        let inverses = vec![[[T::from_f64(0.0); 4]; 3]; pattern.rows()];
        Self { pattern: Arc::clone(pattern), threads, inverses, domains, borders }
    }

    /// Takes over a matrix of the pattern, scaled.
    ///
    /// # Errors
    /// When a diagonal block is not positive definite: then the matrix is not.
    ///
    /// # Panics
    /// When the matrix has another pattern.
    pub fn scale(&mut self, matrix: &BlockMatrix<impl Precision>) -> Result<(), SingularBlock> {
        assert!(Arc::ptr_eq(&self.pattern, matrix.pattern()), "the matrix has another pattern");
        let Self { threads, inverses, domains, .. } = self;
        let rows = || domains.iter().map(|domain| domain.triangle.rows.clone());
        let parts = rows().zip(split_mut(inverses, rows().map(|rows| rows.len()))).collect();
        let inverted = for_each(*threads, parts, |(rows, inverses)| dispatch(Inversion { rows, inverses, matrix }));
        inverted.into_iter().collect::<Result<(), usize>>().map_err(|row| SingularBlock { row })?;
        let inverses = &**inverses;
        for_each(*threads, domains.iter_mut().collect(), |Domain { triangle, couplings, .. }| {
            dispatch(Scaling { triangle, couplings, inverses, matrix });
        });
        Ok(())
    }

    /// Solves A x = b from x = 0. Residuals are measured as √(rᵀ M⁻¹ r), M = (D/ω + L) (D/ω)⁻¹ (D/ω + Lᵀ).
    pub fn solve(&mut self, b: &[Vector3<f64>], x: &mut [Vector3<f64>], options: &SolveOptions) -> SolveReport {
        let Self { pattern, threads, inverses, domains, borders } = self;
        let lengths: Vec<usize> = domains.iter().map(|domain| domain.triangle.rows.len()).collect();
        let sum = || Shared::new(lengths.len());
        let common = Common {
            pattern,
            options,
            borders,
            meeting: Meeting::new((*threads).clamp(1, lengths.len().max(1))),
            unit: Unit::new(lengths.len()),
            first_half: sum(),
            second_half: sum(),
            square: sum(),
        };
        let parts = domains.iter_mut().zip(split_mut(x, lengths.iter().copied())).enumerate();
        let parts = parts.map(|(number, (domain, x))| {
            let rows = domain.triangle.rows.clone();
            Part { number, inverses: &inverses[rows.clone()], b: &b[rows], domain, x }
        });
        let solved = in_parts(*threads, parts.collect(), |parts| dispatch(Gradients { parts, common: &common }));
        // All threads come to the same.
        solved.into_iter().next().unwrap_or(SolveReport {
            iterations: 0,
            initial_residual: 0.0,
            final_residual: 0.0,
            stopped: StopReason::Converged,
        })
    }
}

impl<T: Precision> Clone for OverRelaxation<T> {
    fn clone(&self) -> Self {
        let mut copy = Self::with_threads(&self.pattern, self.threads);
        copy.inverses.clone_from(&self.inverses);
        copy.domains.clone_from(&self.domains);
        copy
    }
}

/// [`invert`].
struct Inversion<'a, T, M> {
    rows: Range<usize>,
    inverses: &'a mut [InverseFactor<T>],
    matrix: &'a BlockMatrix<M>,
}

impl<T: Precision, M: Precision> Kernel for Inversion<'_, T, M> {
    type Output = Result<(), usize>;

    #[inline(always)]
    fn run<L: Level>(self) -> Self::Output {
        invert::<T, M, L>(self.matrix, self.rows, RELAXATION, self.inverses)
    }
}

/// What all threads read that solve a system.
struct Common<'a, T> {
    pattern: &'a Pattern,
    options: &'a SolveOptions,
    borders: &'a [RwLock<Vec<Wide<T>>>],
    meeting: Meeting,
    unit: Unit,
    /// p · t, p · w and r · r: each is read by all before any thread can have come round to write it again.
    first_half: Shared,
    second_half: Shared,
    square: Shared,
}

/// A domain, and its rows of b and x.
struct Part<'a, T> {
    number: usize,
    domain: &'a mut Domain<T>,
    inverses: &'a [InverseFactor<T>],
    b: &'a [Vector3<f64>],
    x: &'a mut [Vector3<f64>],
}

/// Conjugate gradients, as one thread sees them.
struct Gradients<'a, T> {
    parts: Vec<Part<'a, T>>,
    common: &'a Common<'a, T>,
}

impl<T: Precision> Kernel for Gradients<'_, T> {
    type Output = SolveReport;

    #[inline(always)]
    fn run<L: Level>(self) -> SolveReport {
        let Self { mut parts, common } = self;
        let Common { pattern, options, borders, meeting, unit, first_half, second_half, square, .. } = common;
        for Part { number, inverses, b, .. } in &parts {
            unit.note(*number, inverses, b);
        }
        meeting.wait();
        let scale = unit.agreed();
        for Part { number, domain, inverses, b, .. } in &mut parts {
            square.put(*number, domain.start::<L>(pattern, inverses, b, scale));
        }
        meeting.wait();
        let mut rho = square.sum();
        let initial = rho;
        let target = options.relative_tolerance.powi(2) * initial;
        let mut conjugate = 0.0;
        let mut iterations = 0;
        let stopped = loop {
            if !rho.is_finite() || !scale.is_finite() {
                break StopReason::NonFinite;
            }
            if rho <= target {
                break StopReason::Converged;
            }
            if iterations == options.iteration_limit {
                break StopReason::IterationLimit;
            }
            for Part { number, domain, .. } in &mut parts {
                first_half.put(*number, domain.backward::<L>(pattern, conjugate, &borders[*number]));
            }
            meeting.wait();
            for Part { number, domain, .. } in &mut parts {
                domain.couple::<L>(borders);
                second_half.put(*number, domain.forward::<L>(pattern));
            }
            meeting.wait();
            let along = first_half.sum() + second_half.sum();
            if along <= 0.0 {
                break StopReason::IndefiniteCurvature;
            }
            let previous = rho;
            for Part { number, domain, .. } in &mut parts {
                square.put(*number, domain.advance::<L>(rho / along));
            }
            meeting.wait();
            rho = square.sum();
            conjugate = rho / previous;
            iterations += 1;
        };
        for Part { domain, inverses, x, .. } in &mut parts {
            domain.finish(inverses, scale, x);
        }
        let [initial_residual, final_residual] = [initial, rho].map(|square| square.sqrt() * scale);
        SolveReport { iterations, initial_residual, final_residual, stopped }
    }
}
