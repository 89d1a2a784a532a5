use std::ops::Range;
use std::sync::Arc;

use energy_dsl::{Kernel, Level, Vector3, dispatch};

use super::galerkin::{GalerkinProduct, add_product};
use super::interpolation::Interpolation;
use super::smoother::{Inversion, Smoother};
use crate::linear::domains::{InverseFactor, Precision, Scaling, Wide, create_domains, scaled, unscaled};
use crate::linear::sparse_factor::SparseFactor;
use crate::matrix::block_matrix::BlockMatrix;
use crate::matrix::cross_blocks::CrossBlocks;
use crate::matrix::pattern::{Pattern, Storage, index};
use crate::matrix::vector::widened;

/// The largest number of rows of the coarsest level, which is factored. Levels whose rows cannot be
/// aggregated further may be larger.
const COARSEST: usize = 24;

/// Visits of the next coarser level per cycle: two make a W-cycle.
const VISITS: usize = 2;

/// A coarse level: the Galerkin product Pᵀ A P and an approximate solver for it.
#[derive(Clone, Debug)]
pub(super) struct Coarse<T> {
    pub(super) interpolation: Interpolation<T>,
    product: GalerkinProduct,
    /// Pᵀ r and the correction e, in the unit of the finest level's scaling.
    pub(super) restricted: Vec<Wide<T>>,
    pub(super) correction: Vec<Wide<T>>,
    inverse: Inverse<T>,
}

#[derive(Clone, Debug)]
enum Inverse<T> {
    /// The factor of a matrix that has all blocks.
    Direct {
        factor: Box<SparseFactor>,
        matrix: BlockMatrix,
    },
    Cycle(Box<Relaxed<T>>),
}

/// A level with a smoother. Its coarser level corrects the coupled rows.
#[derive(Clone, Debug)]
struct Relaxed<T> {
    smoother: Smoother<T>,
    inverses: Vec<InverseFactor<T>>,
    unit: f64,
    residual: Vec<Wide<T>>,
    smoothed: Vec<Wide<T>>,
    prolonged: Vec<Wide<T>>,
    solution: Vec<Wide<T>>,
    next: Option<Coarse<T>>,
}

impl<T: Precision> Coarse<T> {
    /// Creates the level below matrices of a pattern, whose rows are summed in these ranges. `None` if no rows are
    /// coupled, or one row is coupled with too many.
    pub(super) fn below(pattern: &Pattern, ranges: &[Range<usize>]) -> Option<Self> {
        let interpolation = Interpolation::averaged(pattern);
        if interpolation.aggregates() == 0 {
            return None;
        }
        let product = GalerkinProduct::new(pattern, &interpolation, ranges)?;
        let rows = product.pattern().rows();
        let zeros = vec![[T::from_f64(0.0); 4]; rows];
        let inverse = if rows <= COARSEST {
            // Contacts may couple any rows.
            let all: Vec<u32> = (0..index(rows)).collect();
            let complete = Arc::new(Pattern::from_stencils(Storage::Upper, rows, [&all[..]]));
            let factor = SparseFactor::new(3, &complete).ok()?.into();
            Inverse::Direct { factor, matrix: BlockMatrix::zeros(complete) }
        } else {
            Inverse::Cycle(Box::new(Relaxed::new(product.pattern())))
        };
        Some(Self { interpolation, product, restricted: zeros.clone(), correction: zeros, inverse })
    }

    /// Returns the number of matrix blocks of this level and of each coarser one.
    pub(super) fn blocks(&self) -> Vec<usize> {
        let mut blocks = vec![self.product.pattern().blocks()];
        if let Inverse::Cycle(relaxed) = &self.inverse
            && let Some(next) = &relaxed.next
        {
            blocks.extend(next.blocks());
        }
        blocks
    }

    /// Reads a matrix of the finer level and the blocks that it lacks. `None` if the sum proves not to be positive
    /// definite.
    pub(super) fn take_over(
        &mut self,
        fine: &BlockMatrix<impl Precision>,
        cross: &CrossBlocks,
        unit: f64,
        threads: usize,
    ) -> Option<()> {
        let mut product = self.product.compute(fine, &self.interpolation, threads);
        let cross = add_product(cross, &self.interpolation, &mut product);
        match &mut self.inverse {
            Inverse::Direct { factor, matrix } => {
                expand(&product, &cross, matrix);
                factor.factor(0.0, |block, i, j| unit * unit * matrix.values()[block][i][j]).ok()
            }
            Inverse::Cycle(relaxed) => relaxed.take_over(&product, &cross, unit),
        }
    }

    /// e ← approximately (Pᵀ A P)⁻¹ Pᵀ r. The approximation is linear, symmetric and positive definite, as
    /// preconditioning requires.
    pub(super) fn correct(&mut self) {
        match &mut self.inverse {
            Inverse::Direct { factor, .. } => {
                let numbers = self.restricted.iter().flat_map(|&[u, v, w, _]| [u, v, w]).map(Into::into);
                let mut e: Vec<f64> = numbers.collect();
                factor.solve(&mut e);
                for (correction, &[u, v, w]) in self.correction.iter_mut().zip(e.as_chunks::<3>().0) {
                    *correction = widened([u, v, w]);
                }
            }
            Inverse::Cycle(relaxed) => relaxed.cycle(self.product.pattern(), &self.restricted, &mut self.correction),
        }
    }
}

impl<T: Precision> Relaxed<T> {
    fn new(pattern: &Pattern) -> Self {
        let ranges = [Range { start: 0, end: pattern.rows() }];
        let mut domains = create_domains(pattern, &ranges);
        let (triangle, couplings) = domains.remove(0);
        let zeros = vec![[T::from_f64(0.0); 4]; pattern.rows()];
        Self {
            smoother: Smoother::new(triangle, couplings),
            inverses: vec![[[T::from_f64(0.0); 4]; 3]; pattern.rows()],
            unit: 1.0,
            residual: zeros.clone(),
            smoothed: zeros.clone(),
            prolonged: zeros.clone(),
            solution: zeros,
            next: Coarse::below(pattern, &ranges),
        }
    }

    fn take_over(&mut self, matrix: &BlockMatrix, cross: &CrossBlocks, unit: f64) -> Option<()> {
        self.unit = unit;
        let Self { smoother, inverses, .. } = self;
        smoother.extend(matrix.pattern(), cross);
        dispatch(Inversion { smoother, inverses, matrix, cross, unit }).ok()?;
        let Smoother { triangle, couplings, .. } = smoother;
        dispatch(Scaling { triangle, couplings, inverses, matrix, cross });
        self.next.as_mut().map_or(Some(()), |next| next.take_over(matrix, cross, unit, 1))
    }

    fn cycle(&mut self, pattern: &Arc<Pattern>, restricted: &[Wide<T>], correction: &mut [Wide<T>]) {
        let back = 1.0 / self.unit;
        for (row, &[u, v, w, _]) in restricted.iter().enumerate() {
            let r: Vector3<f64> = [u, v, w].map(|component| back * Into::<f64>::into(component));
            self.residual[row] = widened(scaled(&self.inverses[row], &r));
        }
        self.solution.fill([T::from_f64(0.0); 4]);
        for visit in 1..=VISITS {
            dispatch(Down { level: self, pattern });
            if let Some(next) = &mut self.next {
                next.correct();
            }
            dispatch(Up { level: self, pattern, last: visit == VISITS });
        }
        for (row, e) in correction.iter_mut().enumerate() {
            let [u, v, w, _] = self.solution[row];
            let z: Vector3<f64> = [u, v, w].map(|component| back * Into::<f64>::into(component));
            *e = widened(unscaled(&self.inverses[row], &z));
        }
    }
}

/// Writes a matrix and the blocks that it lacks to one that has all blocks.
fn expand(matrix: &BlockMatrix, cross: &CrossBlocks, complete: &mut BlockMatrix) {
    let pattern = Arc::clone(complete.pattern());
    complete.values_mut().fill([[0.0; 3]; 3]);
    for row in 0..pattern.rows() {
        let stored = matrix.pattern().row(row).map(|(slot, column)| (column, &matrix.values()[slot]));
        let lacking = cross.of_row(row).map(|(_, column, block)| (column as usize, block));
        for (column, block) in stored.chain(lacking) {
            let (slot, _) = pattern.slot(row, column).expect("the pattern has all blocks");
            complete.values_mut()[slot] = *block;
        }
    }
}

/// s = (I + L̃)⁻¹ r; x ← x + s; r ← −(L̃ᵀ + Ẽ) s; restricts r to the coarser level.
struct Down<'a, T> {
    level: &'a mut Relaxed<T>,
    pattern: &'a Pattern,
}

impl<T: Precision> Kernel for Down<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<L: Level>(self) {
        let Relaxed { smoother, residual, smoothed, solution, next, .. } = self.level;
        smoothed.copy_from_slice(residual);
        smoother.forward::<L>(self.pattern, smoothed);
        smoother.minus_upper::<L>(self.pattern, smoothed, residual);
        add(solution, smoothed);
        let Some(Coarse { interpolation, restricted, .. }) = next else { return };
        restricted.fill([T::from_f64(0.0); 4]);
        for row in 0..residual.len() {
            interpolation.add_restricted::<L>(row, &smoother.unscaled(row, &residual[row]), 0, restricted);
        }
    }
}

/// c = (I + L̃ᵀ)⁻¹ (r − (L̃ + Ẽ) e) with the correction e; x ← x + c. Before another visit, r ← −(L̃ + Ẽ) (c − e).
struct Up<'a, T> {
    level: &'a mut Relaxed<T>,
    pattern: &'a Pattern,
    last: bool,
}

impl<T: Precision> Kernel for Up<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<L: Level>(self) {
        let Relaxed { smoother, residual, prolonged, solution, next, .. } = self.level;
        prolonged.fill([T::from_f64(0.0); 4]);
        if let Some(Coarse { interpolation, correction, .. }) = next {
            for row in 0..prolonged.len() {
                prolonged[row] = smoother.scaled(row, &interpolation.prolonged::<L>(row, correction));
            }
            smoother.subtract_lower::<L>(self.pattern, prolonged, residual);
        }
        smoother.backward::<L>(self.pattern, residual);
        add(solution, residual);
        if self.last {
            return;
        }
        for row in 0..prolonged.len() {
            for lane in 0..4 {
                prolonged[row][lane] = residual[row][lane] - prolonged[row][lane];
            }
        }
        residual.fill([T::from_f64(0.0); 4]);
        smoother.subtract_lower::<L>(self.pattern, prolonged, residual);
    }
}

/// a ← a + b.
#[inline(always)]
fn add<T: Precision>(a: &mut [Wide<T>], b: &[Wide<T>]) {
    for row in 0..a.len() {
        for lane in 0..4 {
            a[row][lane] = a[row][lane] + b[row][lane];
        }
    }
}
