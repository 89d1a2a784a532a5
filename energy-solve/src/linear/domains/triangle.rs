use std::ops::Range;

use energy_dsl::{BLOCK_NUMBERS, Block, Level};

use super::{InverseFactor, Precision, Wide, keep_vector, rounded};
use crate::matrix::block_matrix::BlockMatrix;
use crate::matrix::cross_blocks::CrossBlocks;
use crate::matrix::pattern::{Pattern, index};

/// Padding after a block's nine numbers, which is read and ignored; see [`BlockSum`](energy_dsl::BlockSum).
const SLACK: usize = BLOCK_NUMBERS - 9;

/// The blocks of L̃ᵀ = C⁻¹ Lᵀ C⁻ᵀ that couple the rows of a domain with each other, by rows. Rows and columns are
/// counted from the domain's first.
#[derive(Clone, Debug)]
pub(crate) struct Triangle<T> {
    pub(crate) rows: Range<usize>,
    /// Number of blocks above the diagonal in the rows before the domain.
    blocks_before: usize,
    /// For each row, the index of the first block whose column is outside the domain.
    pub(super) inner_end: Vec<u32>,
    /// The blocks, each row by row.
    numbers: Vec<T>,
    /// Layout of the blocks if the pattern lacks some of them; `None` otherwise.
    extended: Option<Extended>,
}

/// The places of a domain's blocks, laid out as in a [`Pattern`]: each row has its diagonal, the pattern's blocks, and
/// then those that the pattern lacks.
#[derive(Clone, Debug)]
struct Extended {
    columns: Vec<u32>,
    diagonals: Vec<u32>,
    inner_end: Vec<u32>,
}

/// The data of a [`Triangle`] that a sweep reads.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rows<'a, T> {
    numbers: &'a [T],
    columns: &'a [u32],
    /// The first block index and the end of each row.
    diagonals: &'a [u32],
    inner_end: &'a [u32],
    /// The first row, and the number of blocks before it, including diagonal ones.
    first: usize,
    before: usize,
}

impl<'a, T> Rows<'a, T> {
    /// Returns the blocks that couple a row with later rows of its domain.
    #[inline(always)]
    pub(crate) fn blocks(&self, row: usize) -> Blocks<'a, T> {
        let (diagonal, end) = (self.diagonals[row] as usize, self.inner_end[row] as usize);
        let columns = &self.columns[diagonal + 1..end];
        // Diagonal blocks, one per row, are not stored: subtract them.
        let numbers = &self.numbers[9 * (diagonal - (self.before + row))..][..9 * columns.len() + SLACK];
        Blocks { numbers, columns, first: self.first }
    }
}

/// Iterator over the blocks of a row, each padded to [`BLOCK_NUMBERS`] numbers, and their columns.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Blocks<'a, T> {
    numbers: &'a [T],
    columns: &'a [u32],
    first: usize,
}

impl<'a, T> Iterator for Blocks<'a, T> {
    type Item = (&'a [T; BLOCK_NUMBERS], usize);

    #[inline(always)]
    fn next(&mut self) -> Option<Self::Item> {
        let (&column, columns) = self.columns.split_first()?;
        let block = self.numbers.first_chunk()?;
        (self.columns, self.numbers) = (columns, &self.numbers[9..]);
        Some((block, column as usize - self.first))
    }
}

impl<T: Precision> Triangle<T> {
    /// Creates zero blocks for these rows of a pattern.
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
        let inner_end = inner_end.collect();
        Self { blocks_before: before(rows.start), inner_end, rows, numbers, extended: None }
    }

    /// Whether it has room for blocks that the pattern lacks.
    pub(super) fn is_extended(&self) -> bool {
        self.extended.is_some()
    }

    /// Makes room for blocks that the pattern lacks. Without such blocks, frees the room.
    pub(super) fn extend(&mut self, pattern: &Pattern, cross: &CrossBlocks) {
        let Self { rows, extended, numbers, .. } = self;
        let blocks = if cross.is_empty() {
            *extended = None;
            pattern.above(rows.end - 1).end - rows.end - self.blocks_before
        } else {
            let places = extended.insert(Extended::new(pattern, rows.clone(), &self.inner_end, cross));
            places.columns.len() - places.diagonals.len()
        };
        numbers.resize(9 * blocks + SLACK, T::from_f64(0.0));
    }

    /// Returns the indices, in the pattern, of the blocks that couple a row with later rows of the domain.
    #[inline(always)]
    fn slots(&self, pattern: &Pattern, local: usize) -> Range<usize> {
        pattern.above(self.rows.start + local).start..self.inner_end[local] as usize
    }

    /// Returns the blocks by rows, for sweeps.
    #[inline(always)]
    pub(crate) fn by_rows<'a>(&'a self, pattern: &'a Pattern) -> Rows<'a, T> {
        if let Some(Extended { columns, diagonals, inner_end }) = &self.extended {
            return Rows { numbers: &self.numbers, columns, diagonals, inner_end, first: self.rows.start, before: 0 };
        }
        Rows {
            numbers: &self.numbers,
            columns: pattern.columns(),
            diagonals: &pattern.diagonals()[self.rows.clone()],
            inner_end: &self.inner_end,
            first: self.rows.start,
            before: self.rows.start + self.blocks_before,
        }
    }

    /// Reads the domain's blocks of a matrix and of the blocks that it lacks, scaled by C⁻¹ of each row.
    #[inline(always)]
    pub(crate) fn scale<M: Precision, L: Level>(
        &mut self,
        inverses: &[InverseFactor<T>],
        matrix: &BlockMatrix<M>,
        cross: &CrossBlocks,
    ) {
        let (pattern, values) = (matrix.pattern(), matrix.values());
        for (local, row) in self.rows.clone().enumerate() {
            let own = rounded(&inverses[row]);
            let mut first = match &self.extended {
                Some(Extended { diagonals, .. }) => 9 * (diagonals[local] as usize - local),
                None => 9 * (pattern.diagonal(row) - row - self.blocks_before),
            };
            for slot in self.slots(pattern, local) {
                let other = rounded(&inverses[pattern.columns()[slot] as usize]);
                let rows = scaled_block::<M, L>(&own, &values[slot], &other);
                store(&mut self.numbers[first..][..10], &rows);
                first += 9;
            }
            if self.extended.is_some() {
                let own = rounded(&inverses[row]);
                for (_, column, block) in inner(cross, row, self.rows.end) {
                    let rows = scaled_block::<f64, L>(&own, block, &rounded(&inverses[column as usize]));
                    store(&mut self.numbers[first..][..10], &rows);
                    first += 9;
                }
            }
        }
    }
}

/// Returns the blocks of a row whose columns are before the end of the domain.
#[inline(always)]
fn inner(cross: &CrossBlocks, row: usize, end: usize) -> impl Iterator<Item = (usize, u32, &Block<f64>)> {
    cross.of_row(row).take_while(move |(_, column, _)| (*column as usize) < end)
}

impl Extended {
    fn new(pattern: &Pattern, rows: Range<usize>, pattern_ends: &[u32], cross: &CrossBlocks) -> Self {
        let (mut columns, mut diagonals, mut inner_end) = (Vec::new(), Vec::new(), Vec::new());
        for (row, &end) in rows.clone().zip(pattern_ends) {
            diagonals.push(index(columns.len()));
            columns.extend_from_slice(&pattern.columns()[pattern.diagonal(row)..end as usize]);
            columns.extend(inner(cross, row, rows.end).map(|(_, column, _)| column));
            inner_end.push(index(columns.len()));
        }
        Self { columns, diagonals, inner_end }
    }
}

/// Returns the rows of P B Qᵀ for lower triangular P and Q, given by columns. Rows of B Qᵀ are sums of columns of Q,
/// and rows of the product are sums of those.
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
    let right = keep_vector(right);
    for i in 0..3 {
        for k in 0..=i {
            for lane in 0..4 {
                scaled[i][lane] = right[k][lane].mul_add::<L>(p[k][i], scaled[i][lane]);
            }
        }
    }
    keep_vector(scaled)
}

/// Writes rows as four numbers each; the next row or block overwrites the fourth.
#[inline(always)]
fn store<T: Precision, M: Precision>(numbers: &mut [T], rows: &[Wide<M>; 3]) {
    for row in 0..3 {
        let target = &mut numbers[3 * row..3 * row + 4];
        for lane in 0..4 {
            target[lane] = T::from_f64(rows[row][lane].into());
        }
    }
}
