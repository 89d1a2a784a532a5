mod coarse;
mod galerkin;
mod gradients;
mod interpolation;
mod smoother;

use std::sync::Arc;

use energy_dsl::{Number, Vector3, dispatch};

use self::coarse::Coarse;
use self::gradients::{Common, Gradients, Part, Vectors};
use self::smoother::{Inversion, Smoother};
use crate::linear::conjugate_gradients::conjugate_gradients;
use crate::linear::domains::{InverseFactor, Precision, Scaling, create_domains, extend, ranges};
use crate::linear::solve::{SingularBlock, SolveOptions, SolveReport, StopReason};
use crate::matrix::block_matrix::BlockMatrix;
use crate::matrix::cross_blocks::CrossBlocks;
use crate::matrix::pattern::{Pattern, Storage};
use crate::threads::{for_each, in_parts, split_mut};

/// Factor by which the tolerance may exceed that of over-relaxation. There the remaining error is smooth, and the norm,
/// which gives smooth parts little weight, is half the relative error of the solution. Here the remaining error is
/// rough, and the norm slightly exceeds the relative error.
const ROUGHNESS: f64 = 2.0;

/// Conjugate gradients preconditioned by smoothed aggregation multigrid, for matrices of cloth. The number of
/// iterations hardly depends on the resolution of the mesh (Tamstorf, Jones and McCormick, "Smoothed aggregation
/// multigrid for cloth simulation", ACM Trans. Graph. 34, 2015).
///
/// Let D be the diagonal blocks, A = D + L + Lᵀ, D̂ = D/ω, and P the prolongation. The preconditioner z = M⁻¹ r is one
/// cycle,
///
/// s = (D̂ + L)⁻¹ r,  e = P A_c⁻¹ Pᵀ (r − A s),  z = s + e + (D̂ + Lᵀ)⁻¹ (r − A (s + e)),  A_c = Pᵀ A P,
///
/// which solves coarse systems approximately by two such cycles each (a W-cycle), and the coarsest by Cholesky
/// factorisation. Products with A are never computed: with D' = D − D̂, r − A s = −(D' + Lᵀ) s, and A z = r + (D' + L)
/// (z − s − e). An iteration reads the blocks above the diagonal four times; [`OverRelaxation`](crate::OverRelaxation)
/// reads them twice.
///
/// P reproduces translations. A vertex and its neighbours in the pattern form an aggregate that moves as a whole, and
/// each vertex moves by the mean over its own and its neighbours' aggregates. This is smoothed aggregation with graph
/// averages instead of D⁻¹A. P therefore depends on the pattern alone, and its blocks are multiples of the identity.
/// A_c, which changes with every iteration of Newton's method, is a weighted sum of blocks. Including rotations and
/// smoothing with D⁻¹A saves one or two iterations on sheets of cloth but makes A_c several times as expensive.
///
/// Residuals are measured as in over-relaxation, by √(rᵀ M⁻¹ r) with M = (D̂ + L) D̂⁻¹ (D̂ + Lᵀ), but may be twice as
/// large. Here they are rough, there smooth; so the same tolerance gives the same error of the solution in the norm
/// √(eᵀ A e).
///
/// Numbers are stored and computed in `T`; dot products and A_c are summed in double precision. On the finest level,
/// large matrices are divided into domains of consecutive rows, which are relaxed independently. The domains depend on
/// the matrix alone, so the solution is bit-identical for any number of threads. One thread relaxes the coarser levels.
///
/// [`Multigrid::take_over`] reuses everything that depends on the pattern alone.
///
/// ```
/// use energy_solve::{BlockMatrix, Multigrid, Pattern, SolveOptions, Storage};
///
/// // A chain of a hundred masses of 0.01 kg with springs of 1 N/m between them. Each is pulled with 1 N.
/// let springs: Vec<[u32; 2]> = (1..100).map(|end| [end - 1, end]).collect();
/// let pattern = Pattern::from_stencils(Storage::Upper, 100, springs.iter().map(<[u32; 2]>::as_slice)).into();
/// let mut matrix = BlockMatrix::zeros(std::sync::Arc::clone(&pattern));
/// for axis in 0..3 {
///     for vertex in 0..100 {
///         matrix.diagonal_mut(vertex)[axis][axis] += 0.01;
///     }
///     for &[a, b] in &springs {
///         let (slot, _) = pattern.slot(a as usize, b as usize).unwrap();
///         matrix.values_mut()[slot][axis][axis] = -1.0;
///         matrix.diagonal_mut(a as usize)[axis][axis] += 1.0;
///         matrix.diagonal_mut(b as usize)[axis][axis] += 1.0;
///     }
/// }
/// let mut multigrid = Multigrid::<f64>::new(&pattern);
/// multigrid.take_over(&matrix)?;
/// let mut x = vec![[0.0; 3]; 100];
/// let report = multigrid.solve(&[[1.0, 0.0, 0.0]; 100], &mut x, &SolveOptions::default());
/// assert!(report.converged());
/// assert!((x[42][0] - 100.0).abs() < 1e-4 && x[42][1] == 0.0);
/// # Ok::<(), energy_solve::SingularBlock>(())
/// ```
#[derive(Clone, Debug)]
pub struct Multigrid<T> {
    pattern: Arc<Pattern>,
    threads: usize,
    /// C⁻¹ of each row.
    inverses: Vec<InverseFactor<T>>,
    smoothers: Vec<Smoother<T>>,
    vectors: Vec<Vectors<T>>,
    coarse: Option<Coarse<T>>,
    /// `false` if some level proved that the matrix is not positive definite.
    definite: bool,
}

impl<T: Precision> Multigrid<T> {
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
        let ranges = ranges(pattern.rows());
        let smoothers = create_domains(pattern, &ranges).into_iter();
        let smoothers = smoothers.map(|(triangle, couplings)| Smoother::new(triangle, couplings));
        Self {
            pattern: Arc::clone(pattern),
            threads,
            inverses: vec![[[T::from_f64(0.0); 4]; 3]; pattern.rows()],
            smoothers: smoothers.collect(),
            vectors: ranges.iter().map(|rows| Vectors::new(rows.len())).collect(),
            coarse: Coarse::below(pattern, &ranges),
            definite: false,
        }
    }

    /// Returns the number of levels, including the finest.
    #[must_use]
    pub fn levels(&self) -> usize {
        1 + self.coarse.as_ref().map_or(0, |coarse| coarse.blocks().len())
    }

    /// Returns the number of matrix blocks of all levels divided by that of the finest.
    #[must_use]
    pub fn operator_complexity(&self) -> f64 {
        let coarse: usize = self.coarse.as_ref().map_or(0, |coarse| coarse.blocks().iter().sum());
        1.0 + coarse as f64 / self.pattern.blocks().max(1) as f64
    }

    /// Reads a matrix of the pattern, and computes the smoothers and Galerkin products of all levels.
    ///
    /// # Errors
    /// If a diagonal block is not positive definite, in which case neither is the matrix.
    ///
    /// # Panics
    /// If the matrix has another pattern.
    pub fn take_over(&mut self, matrix: &BlockMatrix<impl Precision>) -> Result<(), SingularBlock> {
        self.take_over_with(matrix, &CrossBlocks::default())
    }

    /// Reads the sum of a matrix of the pattern and of blocks that the pattern lacks, such as those of contacts, and
    /// computes the smoothers and Galerkin products of all levels.
    ///
    /// # Errors
    /// If a diagonal block is not positive definite, in which case neither is the sum.
    ///
    /// # Panics
    /// If the matrix has another pattern.
    pub fn take_over_with(
        &mut self,
        matrix: &BlockMatrix<impl Precision>,
        cross: &CrossBlocks,
    ) -> Result<(), SingularBlock> {
        assert!(Arc::ptr_eq(&self.pattern, matrix.pattern()), "the matrix has another pattern");
        let Self { pattern, threads, inverses, smoothers, coarse, .. } = self;
        let domains = smoothers.iter_mut().map(|smoother| (&mut smoother.triangle, &mut smoother.couplings));
        extend(domains, pattern, cross);
        let largest = (0..pattern.rows()).map(|row| matrix.diagonal(row)[0][0].into()).fold(0.0, f64::max);
        let unit = if largest > 0.0 { largest.sqrt().power_of_two_scale() } else { 1.0 };
        let lengths: Vec<usize> = smoothers.iter().map(|smoother| smoother.triangle.rows.len()).collect();
        let parts = smoothers.iter_mut().zip(split_mut(inverses, lengths)).collect();
        let invert = |(smoother, inverses)| dispatch(Inversion { smoother, inverses, matrix, cross, unit });
        let inverted: Result<(), usize> = for_each(*threads, parts, invert).into_iter().collect();
        inverted.map_err(|row| SingularBlock { row })?;
        let inverses = &**inverses;
        for_each(*threads, smoothers.iter_mut().collect(), |Smoother { triangle, couplings, .. }| {
            dispatch(Scaling { triangle, couplings, inverses, matrix, cross });
        });
        let positive = |coarse: &mut Coarse<T>| coarse.take_over(matrix, cross, unit, *threads).is_some();
        self.definite = coarse.as_mut().is_none_or(positive);
        Ok(())
    }

    /// Solves A x = b, starting from x = 0. Returns x = 0 if a coarse level proved that the matrix is not positive
    /// definite.
    pub fn solve(&mut self, b: &[Vector3<f64>], x: &mut [Vector3<f64>], options: &SolveOptions) -> SolveReport {
        let nothing = SolveReport { stopped: StopReason::Converged, ..SolveReport::indefinite() };
        if !self.definite {
            x.fill([0.0; 3]);
            return SolveReport::indefinite();
        }
        let Self { pattern, threads, inverses, smoothers, vectors, coarse, .. } = self;
        let common = Common::new(pattern, smoothers, coarse.as_mut());
        let lengths = smoothers.iter().map(|smoother| smoother.triangle.rows.len());
        let parts = vectors.iter_mut().zip(split_mut(x, lengths)).enumerate();
        let parts = parts.map(|(number, (vectors, x))| {
            let rows = smoothers[number].triangle.rows.clone();
            Part { number, vectors, inverses: &inverses[rows.clone()], b: &b[rows], x }
        });
        let relative_tolerance = ROUGHNESS * options.relative_tolerance;
        let options = SolveOptions { relative_tolerance, ..*options };
        let solved = in_parts(*threads, parts.collect(), |parts, barrier| {
            conjugate_gradients(&mut Gradients { parts, common: &common, barrier }, &options)
        });
        // All threads return the same report.
        let report = solved.into_iter().next().unwrap_or(nothing);
        SolveReport { final_residual: report.final_residual / ROUGHNESS, ..report }
    }
}
