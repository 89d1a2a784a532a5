mod domain;

use std::marker::PhantomData;
use std::ops::Range;
use std::sync::{Arc, RwLock};

use energy_dsl::{Block, Kernel, Level, Vector3, dispatch};

use self::domain::Domain;
use crate::contact::Contact;
use crate::linear::conjugate_gradients::{Steps, conjugate_gradients};
use crate::linear::domains::{
    InverseFactor, PerDomain, Precision, RightHandScale, Scaling, Wide, contact_diagonals, create_domains, distribute,
    invert, ranges,
};
use crate::linear::solve::{SingularBlock, SolveOptions, SolveReport, StopReason};
use crate::matrix::block_matrix::BlockMatrix;
use crate::matrix::pattern::{Pattern, Storage};
use crate::threads::{SpinBarrier, for_each, in_parts, split_mut};

/// ω. Between 1.4 and 1.8, the iterations on sheets of cloth (soft, stiff, fine, coarse) differ by a fifth.
const RELAXATION: f64 = 1.6;

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
/// Contacts have no slots in the pattern. Their diagonal blocks are added to D, and their other blocks to Ẽ; see
/// [`OverRelaxation::scale_with_contacts`].
///
/// [`OverRelaxation::scale`] reuses everything that depends on the pattern alone.
#[derive(Debug)]
pub struct OverRelaxation<T> {
    pattern: Arc<Pattern>,
    threads: usize,
    /// C⁻¹ of each row.
    inverses: Vec<InverseFactor<T>>,
    domains: Vec<Domain<T>>,
    /// The border rows of t for each domain.
    borders: Vec<RwLock<Vec<Wide<T>>>>,
    /// The rows of t in contact for each domain; empty without contacts.
    contact_borders: Vec<RwLock<Vec<Wide<T>>>>,
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
        let border = |domain: &Domain<T>| RwLock::new(vec![[T::from_f64(0.0); 4]; domain.couplings.border().len()]);
        let borders = domains.iter().map(border).collect();
        let inverses = vec![[[T::from_f64(0.0); 4]; 3]; pattern.rows()];
        Self { pattern: Arc::clone(pattern), threads, inverses, domains, borders, contact_borders: Vec::new() }
    }

    /// Reads and scales a matrix of the pattern.
    ///
    /// # Errors
    /// If a diagonal block is not positive definite, in which case neither is the matrix.
    ///
    /// # Panics
    /// If the matrix has another pattern.
    pub fn scale(&mut self, matrix: &BlockMatrix<impl Precision>) -> Result<(), SingularBlock> {
        self.scale_with_contacts(matrix, &[])
    }

    /// Reads and scales the sum of a matrix of the pattern and Σ (c cᵀ) ⊗ B over the contacts.
    ///
    /// # Errors
    /// If a diagonal block of the sum is not positive definite, in which case neither is the sum.
    ///
    /// # Panics
    /// If the matrix has another pattern, or a contact names a row that the matrix does not have.
    pub fn scale_with_contacts(
        &mut self,
        matrix: &BlockMatrix<impl Precision>,
        contacts: &[Contact],
    ) -> Result<(), SingularBlock> {
        assert!(Arc::ptr_eq(&self.pattern, matrix.pattern()), "the matrix has another pattern");
        let Self { threads, inverses, domains, .. } = self;
        let rows = || domains.iter().map(|domain| domain.triangle.rows.clone());
        let parts = rows().zip(split_mut(inverses, rows().map(|rows| rows.len()))).collect();
        let added = &contact_diagonals(contacts, matrix.pattern().rows())[..];
        let inverted =
            for_each(*threads, parts, |(rows, inverses)| dispatch(Inversion { rows, inverses, matrix, added }));
        inverted.into_iter().collect::<Result<(), usize>>().map_err(|row| SingularBlock { row })?;
        let inverses = &**inverses;
        for_each(*threads, domains.iter_mut().collect(), |Domain { triangle, couplings, .. }| {
            dispatch(Scaling { triangle, couplings, inverses, matrix });
        });
        self.take_contacts(contacts);
        Ok(())
    }

    /// Scales contacts with C⁻¹ and hands them to the domains.
    fn take_contacts(&mut self, contacts: &[Contact]) {
        let Self { threads, inverses, domains, contact_borders, .. } = self;
        contact_borders.clear();
        if contacts.is_empty() {
            domains.iter_mut().for_each(|domain| domain.contacts = Default::default());
            return;
        }
        let ranges: Vec<_> = domains.iter().map(|domain| domain.triangle.rows.clone()).collect();
        for (domain, contacts) in domains.iter_mut().zip(distribute(contacts, &ranges, inverses, *threads)) {
            contact_borders.push(contacts.border());
            domain.contacts = contacts;
        }
    }

    /// Solves A x = b, starting from x = 0. Residuals are measured as √(rᵀ M⁻¹ r) with M = (D/ω + L) (D/ω)⁻¹ (D/ω +
    /// Lᵀ).
    pub fn solve(&mut self, b: &[Vector3<f64>], x: &mut [Vector3<f64>], options: &SolveOptions) -> SolveReport {
        let Self { pattern, threads, inverses, domains, borders, contact_borders } = self;
        let lengths: Vec<usize> = domains.iter().map(|domain| domain.triangle.rows.len()).collect();
        let sum = || PerDomain::new(lengths.len());
        let common = Common {
            pattern,
            options,
            borders,
            contact_borders,
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
        if !self.contact_borders.is_empty() {
            copy.contact_borders = self.domains.iter().map(|domain| domain.contacts.border()).collect();
        }
        copy
    }
}

/// Runs [`invert`].
struct Inversion<'a, T, M> {
    rows: Range<usize>,
    inverses: &'a mut [InverseFactor<T>],
    matrix: &'a BlockMatrix<M>,
    /// Blocks to add to the diagonal, by row; empty for none.
    added: &'a [Block<f64>],
}

impl<T: Precision, M: Precision> Kernel for Inversion<'_, T, M> {
    type Output = Result<(), usize>;

    #[inline(always)]
    fn run<L: Level>(self) -> Self::Output {
        invert::<T, M, L>(self.matrix, self.added, self.rows, RELAXATION, self.inverses)
    }
}

/// Data shared by all threads that solve a system.
struct Common<'a, T> {
    pattern: &'a Pattern,
    options: &'a SolveOptions,
    borders: &'a [RwLock<Vec<Wide<T>>>],
    contact_borders: &'a [RwLock<Vec<Wide<T>>>],
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
        let Common { pattern, borders, contact_borders, first_half, second_half, .. } = common;
        for Part { number, domain, .. } in &mut *parts {
            let (border, contact_border) = (&borders[*number], contact_borders.get(*number));
            first_half.put(*number, domain.backward::<L>(pattern, ratio, border, contact_border));
        }
        barrier.wait();
        for Part { number, domain, .. } in parts {
            domain.couple::<L>(borders, contact_borders);
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
