use std::sync::Arc;

use energy_dsl::{BLOCK_NUMBERS, Block, BlockSum, Kernel, Level, Number, Vector3, dispatch};

use crate::matrix::pattern::{Pattern, Storage};
use crate::matrix::precision::{Precision, doubled};
use crate::matrix::vector::{transposed, widened};

/// A square sparse matrix of 3×3 blocks with entries in `T`, `f32` or `f64`. A symmetric matrix stores its upper
/// triangle.
#[derive(Clone, Debug)]
pub struct BlockMatrix<T = f64> {
    pattern: Arc<Pattern>,
    /// The blocks of the pattern, and one more for the blocks of pinned vertices, at [`Pattern::nowhere`].
    values: Vec<Block<T>>,
    /// Identifies what a system wrote to the matrix; `None` after any other change.
    contents: Option<Arc<Contents>>,
}

/// Identity of the contents that a system wrote to a matrix and its clones.
#[derive(Debug)]
pub(crate) struct Contents;

impl<T: Precision> BlockMatrix<T> {
    /// Creates the zero matrix of a pattern.
    #[must_use]
    pub fn zeros(pattern: Arc<Pattern>) -> Self {
        let values = vec![[[T::from_f64(0.0); 3]; 3]; pattern.blocks() + 1];
        Self { pattern, values, contents: None }
    }

    /// Returns the pattern that says which blocks are stored.
    #[must_use]
    pub fn pattern(&self) -> &Arc<Pattern> {
        &self.pattern
    }

    /// Returns the diagonal block of a row.
    #[must_use]
    pub fn diagonal(&self, row: usize) -> &Block<T> {
        &self.values[self.pattern.diagonal(row)]
    }

    /// Returns the diagonal block of a row for modification.
    pub fn diagonal_mut(&mut self, row: usize) -> &mut Block<T> {
        self.contents = None;
        &mut self.values[self.pattern.diagonal(row)]
    }

    /// Returns block (row, column); zero if it is not in the pattern.
    #[must_use]
    pub fn block(&self, row: usize, column: usize) -> Block<f64> {
        let Some((slot, flipped)) = self.pattern.slot(row, column) else { return [[0.0; 3]; 3] };
        let block = doubled(&self.values[slot]);
        if flipped { transposed(&block) } else { block }
    }

    /// Returns the stored blocks, by [`Pattern::slot`].
    #[must_use]
    pub fn values(&self) -> &[Block<T>] {
        &self.values[..self.pattern.blocks()]
    }

    /// Returns the stored blocks for modification, by [`Pattern::slot`].
    pub fn values_mut(&mut self) -> &mut [Block<T>] {
        self.contents = None;
        let stored = self.pattern.blocks();
        &mut self.values[..stored]
    }

    /// Returns the identity of the contents and clears it, because the caller is about to change entries.
    pub(crate) fn take_contents(&mut self) -> Option<Arc<Contents>> {
        self.contents.take()
    }

    /// Sets the identity of the contents.
    pub(crate) fn set_contents(&mut self, contents: Option<Arc<Contents>>) {
        self.contents = contents;
    }

    /// Returns the stored blocks and the one at [`Pattern::nowhere`].
    pub(crate) fn values_and_nowhere(&mut self) -> &mut [Block<T>] {
        &mut self.values
    }

    /// Returns Σ_j |a_ij| for each row i, which bounds the eigenvalues (Gershgorin).
    #[must_use]
    pub fn absolute_row_sums(&self) -> Vec<Vector3<f64>> {
        let mut sums = vec![[0.0; 3]; self.pattern.rows()];
        for row in 0..self.pattern.rows() {
            for (slot, column) in self.pattern.row(row) {
                for i in 0..3 {
                    for j in 0..3 {
                        let size: f64 = self.values[slot][i][j].abs().into();
                        sums[row][i] += size;
                        if self.pattern.storage() == Storage::Upper && row != column {
                            sums[column][j] += size;
                        }
                    }
                }
            }
        }
        sums
    }

    /// Computes y ← A x.
    pub fn multiply(&self, x: &[Vector3<f64>], y: &mut [Vector3<f64>]) {
        dispatch(Product { matrix: self, x, y });
    }

    /// Returns a block in double precision, padded with numbers of the next block, which the caller ignores. The block
    /// at [`Pattern::nowhere`] keeps the last read within bounds.
    #[inline(always)]
    fn numbers_from(&self, slot: usize) -> [f64; BLOCK_NUMBERS] {
        let stored = &self.values.as_flattened().as_flattened()[9 * slot..][..BLOCK_NUMBERS];
        let mut numbers = [0.0; BLOCK_NUMBERS];
        for (number, &stored) in numbers.iter_mut().zip(stored) {
            *number = stored.into();
        }
        numbers
    }
}

/// The kernel y ← A x.
struct Product<'a, T> {
    matrix: &'a BlockMatrix<T>,
    x: &'a [Vector3<f64>],
    y: &'a mut [Vector3<f64>],
}

impl<T: Precision> Kernel for Product<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<L: Level>(self) {
        match self.matrix.pattern.storage() {
            Storage::Whole => self.whole::<L>(),
            Storage::Upper => self.upper::<L>(),
        }
    }
}

impl<T: Precision> Product<'_, T> {
    #[inline(always)]
    fn whole<L: Level>(self) {
        for row in 0..self.matrix.pattern.rows() {
            let mut sum = L::Sum64::zero();
            for (slot, column) in self.matrix.pattern.row(row) {
                sum.add(&self.matrix.numbers_from(slot), &widened(self.x[column]));
            }
            let [u, v, w, _] = sum.total();
            self.y[row] = [u, v, w];
        }
    }

    /// Each block above the diagonal acts twice: as itself and as its transpose.
    #[inline(always)]
    fn upper<L: Level>(self) {
        self.y.fill([0.0; 3]);
        for row in 0..self.matrix.pattern.rows() {
            let mut sum = L::Sum64::zero();
            for (slot, column) in self.matrix.pattern.row(row) {
                let block = self.matrix.numbers_from(slot);
                sum.add(&block, &widened(self.x[column]));
                if column != row {
                    add_transposed::<L>(&mut self.y[column], &block, &self.x[row]);
                }
            }
            let ([u, v, w, _], [a, b, c]) = (sum.total(), self.y[row]);
            self.y[row] = [a + u, b + v, c + w];
        }
    }
}

/// y ← y + Bᵀ v.
#[inline(always)]
fn add_transposed<L: Level>(y: &mut Vector3<f64>, block: &[f64; BLOCK_NUMBERS], v: &Vector3<f64>) {
    let mut sum = *y;
    for row in 0..3 {
        for column in 0..3 {
            sum[column] = Number::mul_add::<L>(block[3 * row + column], v[row], sum[column]);
        }
    }
    *y = sum;
}
