use std::sync::RwLock;

use energy_dsl::{Block, Kernel, Level};

use crate::linear::domains::{
    Couplings, InverseFactor, Precision, Triangle, Wide, extend, inverse_factor, invert, minus_products, rounded,
    scaled_block, subtract_transposed,
};
use crate::matrix::block_matrix::BlockMatrix;
use crate::matrix::cross_blocks::CrossBlocks;
use crate::matrix::pattern::Pattern;
use crate::matrix::precision::doubled;

/// ω. With 1 (Gauss–Seidel), multigrid takes up to two iterations more on stiff sheets; from 1.3 to 1.7 the count
/// hardly changes.
const RELAXATION: f64 = 1.5;
/// ω with blocks that the pattern lacks, those of contacts, which are much stiffer than cloth.
const RELAXATION_IN_CONTACT: f64 = 1.1;

/// Forward and backward over-relaxation of a domain: solves with I + L̃ and I + L̃ᵀ, where the matrix is scaled to
///
/// C⁻¹ A C⁻ᵀ = I + L̃ + L̃ᵀ + Ẽ.
///
/// C Cᵀ is D/ω for the diagonal block D. On the border it also contains half of the absolute row sums of the couplings
/// with other domains, so that relaxing all domains at once converges for any choice of domains (hybrid ℓ₁
/// Gauss–Seidel, Baker, Falgout, Kolev and Yang, SIAM J. Sci. Comput. 33, 2011). Ẽ compensates: it is ω − 1, minus the
/// additions on the border, plus the couplings with other domains.
#[derive(Clone, Debug)]
pub(super) struct Smoother<T> {
    pub(super) triangle: Triangle<T>,
    pub(super) couplings: Couplings<T>,
    /// ω of the last matrix.
    relaxation: f64,
    /// ω times the scaled addition to D/ω for each border row, by columns.
    strengthened: Vec<[Wide<T>; 3]>,
    /// C by rows, multiplied by the unit of [`Smoother::invert`].
    factors: Vec<[T; 6]>,
}

impl<T: Precision> Smoother<T> {
    pub(super) fn new(triangle: Triangle<T>, couplings: Couplings<T>) -> Self {
        let zero = T::from_f64(0.0);
        let factors = vec![[zero; 6]; triangle.rows.len()];
        Self { triangle, couplings, relaxation: RELAXATION, strengthened: Vec::new(), factors }
    }

    /// Lets the only domain take the blocks that the pattern lacks.
    pub(super) fn extend(&mut self, pattern: &Pattern, cross: &CrossBlocks) {
        extend(std::iter::once((&mut self.triangle, &mut self.couplings)), pattern, cross);
    }

    /// Computes C and C⁻¹ of the domain's rows. Fails with a row whose diagonal block is not positive definite.
    #[inline(always)]
    pub(super) fn invert<M: Precision, L: Level>(
        &mut self,
        matrix: &BlockMatrix<M>,
        cross: &CrossBlocks,
        unit: f64,
        inverses: &mut [InverseFactor<T>],
    ) -> Result<(), usize> {
        let first = self.triangle.rows.start;
        self.relaxation = if cross.is_empty() { RELAXATION } else { RELAXATION_IN_CONTACT };
        invert::<T, M, L>(matrix, self.triangle.rows.clone(), self.relaxation, inverses)?;
        let sums = self.couplings.absolute_row_sums(matrix, cross);
        self.strengthened.clear();
        self.strengthened.resize(sums.len(), [[T::from_f64(0.0); 4]; 3]);
        for (number, &local) in self.couplings.border().iter().enumerate() {
            let (mut diagonal, mut more): (Block<f64>, Block<f64>) =
                (doubled(matrix.diagonal(first + local as usize)), [[0.0; 3]; 3]);
            diagonal.iter_mut().flatten().for_each(|entry| *entry /= self.relaxation);
            for i in 0..3 {
                more[i][i] = 0.5 * sums[number][i];
                diagonal[i][i] += more[i][i];
            }
            let inverse = inverse_factor(&diagonal).ok_or(first + local as usize)?;
            let rows = rounded(&inverse);
            let more: [Wide<f64>; 3] = scaled_block::<f64, L>(&rows, &more, &rows);
            for i in 0..3 {
                for j in 0..3 {
                    self.strengthened[number][j][i] = T::from_f64(self.relaxation * more[i][j]);
                }
            }
            inverses[local as usize] = rounded(&inverse);
        }
        for local in 0..inverses.len() {
            let [[x, yx, zx, _], [_, y, zy, _], [_, _, z, _]] = rounded::<T, f64>(&inverses[local]);
            let [a, c, f] = [1.0 / x, 1.0 / y, 1.0 / z];
            let (b, e) = (-yx * a * c, -zy * c * f);
            let d = -(zx * a + zy * b) * f;
            for (number, entry) in [a, b, c, d, e, f].into_iter().enumerate() {
                self.factors[local][number] = T::from_f64(unit * entry);
            }
        }
        Ok(())
    }

    /// Returns C r for a row.
    #[inline(always)]
    pub(super) fn unscaled(&self, row: usize, [u, v, w, _]: &Wide<T>) -> Wide<T> {
        let [a, b, c, d, e, f] = self.factors[row];
        [a * *u, b * *u + c * *v, d * *u + e * *v + f * *w, T::from_f64(0.0)]
    }

    /// Returns Cᵀ e for a row.
    #[inline(always)]
    pub(super) fn scaled(&self, row: usize, [u, v, w, _]: &Wide<T>) -> Wide<T> {
        let [a, b, c, d, e, f] = self.factors[row];
        [a * *u + b * *v + d * *w, c * *v + e * *w, f * *w, T::from_f64(0.0)]
    }

    /// v ← (I + L̃)⁻¹ v.
    #[inline(always)]
    pub(super) fn forward<L: Level>(&self, pattern: &Pattern, v: &mut [Wide<T>]) {
        let rows = self.triangle.by_rows(pattern);
        for row in 0..v.len() {
            let here = v[row];
            for (block, column) in rows.blocks(row) {
                subtract_transposed::<T, L>(&mut v[column], block, &here);
            }
        }
    }

    /// v ← (I + L̃ᵀ)⁻¹ v.
    #[inline(always)]
    pub(super) fn backward<L: Level>(&self, pattern: &Pattern, v: &mut [Wide<T>]) {
        let rows = self.triangle.by_rows(pattern);
        for row in (0..v.len()).rev() {
            v[row] = minus_products::<T, L>(rows.blocks(row), v[row], v);
        }
    }

    /// r ← −(L̃ᵀ + ω − 1) v.
    #[inline(always)]
    pub(super) fn minus_upper<L: Level>(&self, pattern: &Pattern, v: &[Wide<T>], r: &mut [Wide<T>]) {
        let rows = self.triangle.by_rows(pattern);
        for row in 0..v.len() {
            let own = plus::<T, L>([T::from_f64(0.0); 4], 1.0 - self.relaxation, &v[row]);
            r[row] = minus_products::<T, L>(rows.blocks(row), own, v);
        }
    }

    /// r ← r − (L̃ + ω − 1) v.
    #[inline(always)]
    pub(super) fn subtract_lower<L: Level>(&self, pattern: &Pattern, v: &[Wide<T>], r: &mut [Wide<T>]) {
        let rows = self.triangle.by_rows(pattern);
        for row in 0..v.len() {
            let here = v[row];
            r[row] = plus::<T, L>(r[row], 1.0 - self.relaxation, &here);
            for (block, column) in rows.blocks(row) {
                subtract_transposed::<T, L>(&mut r[column], block, &here);
            }
        }
    }

    /// w ← w + (L̃ + ω − 1) y and v ← (I + L̃)⁻¹ w, reading the blocks once.
    #[inline(always)]
    pub(super) fn add_lower_and_forward<L: Level>(
        &self,
        pattern: &Pattern,
        y: &[Wide<T>],
        w: &mut [Wide<T>],
        v: &mut [Wide<T>],
    ) {
        let rows = self.triangle.by_rows(pattern);
        v.fill([T::from_f64(0.0); 4]);
        for row in 0..v.len() {
            let (own, mut minus, mut here) = (plus::<T, L>(w[row], self.relaxation - 1.0, &y[row]), y[row], v[row]);
            for lane in 0..4 {
                minus[lane] = -minus[lane];
                here[lane] = here[lane] + own[lane];
            }
            (w[row], v[row]) = (own, here);
            for (block, column) in rows.blocks(row) {
                subtract_transposed::<T, L>(&mut w[column], block, &minus);
                subtract_transposed::<T, L>(&mut v[column], block, &here);
            }
        }
    }

    /// r ← r + s (Ẽ − ω + 1) v, where other domains have published their border rows of v.
    #[inline(always)]
    pub(super) fn add_coupled<L: Level>(
        &self,
        sign: f64,
        borders: &[RwLock<Vec<Wide<T>>>],
        v: &[Wide<T>],
        r: &mut [Wide<T>],
    ) {
        let sign = T::from_f64(sign);
        self.couplings.add_product::<L>(sign, borders, r);
        for (&row, columns) in self.couplings.border().iter().zip(&self.strengthened) {
            let (v, mut sum) = (v[row as usize], r[row as usize]);
            for column in 0..3 {
                let factor = -sign * v[column];
                for lane in 0..4 {
                    sum[lane] = columns[column][lane].mul_add::<L>(factor, sum[lane]);
                }
            }
            r[row as usize] = sum;
        }
    }
}

/// Runs [`Smoother::invert`].
pub(super) struct Inversion<'a, T, M> {
    pub(super) smoother: &'a mut Smoother<T>,
    pub(super) inverses: &'a mut [InverseFactor<T>],
    pub(super) matrix: &'a BlockMatrix<M>,
    pub(super) cross: &'a CrossBlocks,
    pub(super) unit: f64,
}

impl<T: Precision, M: Precision> Kernel for Inversion<'_, T, M> {
    type Output = Result<(), usize>;

    #[inline(always)]
    fn run<L: Level>(self) -> Self::Output {
        self.smoother.invert::<M, L>(self.matrix, self.cross, self.unit, self.inverses)
    }
}

/// Returns v + s u.
#[inline(always)]
fn plus<T: Precision, L: Level>(mut v: Wide<T>, scale: f64, u: &Wide<T>) -> Wide<T> {
    let scale = T::from_f64(scale);
    for lane in 0..4 {
        v[lane] = u[lane].mul_add::<L>(scale, v[lane]);
    }
    v
}
