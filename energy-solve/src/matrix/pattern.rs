/// Which blocks of a matrix are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Storage {
    /// All of them.
    Whole,
    /// Of a symmetric matrix, those on the diagonal and above.
    Upper,
}

/// Which 3×3 blocks of a square sparse matrix exist: by rows, columns ascending, the diagonal always there.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pattern {
    storage: Storage,
    row_start: Vec<u32>,
    columns: Vec<u32>,
    diagonal: Vec<u32>,
}

impl Pattern {
    /// The pattern of `rows` block rows in which the rows of each stencil are all coupled.
    ///
    /// # Panics
    /// When a stencil names a row there is not, or there are more than 2³² blocks.
    #[must_use]
    pub fn from_stencils<'a, S>(storage: Storage, rows: usize, stencils: S) -> Self
    where
        S: IntoIterator<Item = &'a [u32], IntoIter: Clone>,
    {
        let pairs =
            |stencil: &'a [u32]| stencil.iter().flat_map(|&row| stencil.iter().map(move |&column| (row, column)));
        Self::from_pairs(storage, rows, stencils.into_iter().flat_map(pairs))
    }

    /// The pattern of `rows` block rows with these blocks, of which those that are not stored are left out.
    pub(crate) fn from_pairs(storage: Storage, rows: usize, blocks: impl Iterator<Item = (u32, u32)> + Clone) -> Self {
        let (start, mut columns) = sorted_by_row(storage, rows, blocks);
        let (mut row_start, mut diagonal, mut end) = (Vec::with_capacity(rows + 1), Vec::with_capacity(rows), 0);
        row_start.push(0);
        for row in 0..rows {
            let named = start[row]..start[row + 1];
            columns[named.clone()].sort_unstable();
            for place in named {
                let column = columns[place];
                // Each once.
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

    /// Which blocks are stored.
    #[must_use]
    pub fn storage(&self) -> Storage {
        self.storage
    }

    /// The number of block rows.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.diagonal.len()
    }

    /// The number of stored blocks.
    #[must_use]
    pub fn blocks(&self) -> usize {
        self.columns.len()
    }

    /// Where block (row, column) is stored, and whether as its mirror image; `None` when it is not in the pattern.
    #[must_use]
    pub fn place(&self, row: usize, column: usize) -> Option<(usize, bool)> {
        let flipped = self.storage == Storage::Upper && column < row;
        let (row, column) = if flipped { (column, row) } else { (row, column) };
        let (start, end) = (self.row_start[row] as usize, self.row_start[row + 1] as usize);
        self.columns[start..end].binary_search(&index(column)).ok().map(|offset| (start + offset, flipped))
    }

    /// Whether eliminating row after row couples rows that are not coupled here. A chain in order does not fill in, a sheet does.
    #[must_use]
    pub fn fills_in(&self) -> bool {
        let coupled = |i: usize, j: usize| i == j || self.place(i, j).is_some();
        let later = |row: usize| self.row(row).map(|(_, column)| column).filter(move |&column| column > row);
        (0..self.rows()).any(|row| later(row).any(|i| later(row).any(|j| i < j && !coupled(i, j))))
    }

    /// The place of blocks that are not part of the matrix, those of pinned vertices: after all others.
    #[must_use]
    pub fn nowhere(&self) -> usize {
        self.blocks()
    }

    /// Where the diagonal block of a row is stored.
    #[must_use]
    #[inline]
    pub fn diagonal(&self, row: usize) -> usize {
        self.diagonal[row] as usize
    }

    /// Where the diagonal blocks of all rows are stored.
    #[inline(always)]
    pub(crate) fn diagonals(&self) -> &[u32] {
        &self.diagonal
    }

    /// The places of the blocks above the diagonal in a row, for a pattern of upper triangles.
    #[inline(always)]
    pub(crate) fn above(&self, row: usize) -> std::ops::Range<usize> {
        self.diagonal[row] as usize + 1..self.row_start[row + 1] as usize
    }

    /// Where the blocks of a row begin, or, of the row after the last, where they all end.
    pub(crate) fn first_in(&self, row: usize) -> usize {
        self.row_start[row] as usize
    }

    /// The columns of all blocks, by place.
    #[inline(always)]
    pub(crate) fn columns(&self) -> &[u32] {
        &self.columns
    }

    /// The places and columns of a row's blocks.
    #[inline]
    pub fn row(&self, row: usize) -> impl ExactSizeIterator<Item = (usize, usize)> {
        let (start, end) = (self.row_start[row] as usize, self.row_start[row + 1] as usize);
        let columns = &self.columns[start..end];
        columns.iter().enumerate().map(move |(offset, &column)| (start + offset, column as usize))
    }
}

/// The columns of the blocks that are stored, and those on the diagonal, one row after the other, and where each row begins.
fn sorted_by_row(
    storage: Storage,
    rows: usize,
    blocks: impl Iterator<Item = (u32, u32)> + Clone,
) -> (Vec<usize>, Vec<u32>) {
    let is_stored = |row: u32, column: u32| column > row || storage == Storage::Whole && column < row;
    // One on the diagonal of each.
    let mut start = vec![1; rows + 1];
    start[0] = 0;
    blocks.clone().for_each(|(row, column)| start[row as usize + 1] += usize::from(is_stored(row, column)));
    for row in 0..rows {
        start[row + 1] += start[row];
    }
    let (mut columns, mut next) = (vec![0; start[rows]], start.clone());
    let mut put = |row: u32, column: u32| {
        let place = &mut next[row as usize];
        columns[*place] = column;
        *place += 1;
    };
    (0..index(rows)).for_each(|row| put(row, row));
    blocks.filter(|&(row, column)| is_stored(row, column)).for_each(|(row, column)| put(row, column));
    (start, columns)
}

/// A number as indices are stored, with 32 bits.
///
/// # Panics
/// When it has more.
#[must_use]
pub fn index(number: usize) -> u32 {
    u32::try_from(number).expect("fewer than 2³² vertices and blocks")
}
