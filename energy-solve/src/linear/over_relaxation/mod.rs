mod domain;

use std::marker::PhantomData;
use std::ops::Range;
use std::sync::{Arc, RwLock};

use energy_dsl::{Kernel, Level, Vector3, dispatch};

use self::domain::Domain;
use crate::linear::conjugate_gradients::{Steps, conjugate_gradients};
use crate::linear::domains::{
    InverseFactor, PerDomain, Precision, RightHandScale, Scaling, Wide, create_domains, extend, invert, ranges,
};
use crate::linear::solve::{SingularBlock, SolveOptions, SolveReport, StopReason};
use crate::matrix::block_matrix::BlockMatrix;
use crate::matrix::cross_blocks::CrossBlocks;
use crate::matrix::pattern::{Pattern, Storage};
use crate::threads::{SpinBarrier, for_each, in_parts, split_mut};

/// ω. Between 1.4 and 1.8, the iterations on sheets of cloth (soft, stiff, fine, coarse) differ by a fifth.
const RELAXATION: f64 = 1.6;
/// ω with blocks that the pattern lacks, those of contacts, which are much stiffer than cloth.
const RELAXATION_IN_CONTACT: f64 = 1.0;

/// Conjugate gradients preconditioned by symmetric successive over-relaxation, at the cost of plain conjugate
/// gradients: Eisenstat's trick (SIAM J. Sci. Stat. Comput. 2, 1981).
///
/// With A = D + L + Lᵀ, where D are the diagonal blocks, and C Cᵀ = D/ω, the matrix is scaled to C⁻¹ A C⁻ᵀ = ω I + L̃ +
/// L̃ᵀ. The operator of conjugate gradients,
///
/// (I + L̃)⁻¹ (ω I + L̃ + L̃ᵀ) (I + L̃ᵀ)⁻¹ p = t + (I + L̃)⁻¹ (p + (ω − 2) t),  t = (I + L̃ᵀ)⁻¹ p,
///
/// takes two triangular solves and no product with A. Only the diagonal blocks are factored, and only the blocks above
/// the diagonal are read.
///
/// Numbers are stored and computed in `T`; dot products are summed in double precision. The time is spent on reading
/// memory, of which `f32` needs half. It suffices for a relative accuracy of about 1 %, as in Newton's method.
///
/// Large matrices are divided into domains of consecutive rows, and relaxation is confined to each. The couplings
/// between them, Ẽ, enter the operator: p + (ω − 2) t + Ẽ t. The domains depend on the matrix alone, and sums run over
/// them in order, so the solution is bit-identical for any number of threads.
///
/// Contacts couple rows that the pattern does not; see [`OverRelaxation::scale_with`]. Such blocks are relaxed like all
/// others.
///
/// [`OverRelaxation::scale`] reuses everything that depends on the pattern alone.
#[derive(Debug)]
pub struct OverRelaxation<T> {
    pattern: Arc<Pattern>,
    threads: usize,
    /// ω of the last matrix.
    relaxation: f64,
    /// C⁻¹ of each row.
    inverses: Vec<InverseFactor<T>>,
    domains: Vec<Domain<T>>,
    /// The border rows of t for each domain.
    borders: Vec<RwLock<Vec<Wide<T>>>>,
}

impl<T: Precision> OverRelaxation<T> {
    /// Analyses a pattern, for solves on one thread.
    ///
    /// # Panics
    /// If the pattern does not store an upper triangle.
    #[must_use]
    pub fn new(pattern: &Arc<Pattern>) -> Self {
        Self::with_threads(pattern, 1)
    }

    /// Analyses a pattern, for solves on at most `threads` threads.
    ///
    /// # Panics
    /// If the pattern does not store an upper triangle.
    #[must_use]
    pub fn with_threads(pattern: &Arc<Pattern>, threads: usize) -> Self {
        assert_eq!(pattern.storage(), Storage::Upper, "only symmetric matrices are solved by conjugate gradients");
        let domains = create_domains(pattern, &ranges(pattern.rows())).into_iter();
        let domains: Vec<_> = domains.map(|(triangle, couplings)| Domain::new(triangle, couplings)).collect();
        let borders = domains.iter().map(|domain| domain.couplings.create_border()).collect();
        let inverses = vec![[[T::from_f64(0.0); 4]; 3]; pattern.rows()];
        Self { pattern: Arc::clone(pattern), threads, relaxation: RELAXATION, inverses, domains, borders }
    }

    /// Reads and scales a matrix of the pattern.
    ///
    /// # Errors
    /// If a diagonal block is not positive definite, in which case neither is the matrix.
    ///
    /// # Panics
    /// If the matrix has another pattern.
    pub fn scale(&mut self, matrix: &BlockMatrix<impl Precision>) -> Result<(), SingularBlock> {
        self.scale_with(matrix, &CrossBlocks::default())
    }

    /// Reads and scales the sum of a matrix of the pattern and of blocks that the pattern lacks, such as those of
    /// contacts.
    ///
    /// # Errors
    /// If a diagonal block is not positive definite, in which case neither is the sum.
    ///
    /// # Panics
    /// If the matrix has another pattern.
    pub fn scale_with(
        &mut self,
        matrix: &BlockMatrix<impl Precision>,
        cross: &CrossBlocks,
    ) -> Result<(), SingularBlock> {
        assert!(Arc::ptr_eq(&self.pattern, matrix.pattern()), "the matrix has another pattern");
        let Self { pattern, threads, relaxation, inverses, domains, borders } = self;
        *relaxation = if cross.is_empty() { RELAXATION } else { RELAXATION_IN_CONTACT };
        let parts = domains.iter_mut().map(|domain| (&mut domain.triangle, &mut domain.couplings));
        extend(parts, pattern, cross);
        *borders = domains.iter().map(|domain| domain.couplings.create_border()).collect();
        let rows = || domains.iter().map(|domain| domain.triangle.rows.clone());
        let parts = rows().zip(split_mut(inverses, rows().map(|rows| rows.len()))).collect();
        let relaxation = *relaxation;
        let inverted =
            for_each(*threads, parts, |(rows, inverses)| dispatch(Inversion { rows, inverses, matrix, relaxation }));
        inverted.into_iter().collect::<Result<(), usize>>().map_err(|row| SingularBlock { row })?;
        let inverses = &**inverses;
        for_each(*threads, domains.iter_mut().collect(), |Domain { triangle, couplings, .. }| {
            dispatch(Scaling { triangle, couplings, inverses, matrix, cross });
        });
        Ok(())
    }

    /// Solves A x = b, starting from x = 0. Residuals are measured as √(rᵀ M⁻¹ r) with M = (D/ω + L) (D/ω)⁻¹ (D/ω +
    /// Lᵀ).
    pub fn solve(&mut self, b: &[Vector3<f64>], x: &mut [Vector3<f64>], options: &SolveOptions) -> SolveReport {
        let Self { pattern, threads, relaxation, inverses, domains, borders } = self;
        let lengths: Vec<usize> = domains.iter().map(|domain| domain.triangle.rows.len()).collect();
        let sum = || PerDomain::new(lengths.len());
        let common = Common {
            pattern,
            options,
            borders,
            relaxation: *relaxation,
            right_hand_scale: RightHandScale::new(lengths.len()),
            first_half: sum(),
            second_half: sum(),
            square: sum(),
        };
        let parts = domains.iter_mut().zip(split_mut(x, lengths.iter().copied())).enumerate();
        let parts = parts.map(|(number, (domain, x))| {
            let rows = domain.triangle.rows.clone();
            Part { number, inverses: &inverses[rows.clone()], b: &b[rows], domain, x }
        });
        let solved = in_parts(*threads, parts.collect(), |parts, barrier| {
            dispatch(Gradients { parts, common: &common, barrier })
        });
        // All threads return the same report.
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
        copy.borders = copy.domains.iter().map(|domain| domain.couplings.create_border()).collect();
        copy.relaxation = self.relaxation;
        copy
    }
}

/// Runs [`invert`].
struct Inversion<'a, T, M> {
    rows: Range<usize>,
    inverses: &'a mut [InverseFactor<T>],
    matrix: &'a BlockMatrix<M>,
    relaxation: f64,
}

impl<T: Precision, M: Precision> Kernel for Inversion<'_, T, M> {
    type Output = Result<(), usize>;

    #[inline(always)]
    fn run<L: Level>(self) -> Self::Output {
        invert::<T, M, L>(self.matrix, self.rows, self.relaxation, self.inverses)
    }
}

/// Data shared by all threads that solve a system.
struct Common<'a, T> {
    pattern: &'a Pattern,
    options: &'a SolveOptions,
    borders: &'a [RwLock<Vec<Wide<T>>>],
    relaxation: f64,
    right_hand_scale: RightHandScale,
    /// p · t, p · w and r · r. All threads read each number before any of them reaches its next update.
    first_half: PerDomain,
    second_half: PerDomain,
    square: PerDomain,
}

/// A domain and its rows of b and x.
struct Part<'a, T> {
    number: usize,
    domain: &'a mut Domain<T>,
    inverses: &'a [InverseFactor<T>],
    b: &'a [Vector3<f64>],
    x: &'a mut [Vector3<f64>],
}

/// Runs conjugate gradients in one of the threads.
struct Gradients<'a, T> {
    parts: Vec<Part<'a, T>>,
    common: &'a Common<'a, T>,
    barrier: &'a SpinBarrier,
}

impl<T: Precision> Kernel for Gradients<'_, T> {
    type Output = SolveReport;

    #[inline(always)]
    fn run<L: Level>(self) -> SolveReport {
        let options = self.common.options;
        conjugate_gradients(&mut AtLevel { gradients: self, level: PhantomData::<L> }, options)
    }
}

/// The steps of one thread at a SIMD level. r is its own preconditioned residual, since the matrix is.
struct AtLevel<'a, T, L> {
    gradients: Gradients<'a, T>,
    level: PhantomData<L>,
}

impl<T: Precision, L: Level> Steps for AtLevel<'_, T, L> {
    #[inline(always)]
    fn start(&mut self) -> (f64, f64) {
        let Gradients { parts, common, barrier } = &mut self.gradients;
        let Common { pattern, right_hand_scale, square, .. } = common;
        for Part { number, inverses, b, .. } in &*parts {
            right_hand_scale.note(*number, inverses, b);
        }
        barrier.wait();
        let scale = right_hand_scale.combined();
        for Part { number, domain, inverses, b, .. } in parts {
            square.put(*number, domain.start::<L>(pattern, inverses, b, scale));
        }
        barrier.wait();
        (scale, square.sum())
    }

    #[inline(always)]
    fn precondition(&mut self, square: f64) -> f64 {
        square
    }

    #[inline(always)]
    fn conjugate(&mut self, ratio: f64) -> f64 {
        let Gradients { parts, common, barrier } = &mut self.gradients;
        let Common { pattern, borders, relaxation, first_half, second_half, .. } = common;
        for Part { number, domain, .. } in &mut *parts {
            first_half.put(*number, domain.backward::<L>(pattern, *relaxation, ratio, &borders[*number]));
        }
        barrier.wait();
        for Part { number, domain, .. } in parts {
            domain.couple::<L>(borders);
            second_half.put(*number, domain.forward::<L>(pattern));
        }
        barrier.wait();
        first_half.sum() + second_half.sum()
    }

    #[inline(always)]
    fn advance(&mut self, step: f64) -> f64 {
        let Gradients { parts, common, barrier } = &mut self.gradients;
        for Part { number, domain, .. } in parts {
            common.square.put(*number, domain.advance::<L>(step));
        }
        barrier.wait();
        common.square.sum()
    }

    #[inline(always)]
    fn finish(&mut self, unit: f64) {
        for Part { domain, inverses, x, .. } in &mut self.gradients.parts {
            domain.finish(inverses, unit, x);
        }
    }
}
