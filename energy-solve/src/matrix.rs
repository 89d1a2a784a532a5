use std::sync::Arc;

use energy_dsl::{Block, Vector3};

use crate::constant::Constant;
use crate::pattern::{Pattern, Storage};
use crate::precision::{Precision, doubled};
use crate::vector::{block_times, transposed, transposed_times};

/// A square sparse matrix of 3×3 blocks; a symmetric one as its upper triangle. Entries are stored in `T`, `f32` or `f64`.
#[derive(Clone, Debug)]
pub struct BlockMatrix<T = f64> {
    pattern: Arc<Pattern>,
    /// The blocks of the pattern, and one more that takes what belongs nowhere.
    values: Vec<Block<T>>,
    /// What a system knows to be constant of it; nothing, after others changed it.
    pub(crate) constant: Option<Constant<T>>,
}

impl<T: Precision> BlockMatrix<T> {
    /// The zero matrix of a pattern.
    #[must_use]
    pub fn zeros(pattern: Arc<Pattern>) -> Self {
        let values = vec![[[T::from_f64(0.0); 3]; 3]; pattern.blocks() + 1];
        Self { pattern, values, constant: None }
    }

    /// The pattern.
    #[must_use]
    pub fn pattern(&self) -> &Arc<Pattern> {
        &self.pattern
    }

    /// The diagonal block of a row.
    #[must_use]
    pub fn diagonal(&self, row: usize) -> &Block<T> {
        &self.values[self.pattern.diagonal(row)]
    }

    /// The diagonal block of a row, to be changed.
    pub fn diagonal_mut(&mut self, row: usize) -> &mut Block<T> {
        self.constant = None;
        &mut self.values[self.pattern.diagonal(row)]
    }

    /// A block; zero where the pattern has none.
    #[must_use]
    pub fn block(&self, row: usize, column: usize) -> Block<f64> {
        let Some((slot, flipped)) = self.pattern.place(row, column) else { return [[0.0; 3]; 3] };
        let block = doubled(&self.values[slot]);
        if flipped { transposed(&block) } else { block }
    }

    /// The stored blocks in the order of [`Pattern::place`].
    #[must_use]
    pub fn values(&self) -> &[Block<T>] {
        &self.values[..self.pattern.blocks()]
    }

    /// The stored blocks, to be changed.
    pub fn values_mut(&mut self) -> &mut [Block<T>] {
        self.constant = None;
        let stored = self.pattern.blocks();
        &mut self.values[..stored]
    }

    /// The stored blocks, and the one at [`Pattern::nowhere`].
    pub(crate) fn values_and_nowhere(&mut self) -> &mut [Block<T>] {
        &mut self.values
    }

    /// Σ_j |a_ij| of every row i, by block rows: bounds on the eigenvalues (Gershgorin).
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

    /// y ← A x.
    pub fn multiply(&self, x: &[Vector3<f64>], y: &mut [Vector3<f64>]) {
        match self.pattern.storage() {
            Storage::Whole => self.multiply_whole(x, y),
            Storage::Upper => self.multiply_upper(x, y),
        }
    }

    fn multiply_whole(&self, x: &[Vector3<f64>], y: &mut [Vector3<f64>]) {
        for (row, sum) in y.iter_mut().enumerate() {
            *sum = [0.0; 3];
            for (slot, column) in self.pattern.row(row) {
                add(sum, block_times(&doubled(&self.values[slot]), &x[column]));
            }
        }
    }

    /// Each block of the triangle acts twice, also as its own mirror image.
    fn multiply_upper(&self, x: &[Vector3<f64>], y: &mut [Vector3<f64>]) {
        y.fill([0.0; 3]);
        for row in 0..self.pattern.rows() {
            let here = x[row];
            let mut sum = block_times(&doubled(self.diagonal(row)), &here);
            for (slot, column) in self.pattern.row(row).skip(1) {
                let block = doubled(&self.values[slot]);
                add(&mut sum, block_times(&block, &x[column]));
                add(&mut y[column], transposed_times(&block, &here));
            }
            add(&mut y[row], sum);
        }
    }
}

#[inline(always)]
fn add(sum: &mut Vector3<f64>, part: Vector3<f64>) {
    for axis in 0..3 {
        sum[axis] += part[axis];
    }
}
