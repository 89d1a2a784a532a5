use std::sync::Arc;

use energy_dsl::{Block, Kernel, Level, Number, Vector3, dispatch};

use crate::linear::block_jacobi::{inverse_of_definite, is_positive_definite};
use crate::linear::preconditioner::{Preconditioner, SingularBlock};
use crate::linear::rounded_block::{Sums, Wide, add_times, narrow, store_columns, store_rows, total, widen, zeros};
use crate::matrix::block_matrix::BlockMatrix;
use crate::matrix::pattern::{Pattern, Storage, index};
use crate::matrix::precision::{Precision, doubled};
use crate::matrix::vector::add_scaled_block;

/// The fraction of dropped fill-in that is added to the diagonal.
const COMPENSATION: f64 = 0.95;

/// The first relative shift of the diagonal, after a pivot failed without a shift. Each further failure multiplies it
/// by 10.
const FIRST_SHIFT: f64 = 1e-3;

/// Incomplete Cholesky factorisation by 3×3 blocks without fill-in: A ≈ (1 + W)ᵀ D (1 + W). D is block-diagonal, and W
/// has the pattern of A above the diagonal (Meijerink and van der Vorst 1977).
///
/// Most of the dropped fill-in is added to the diagonal, which preserves the action on smooth displacements and halves
/// the iterations on fine meshes (relaxed modified factorisation, Gustafsson 1978, Axelsson and Lindskog 1986). If a
/// pivot fails, the fill-in is dropped entirely; if one fails again, the diagonal is shifted (Manteuffel 1980).
///
/// The factor is computed in double precision and stored in single precision: it is an approximation anyway, and a
/// solver reads it in every iteration.
///
/// [`IncompleteCholesky::factor`] reuses everything that depends on the pattern alone.
#[derive(Clone, Debug)]
pub struct IncompleteCholesky {
    pattern: Arc<Pattern>,
    /// Pairs of blocks of a row that update a block of another row, sorted by row: A_ij −= W_kiᵀ U_kj.
    updates: Vec<Update>,
    update_start: Vec<u32>,
    /// Pairs of blocks of a row whose product is outside the pattern, sorted by row.
    dropped: Vec<Dropped>,
    dropped_start: Vec<u32>,
    /// U = D W and D during the factorisation.
    upper: Vec<Block<f64>>,
    /// W by block index, each block row by row.
    rows: Vec<f32>,
    /// W by block index, each block column by column, with D⁻¹ on the diagonal.
    columns: Vec<f32>,
    shift: f64,
    /// The fraction of dropped fill-in that is added to the diagonal.
    compensation: f64,
}

/// The product of blocks `left`ᵀ and `right` updates block `to`.
#[derive(Clone, Copy, Debug)]
struct Update {
    left: u32,
    right: u32,
    to: u32,
}

/// The product of blocks `left`ᵀ and `right` is dropped from the row and column of two diagonal blocks.
#[derive(Clone, Copy, Debug)]
struct Dropped {
    left: u32,
    right: u32,
    diagonal: [u32; 2],
}

impl IncompleteCholesky {
    /// Analyses a pattern.
    ///
    /// # Panics
    /// If the pattern does not store an upper triangle.
    #[must_use]
    pub fn new(pattern: &Arc<Pattern>) -> Self {
        assert_eq!(pattern.storage(), Storage::Upper, "only symmetric matrices have Cholesky factors");
        let (mut updates, mut update_start) = (Vec::new(), vec![0]);
        let (mut dropped, mut dropped_start) = (Vec::new(), vec![0]);
        for row in 0..pattern.rows() {
            let blocks: Vec<(usize, usize)> = pattern.row(row).skip(1).collect();
            for (place, &(left, i)) in blocks.iter().enumerate() {
                for &(right, j) in &blocks[place..] {
                    let [left, right] = [left, right].map(index);
                    match pattern.place(i, j) {
                        Some((to, _)) => updates.push(Update { left, right, to: index(to) }),
                        None => {
                            let diagonal = [i, j].map(|row| index(pattern.diagonal(row)));
                            dropped.push(Dropped { left, right, diagonal });
                        }
                    }
                }
            }
            update_start.push(index(updates.len()));
            dropped_start.push(index(dropped.len()));
        }
        Self {
            pattern: Arc::clone(pattern),
            updates,
            update_start,
            dropped,
            dropped_start,
            upper: Vec::new(),
            rows: zeros(pattern.blocks()),
            columns: zeros(pattern.blocks()),
            shift: 0.0,
            compensation: COMPENSATION,
        }
    }

    /// Factors a matrix of the pattern.
    ///
    /// # Errors
    /// If a diagonal block is not positive definite, in which case neither is the matrix.
    ///
    /// # Panics
    /// If the matrix has another pattern.
    pub fn factor(&mut self, matrix: &BlockMatrix<impl Precision>) -> Result<(), SingularBlock> {
        assert!(Arc::ptr_eq(&self.pattern, matrix.pattern()), "the matrix has another pattern");
        if let Some(row) = (0..self.pattern.rows()).find(|&row| !is_positive_definite(&doubled(matrix.diagonal(row)))) {
            return Err(SingularBlock { row });
        }
        (self.shift, self.compensation) = (0.0, COMPENSATION);
        while let Err(row) = dispatch(Factorisation { factor: self, matrix }) {
            if self.shift > 1.0 {
                return Err(SingularBlock { row });
            }
            self.shift = match self.shift {
                _ if self.compensation > 0.0 => 0.0,
                0.0 => FIRST_SHIFT,
                shift => 10.0 * shift,
            };
            self.compensation = 0.0;
        }
        Ok(())
    }

    /// Returns the relative shift of the diagonal that the last factorisation needed.
    #[must_use]
    pub fn shift(&self) -> f64 {
        self.shift
    }
}

/// One attempt at a factorisation, with the current shift. Fails with the row of the first pivot that is not positive
/// definite.
struct Factorisation<'a, M> {
    factor: &'a mut IncompleteCholesky,
    matrix: &'a BlockMatrix<M>,
}

impl<M: Precision> Kernel for Factorisation<'_, M> {
    type Output = Result<(), usize>;

    #[inline(always)]
    fn run<L: Level>(self) -> Self::Output {
        let IncompleteCholesky {
            pattern,
            updates,
            update_start,
            dropped,
            dropped_start,
            upper,
            rows,
            columns,
            shift,
            compensation,
        } = self.factor;
        upper.clear();
        upper.extend(self.matrix.values().iter().map(doubled));
        let mut scaled: Vec<Block<f64>> = Vec::new();
        for row in 0..pattern.rows() {
            let diagonal = pattern.diagonal(row);
            let pivot = &mut upper[diagonal];
            if *shift > 0.0 {
                add_scaled_block(pivot, *shift, &doubled(self.matrix.diagonal(row)));
            }
            let Some(inverse) = inverse_of_definite(pivot) else { return Err(row) };
            store_columns(columns, diagonal, &inverse);
            scaled.clear();
            for place in pattern.above(row) {
                let block = product::<L>(&inverse, &upper[place]);
                store_rows(rows, place, &block);
                store_columns(columns, place, &block);
                scaled.push(block);
            }
            for number in update_start[row] as usize..update_start[row + 1] as usize {
                let Update { left, right, to } = updates[number];
                let w = &scaled[left as usize - diagonal - 1];
                let changed = less_transposed_product::<L>(&upper[to as usize], w, &upper[right as usize]);
                upper[to as usize] = changed;
            }
            if *compensation == 0.0 {
                continue;
            }
            for number in dropped_start[row] as usize..dropped_start[row + 1] as usize {
                let Dropped { left, right, diagonal: places } = dropped[number];
                let w = &scaled[left as usize - diagonal - 1];
                let fill = less_transposed_product::<L>(&[[0.0; 3]; 3], w, &upper[right as usize]);
                for place in places {
                    add_symmetric_part(&mut upper[place as usize], *compensation, &fill);
                }
            }
        }
        Ok(())
    }
}

impl Preconditioner for IncompleteCholesky {
    fn is_positive_definite(&self) -> bool {
        true
    }

    fn apply(&self, r: &[Vector3<f64>], z: &mut [Vector3<f64>]) {
        let mut wide = widen(r);
        dispatch(Solution { factor: self, z: &mut wide });
        narrow(&wide, z);
    }
}

/// Solves (1 + W)ᵀ D (1 + W) z = r in place; `z` holds r first.
struct Solution<'a> {
    factor: &'a IncompleteCholesky,
    z: &'a mut [Wide],
}

impl Kernel for Solution<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Level>(self) {
        let IncompleteCholesky { pattern, rows, columns, .. } = self.factor;
        let z = self.z;
        for row in 0..pattern.rows() {
            let here = z[row];
            for place in pattern.above(row) {
                let vector = &mut z[pattern.columns()[place] as usize];
                let mut sums = [*vector, [0.0; 4], [0.0; 4]];
                add_times::<L>(&mut sums, -1.0, rows, place, &here);
                *vector = total(&sums);
            }
        }
        for row in (0..pattern.rows()).rev() {
            let mut sums = Sums::default();
            for place in pattern.above(row) {
                add_times::<L>(&mut sums, -1.0, columns, place, &z[pattern.columns()[place] as usize]);
            }
            add_times::<L>(&mut sums, 1.0, columns, pattern.diagonal(row), &z[row]);
            z[row] = total(&sums);
        }
    }
}

/// A ← A + s (B + Bᵀ)/2.
#[inline(always)]
fn add_symmetric_part(sum: &mut Block<f64>, scale: f64, block: &Block<f64>) {
    for i in 0..3 {
        for j in 0..3 {
            sum[i][j] += 0.5 * scale * (block[i][j] + block[j][i]);
        }
    }
}

/// Returns A B.
#[inline(always)]
fn product<L: Level>(a: &Block<f64>, b: &Block<f64>) -> Block<f64> {
    let mut product = [[0.0; 3]; 3];
    for i in 0..3 {
        for k in 0..3 {
            for j in 0..3 {
                product[i][j] = Number::mul_add::<L>(a[i][k], b[k][j], product[i][j]);
            }
        }
    }
    product
}

/// Returns C − Aᵀ B.
#[inline(always)]
fn less_transposed_product<L: Level>(c: &Block<f64>, a: &Block<f64>, b: &Block<f64>) -> Block<f64> {
    let mut difference = *c;
    for k in 0..3 {
        for i in 0..3 {
            for j in 0..3 {
                difference[i][j] = Number::mul_add::<L>(-a[k][i], b[k][j], difference[i][j]);
            }
        }
    }
    difference
}
