use std::fmt::Debug;
use std::marker::PhantomData;

use super::Level;
use crate::real::Real;

/// How many numbers a [`BlockSum`] reads from where a block begins; only nine are of the block, and the others come to nothing.
pub const BLOCK_NUMBERS: usize = 16;

/// A sum of products of 3×3 blocks with vectors: what sweeps through the rows of a sparse matrix compute, most of all.
///
/// Vectors have a fourth component that means nothing. Blocks are stored row by row, with [`BLOCK_NUMBERS`] to read. Products of entries are summed up
/// each by itself, and only at the end those of a row together: every implementation rounds alike, at the same [`Level::FUSED`].
pub trait BlockSum<T>: Copy + Debug {
    /// Nothing yet.
    fn zero() -> Self;

    /// Adds B v.
    fn add(&mut self, block: &[T; BLOCK_NUMBERS], v: &[T; 4]);

    /// The sum.
    fn total(self) -> [T; 4];

    /// u − B v, column by column: only three operations have to wait for v.
    fn less(u: [T; 4], block: &[T; BLOCK_NUMBERS], v: &[T; 4]) -> [T; 4];
}

/// The products of each row in a vector of its own.
#[derive(Clone, Copy, Debug)]
pub struct Rows<T, L> {
    rows: [[T; 4]; 3],
    level: PhantomData<L>,
}

impl<T: Real, L: Level> BlockSum<T> for Rows<T, L> {
    #[inline(always)]
    fn zero() -> Self {
        Self { rows: [[T::from_f64(0.0); 4]; 3], level: PhantomData }
    }

    #[inline(always)]
    fn add(&mut self, block: &[T; BLOCK_NUMBERS], v: &[T; 4]) {
        for row in 0..3 {
            for column in 0..4 {
                self.rows[row][column] = block[3 * row + column].mul_add::<L>(v[column], self.rows[row][column]);
            }
        }
    }

    #[inline(always)]
    fn total(self) -> [T; 4] {
        let mut total = [T::from_f64(0.0); 4];
        for row in 0..3 {
            let [a, b, c, _] = self.rows[row];
            total[row] = a + (b + c);
        }
        total
    }

    #[inline(always)]
    fn less(mut u: [T; 4], block: &[T; BLOCK_NUMBERS], v: &[T; 4]) -> [T; 4] {
        for column in 0..3 {
            let factor = -v[column];
            for row in 0..3 {
                u[row] = block[3 * row + column].mul_add::<L>(factor, u[row]);
            }
        }
        u
    }
}
