use std::ops::Range;

use energy_dsl::{Block, Level, Number};

use super::Precision;
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
    pub(crate) fn scale<L: Level>(&mut self, pattern: &Pattern, inverses: &[Block<f64>], matrix: &BlockMatrix) {
        let values = matrix.values();
        let before = self.blocks_before;
        let (columns, by_rows) = (self.columns.as_chunks_mut::<9>().0, self.by_rows.as_chunks_mut::<9>().0);
        for (local, row) in self.rows.clone().enumerate() {
            let own = inverses[row];
            for place in pattern.above(row).start..self.inner_end[local] as usize {
                let other = &inverses[pattern.columns()[place] as usize];
                let block = scaled_block::<L>(&own, &values[place], other);
                let number = place - row - 1 - before;
                for i in 0..3 {
                    for j in 0..3 {
                        let entry = T::from_f64(block[i][j]);
                        by_rows[number][3 * i + j] = entry;
                        columns[number][3 * j + i] = entry;
                    }
                }
            }
        }
    }
}

/// P B Qᵀ for lower triangular P and Q.
#[inline(always)]
pub(crate) fn scaled_block<L: Level>(p: &Block<f64>, b: &Block<f64>, q: &Block<f64>) -> Block<f64> {
    let mut left = [[0.0; 3]; 3];
    let mut scaled = [[0.0; 3]; 3];
    for i in 0..3 {
        for k in 0..=i {
            for j in 0..3 {
                left[i][j] = Number::mul_add::<L>(p[i][k], b[k][j], left[i][j]);
            }
        }
    }
    for j in 0..3 {
        for k in 0..=j {
            for i in 0..3 {
                scaled[i][j] = Number::mul_add::<L>(left[i][k], q[j][k], scaled[i][j]);
            }
        }
    }
    scaled
}
