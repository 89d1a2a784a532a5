use std::sync::Arc;

use energy_dsl::{Block, Kernel, Level, Number, Vector3, dispatch};

use crate::linear::block_jacobi::{inverse_of_definite, is_positive_definite};
use crate::linear::preconditioner::{Preconditioner, SingularBlock};
use crate::linear::rounded_block::{Sums, Wide, add_times, narrow, room, store_columns, store_rows, total, widen};
use crate::matrix::block_matrix::BlockMatrix;
use crate::matrix::pattern::{Pattern, Storage, index};
use crate::matrix::precision::{Precision, doubled};
use crate::matrix::vector::add_scaled_block;

/// How much of the fill that is dropped goes to the diagonal.
const KEPT: f64 = 0.95;

/// How much the diagonal is strengthened, relative to itself, after a factorisation met a pivot that is not positive definite: nothing
/// at first, then this, then ten times as much, ….
const FIRST_SHIFT: f64 = 1e-3;

/// Incomplete Cholesky factorisation by 3×3 blocks without fill, A ≈ (1 + W)ᵀ D (1 + W) with W of the pattern of A above its diagonal and
/// D block-diagonal (Meijerink and van der Vorst 1977).
///
/// Most of the fill that is dropped is added to the diagonal, so that smooth displacements meet nearly the same resistance as in A: half
/// as many iterations on fine meshes (modified and relaxed, Gustafsson 1978, Axelsson and Lindskog 1986). Where a pivot fails it is
/// dropped altogether, and then the diagonal strengthened (shifted, Manteuffel 1980).
///
/// It is computed in double precision and kept in single: an approximation need not be exact, but it is read in every iteration of
/// a solver.
///
/// Made for matrices that change and patterns that do not: [`IncompleteCholesky::factor`] reuses everything else.
#[derive(Clone, Debug)]
pub struct IncompleteCholesky {
    pattern: Arc<Pattern>,
    /// By row, each pair of its blocks that changes a block of another row: W_kiᵀ U_kj for A_ij.
    updates: Vec<Update>,
    update_start: Vec<u32>,
    /// By row, each pair that would make a block where there is none.
    dropped: Vec<Dropped>,
    dropped_start: Vec<u32>,
    /// U = D W, and D, while they are computed.
    upper: Vec<Block<f64>>,
    /// W by the places of the pattern, each block row by row.
    rows: Vec<f32>,
    /// W column by column, with D⁻¹ on the diagonal.
    columns: Vec<f32>,
    shift: f64,
    /// How much of the dropped fill goes to the diagonal.
    kept: f64,
}

/// Blocks `left`ᵀ and `right` change block `to`.
#[derive(Clone, Copy, Debug)]
struct Update {
    left: u32,
    right: u32,
    to: u32,
}

/// Blocks `left`ᵀ and `right` make a block in the row and column of two on the diagonal.
#[derive(Clone, Copy, Debug)]
struct Dropped {
    left: u32,
    right: u32,
    diagonal: [u32; 2],
}

impl IncompleteCholesky {
    /// Prepares for matrices of a pattern.
    ///
    /// # Panics
    /// When it is not the upper triangle of a symmetric one.
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
            rows: room(pattern.blocks()),
            columns: room(pattern.blocks()),
            shift: 0.0,
            kept: KEPT,
        }
    }

    /// Factors a matrix of the pattern.
    ///
    /// # Errors
    /// When a diagonal block is not positive definite: then the matrix is not.
    ///
    /// # Panics
    /// When the matrix has another pattern.
    pub fn factor(&mut self, matrix: &BlockMatrix<impl Precision>) -> Result<(), SingularBlock> {
        assert!(Arc::ptr_eq(&self.pattern, matrix.pattern()), "the matrix has another pattern");
        if let Some(row) = (0..self.pattern.rows()).find(|&row| !is_positive_definite(&doubled(matrix.diagonal(row)))) {
            return Err(SingularBlock { row });
        }
        (self.shift, self.kept) = (0.0, KEPT);
        while let Err(row) = dispatch(Factorisation { of: self, matrix }) {
            if self.shift > 1.0 {
                return Err(SingularBlock { row });
            }
            self.shift = match self.shift {
                _ if self.kept > 0.0 => 0.0,
                0.0 => FIRST_SHIFT,
                shift => 10.0 * shift,
            };
            self.kept = 0.0;
        }
        Ok(())
    }

    /// By how much the diagonal had to be strengthened, relative to itself.
    #[must_use]
    pub fn shift(&self) -> f64 {
        self.shift
    }
}

/// The factorisation with the shift that is set. Fails with the row whose pivot is not positive definite.
struct Factorisation<'a, M> {
    of: &'a mut IncompleteCholesky,
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
            kept,
        } = self.of;
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
            if *kept == 0.0 {
                continue;
            }
            for number in dropped_start[row] as usize..dropped_start[row + 1] as usize {
                let Dropped { left, right, diagonal: places } = dropped[number];
                let w = &scaled[left as usize - diagonal - 1];
                let fill = less_transposed_product::<L>(&[[0.0; 3]; 3], w, &upper[right as usize]);
                for place in places {
                    add_symmetric_part(&mut upper[place as usize], *kept, &fill);
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

/// r, to be replaced by z with (1 + W)ᵀ D (1 + W) z = r.
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

/// A B.
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

/// C − Aᵀ B.
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
