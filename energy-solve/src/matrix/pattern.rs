/// The part of a matrix that is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Storage {
    /// Every block of the pattern.
    Whole,
    /// The diagonal and the blocks above it, for a symmetric matrix.
    Upper,
}

/// The positions of the non-zero 3×3 blocks of a square matrix, by rows, with ascending columns. The diagonal is always
/// included.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pattern {
    storage: Storage,
    row_start: Vec<u32>,
    columns: Vec<u32>,
    diagonal: Vec<u32>,
}

impl Pattern {
    /// Creates a pattern of `rows` block rows that couples all rows of each stencil.
    ///
    /// # Panics
    /// If a stencil names a row out of range, or there are more than 2³² blocks.
    #[must_use]
    pub fn from_stencils<'a, S>(storage: Storage, rows: usize, stencils: S) -> Self
    where
        S: IntoIterator<Item = &'a [u32], IntoIter: Clone>,
    {
        let pairs =
            |stencil: &'a [u32]| stencil.iter().flat_map(|&row| stencil.iter().map(move |&column| (row, column)));
        Self::from_pairs(storage, rows, stencils.into_iter().flat_map(pairs))
    }

    /// Creates a pattern with these (row, column) blocks and the diagonal. Blocks that `storage` excludes are dropped.
    pub(crate) fn from_pairs(storage: Storage, rows: usize, blocks: impl Iterator<Item = (u32, u32)> + Clone) -> Self {
        let (start, mut columns) = sorted_by_row(storage, rows, blocks);
        let (mut row_start, mut diagonal, mut end) = (Vec::with_capacity(rows + 1), Vec::with_capacity(rows), 0);
        row_start.push(0);
        for row in 0..rows {
            let named = start[row]..start[row + 1];
            columns[named.clone()].sort_unstable();
            for position in named {
                let column = columns[position];
                // Skip duplicates.
                if end == row_start[row] as usize || columns[end - 1] != column {
                    if column == index(row) {
                        diagonal.push(index(end));
                    }
                    columns[end] = column;
                    end += 1;
                }
            }
            row_start.push(index(end));
        }
        columns.truncate(end);
        columns.shrink_to_fit();
        Self { storage, row_start, columns, diagonal }
    }

    /// Returns the pattern of the blocks between these rows, which ascend, and the index in it of each block of this
    /// pattern: [`Pattern::nowhere`] for the others.
    pub(crate) fn restricted(&self, rows: &[usize]) -> (Self, Vec<u32>) {
        let mut new_row = vec![None; self.rows()];
        rows.iter().enumerate().for_each(|(number, &row)| new_row[row] = Some(index(number)));
        let mut slots = vec![u32::MAX; self.blocks() + 1];
        let (mut row_start, mut columns, mut diagonal) = (vec![0], Vec::new(), Vec::with_capacity(rows.len()));
        for &row in rows {
            for (slot, column) in self.row(row) {
                let Some(new_column) = new_row[column] else { continue };
                slots[slot] = index(columns.len());
                if column == row {
                    diagonal.push(slots[slot]);
                }
                columns.push(new_column);
            }
            row_start.push(index(columns.len()));
        }
        let nowhere = index(columns.len());
        slots.iter_mut().for_each(|slot| *slot = nowhere.min(*slot));
        (Self { storage: self.storage, row_start, columns, diagonal }, slots)
    }

    /// Returns which part of the matrix is stored.
    #[must_use]
    pub fn storage(&self) -> Storage {
        self.storage
    }

    /// Returns the number of block rows.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.diagonal.len()
    }

    /// Returns the number of stored blocks.
    #[must_use]
    pub fn blocks(&self) -> usize {
        self.columns.len()
    }

    /// Returns the index of block (row, column) and whether its transpose is stored instead; `None` if it is not in the
    /// pattern.
    #[must_use]
    pub fn slot(&self, row: usize, column: usize) -> Option<(usize, bool)> {
        let flipped = self.storage == Storage::Upper && column < row;
        let (row, column) = if flipped { (column, row) } else { (row, column) };
        let (start, end) = (self.row_start[row] as usize, self.row_start[row + 1] as usize);
        self.columns[start..end].binary_search(&index(column)).ok().map(|offset| (start + offset, flipped))
    }

    /// Whether eliminating the rows in order creates fill-in. Chains in order do not fill in; sheets do.
    #[must_use]
    pub fn fills_in(&self) -> bool {
        let coupled = |i: usize, j: usize| i == j || self.slot(i, j).is_some();
        let later = |row: usize| self.row(row).map(|(_, column)| column).filter(move |&column| column > row);
        (0..self.rows()).any(|row| later(row).any(|i| later(row).any(|j| i < j && !coupled(i, j))))
    }

    /// Returns the index, past all blocks, to which blocks of pinned vertices are written.
    #[must_use]
    pub fn nowhere(&self) -> usize {
        self.blocks()
    }

    /// Returns the index of a row's diagonal block.
    #[must_use]
    #[inline]
    pub fn diagonal(&self, row: usize) -> usize {
        self.diagonal[row] as usize
    }

    /// Returns the indices of all diagonal blocks.
    #[inline(always)]
    pub(crate) fn diagonals(&self) -> &[u32] {
        &self.diagonal
    }

    /// Returns the indices of a row's blocks above the diagonal, if only the upper triangle is stored.
    #[inline(always)]
    pub(crate) fn above(&self, row: usize) -> std::ops::Range<usize> {
        self.diagonal[row] as usize + 1..self.row_start[row + 1] as usize
    }

    /// Returns the index of a row's first block; the number of blocks for the row past the end.
    pub(crate) fn first_in(&self, row: usize) -> usize {
        self.row_start[row] as usize
    }

    /// Returns the columns of all blocks.
    #[inline(always)]
    pub(crate) fn columns(&self) -> &[u32] {
        &self.columns
    }

    /// Returns the index and column of each block of a row.
    #[inline]
    pub fn row(&self, row: usize) -> impl ExactSizeIterator<Item = (usize, usize)> {
        let (start, end) = (self.row_start[row] as usize, self.row_start[row + 1] as usize);
        let columns = &self.columns[start..end];
        columns.iter().enumerate().map(move |(offset, &column)| (start + offset, column as usize))
    }
}

/// Returns where each row begins, and the columns of the diagonal and of the stored blocks, row after row, with
/// duplicates.
fn sorted_by_row(
    storage: Storage,
    rows: usize,
    blocks: impl Iterator<Item = (u32, u32)> + Clone,
) -> (Vec<usize>, Vec<u32>) {
    let is_stored = |row: u32, column: u32| column > row || storage == Storage::Whole && column < row;
    // One diagonal block per row.
    let mut start = vec![1; rows + 1];
    start[0] = 0;
    blocks.clone().for_each(|(row, column)| start[row as usize + 1] += usize::from(is_stored(row, column)));
    for row in 0..rows {
        start[row + 1] += start[row];
    }
    let (mut columns, mut next) = (vec![0; start[rows]], start.clone());
    let mut put = |row: u32, column: u32| {
        let position = &mut next[row as usize];
        columns[*position] = column;
        *position += 1;
    };
    (0..index(rows)).for_each(|row| put(row, row));
    blocks.filter(|&(row, column)| is_stored(row, column)).for_each(|(row, column)| put(row, column));
    (start, columns)
}

/// Converts an index to the 32 bits in which it is stored.
///
/// # Panics
/// If it does not fit.
#[must_use]
pub fn index(number: usize) -> u32 {
    u32::try_from(number).expect("fewer than 2³² vertices and blocks")
}
