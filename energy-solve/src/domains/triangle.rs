use std::ops::Range;

use energy_dsl::{Block, Level};

use super::{InverseFactor, Precision, Wide, rounded, whole};
use crate::matrix::BlockMatrix;
use crate::pattern::{Pattern, index};

/// Numbers after the last block, so that four can be read where its last column begins.
pub(crate) const SLACK: usize = 1;

/// What couples the rows of a domain with each other: the blocks of L̃ᵀ = C⁻¹ Lᵀ C⁻ᵀ by rows. Rows and columns are counted from its first.
#[derive(Clone, Debug)]
pub(crate) struct Triangle<T> {
    pub(crate) rows: Range<usize>,
    /// Blocks above the diagonal in the rows before.
    blocks_before: usize,
    /// For each row the first place that is no longer coupled within the domain.
    pub(super) inner_end: Vec<u32>,
    /// Each block column by column, and row by row.
    pub(crate) columns: Vec<T>,
    pub(crate) by_rows: Vec<T>,
}

impl<T: Precision> Triangle<T> {
    /// Of these rows of a pattern.
    pub(super) fn new(pattern: &Pattern, rows: Range<usize>) -> Self {
        let before = |row: usize| pattern.above(row).start - row - 1;
        let inner_end = rows.clone().map(|row| {
            let above = pattern.above(row);
            let inner = pattern.columns()[above.clone()].partition_point(|&column| (column as usize) < rows.end);
            index(above.start + inner)
        });
        let last = rows.end - 1;
        let blocks = pattern.above(last).end - last - 1 - before(rows.start);
        let numbers = vec![T::from_f64(0.0); 9 * blocks + SLACK];
        Self {
            blocks_before: before(rows.start),
            inner_end: inner_end.collect(),
            rows,
            columns: numbers.clone(),
            by_rows: numbers,
        }
    }

    /// The places in the pattern of what couples a row with later ones.
    #[inline(always)]
    pub(crate) fn places(&self, pattern: &Pattern, local: usize) -> Range<usize> {
        pattern.above(self.rows.start + local).start..self.inner_end[local] as usize
    }

    /// By how much the place of a block of this row in the pattern exceeds its number here: before it there are as many blocks on the
    /// diagonal as rows, and its own.
    #[inline(always)]
    pub(crate) fn excess(&self, local: usize) -> usize {
        self.rows.start + local + 1 + self.blocks_before
    }

    /// Takes over its part of a matrix, scaled by C⁻¹ of each row.
    #[inline(always)]
    pub(crate) fn scale<M: Precision, L: Level>(&mut self, inverses: &[InverseFactor<T>], matrix: &BlockMatrix<M>) {
        let (pattern, values) = (matrix.pattern(), matrix.values());
        for (local, row) in self.rows.clone().enumerate() {
            let own = rounded(&inverses[row]);
            let excess = self.excess(local);
            for place in self.places(pattern, local) {
                let other = rounded(&inverses[pattern.columns()[place] as usize]);
                let rows = scaled_block::<M, L>(&own, &values[place], &other);
                let first = 9 * (place - excess);
                store(&mut self.by_rows[first..][..9 + SLACK], &rows);
                store(&mut self.columns[first..][..9 + SLACK], &transposed(&rows));
            }
        }
    }
}

/// The rows of P B Qᵀ, for lower triangular P and Q given by columns: rows of B Qᵀ are sums of columns of Q, and those of the product sums of these.
#[inline(always)]
pub(crate) fn scaled_block<M: Precision, L: Level>(p: &[Wide<M>; 3], b: &Block<M>, q: &[Wide<M>; 3]) -> [Wide<M>; 3] {
    let zero = [M::from_f64(0.0); 4];
    let (mut right, mut scaled) = ([zero; 3], [zero; 3]);
    for i in 0..3 {
        for k in 0..3 {
            for lane in 0..4 {
                right[i][lane] = q[k][lane].mul_add::<L>(b[i][k], right[i][lane]);
            }
        }
    }
    let right = whole(right);
    for i in 0..3 {
        for k in 0..=i {
            for lane in 0..4 {
                scaled[i][lane] = right[k][lane].mul_add::<L>(p[k][i], scaled[i][lane]);
            }
        }
    }
    whole(scaled)
}

#[inline(always)]
fn transposed<M: Precision>([a, b, c]: &[Wide<M>; 3]) -> [Wide<M>; 3] {
    let zero = M::from_f64(0.0);
    [[a[0], b[0], c[0], zero], [a[1], b[1], c[1], zero], [a[2], b[2], c[2], zero]]
}

/// Writes three numbers of each row, and the fourth, which means nothing, where the next is written after it.
#[inline(always)]
fn store<T: Precision, M: Precision>(numbers: &mut [T], rows: &[Wide<M>; 3]) {
    for row in 0..3 {
        let place = &mut numbers[3 * row..3 * row + 4];
        for lane in 0..4 {
            place[lane] = T::from_f64(rows[row][lane].into());
        }
    }
}
