use energy_dsl::Block;

use crate::matrix::pattern::index;
use crate::matrix::vector::add_scaled_block;

/// Blocks of a symmetric matrix that its pattern lacks: those above the diagonal, by rows, with ascending columns.
///
/// Contacts couple rows that no element couples. [`BlockMatrix::add_contacts`](crate::BlockMatrix::add_contacts)
/// returns their blocks, summed, and solvers take the sum of the matrix and these blocks.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CrossBlocks {
    /// Index of the first block of each row, then the number of blocks; empty without blocks.
    row_start: Vec<u32>,
    columns: Vec<u32>,
    blocks: Vec<Block<f64>>,
}

/// A summand of the block at a row and a column to its right: a share of a block.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CrossEntry<'a> {
    pub(crate) row: u32,
    pub(crate) column: u32,
    pub(crate) share: f64,
    pub(crate) block: &'a Block<f64>,
}

/// Marks a column without a block in the current row.
const NONE: u32 = u32::MAX;

impl CrossBlocks {
    /// Sums blocks at the same place, in the order of the lists, for a matrix with this number of rows.
    pub(crate) fn summed(rows: usize, lists: &[Vec<CrossEntry<'_>>]) -> Self {
        if lists.iter().all(Vec::is_empty) {
            return Self::default();
        }
        let (start, order) = by_rows(rows, lists);
        let mut sums = Self { row_start: vec![0], ..Self::default() };
        let mut location = vec![NONE; rows];
        let mut of_row: Vec<(u32, Block<f64>)> = Vec::new();
        for row in 0..rows {
            of_row.clear();
            for &&CrossEntry { column, share, block, .. } in &order[start[row] as usize..start[row + 1] as usize] {
                let known = &mut location[column as usize];
                if *known == NONE {
                    *known = index(of_row.len());
                    of_row.push((column, [[0.0; 3]; 3]));
                }
                add_scaled_block(&mut of_row[*known as usize].1, share, block);
            }
            of_row.iter().for_each(|(column, _)| location[*column as usize] = NONE);
            of_row.sort_unstable_by_key(|(column, _)| *column);
            sums.columns.extend(of_row.iter().map(|(column, _)| *column));
            sums.blocks.extend(of_row.iter().map(|(_, block)| *block));
            sums.row_start.push(index(sums.columns.len()));
        }
        sums
    }

    /// Whether the list is empty.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.blocks.is_empty()
    }

    /// Returns the number of blocks.
    #[must_use]
    pub fn len(&self) -> usize {
        self.blocks.len()
    }

    /// Iterates over the index, column and block of each block of a row.
    #[inline(always)]
    pub(crate) fn of_row(&self, row: usize) -> impl Iterator<Item = (usize, u32, &Block<f64>)> {
        let range = match self.row_start.get(row..row + 2) {
            Some(&[start, end]) => start as usize..end as usize,
            _ => 0..0,
        };
        range.map(|number| (number, self.columns[number], &self.blocks[number]))
    }

    /// Returns all blocks.
    pub(crate) fn blocks(&self) -> &[Block<f64>] {
        &self.blocks
    }
}

/// Returns where the entries of each row begin in a list of all entries sorted by row, and that list.
fn by_rows<'a>(rows: usize, lists: &'a [Vec<CrossEntry<'a>>]) -> (Vec<u32>, Vec<&'a CrossEntry<'a>>) {
    let mut start = vec![0; rows + 1];
    lists.iter().flatten().for_each(|entry| start[entry.row as usize + 1] += 1);
    for row in 0..rows {
        start[row + 1] += start[row];
    }
    let Some(first) = lists.iter().flatten().next() else { return (start, Vec::new()) };
    let (mut next, mut order) = (start.clone(), vec![first; start[rows] as usize]);
    for entry in lists.iter().flatten() {
        let place = &mut next[entry.row as usize];
        order[*place as usize] = entry;
        *place += 1;
    }
    (start, order)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_at_the_same_place_are_summed() {
        let block = [[1.0, 0.0, 2.0]; 3];
        let entry = |row, column, share| CrossEntry { row, column, share, block: &block };
        let first = vec![entry(1, 4, 1.0), entry(0, 3, 2.0), entry(1, 2, 4.0)];
        let sums = CrossBlocks::summed(5, &[first, Vec::new(), vec![entry(1, 4, 8.0), entry(0, 4, 16.0)]]);
        let found = |row| sums.of_row(row).map(|(_, column, block)| (column, block[2][2])).collect::<Vec<_>>();
        assert_eq!(found(0), [(3, 4.0), (4, 32.0)]);
        assert_eq!(found(1), [(2, 8.0), (4, 18.0)]);
        assert!((2..7).all(|row| found(row).is_empty()));
        assert_eq!(sums.len(), 4);
        let none = CrossBlocks::summed(5, &[Vec::new()]);
        assert!(none.is_empty() && none.of_row(3).next().is_none());
    }
}
