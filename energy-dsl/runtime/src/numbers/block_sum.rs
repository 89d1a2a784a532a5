use std::fmt::Debug;
use std::marker::PhantomData;

use super::level::Level;
use super::real::Real;

/// Numbers that a [`BlockSum`] reads from the start of a block. Only the first nine belong to the block; the others do
/// not affect the result.
pub const BLOCK_NUMBERS: usize = 16;

/// A running sum of products of 3×3 blocks with vectors: the inner loop of sweeps over a sparse matrix.
///
/// Vectors have an unused fourth component. Blocks are stored row by row, with [`BLOCK_NUMBERS`] readable numbers. Each
/// entry's products are summed separately and combined per row only at the end, so all implementations with the same
/// [`Level::FUSED`] round identically.
pub trait BlockSum<T>: Copy + Debug {
    /// Creates an empty sum.
    fn zero() -> Self;

    /// Adds B v.
    fn add(&mut self, block: &[T; BLOCK_NUMBERS], v: &[T; 4]);

    /// Returns the sum.
    fn total(self) -> [T; 4];

    /// Returns u − B v, column by column: only three operations wait for v.
    fn less(u: [T; 4], block: &[T; BLOCK_NUMBERS], v: &[T; 4]) -> [T; 4];
}

/// The products of each row, in a vector per row.
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
