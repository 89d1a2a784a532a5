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
    pub fn from_stencils<'a>(storage: Storage, rows: usize, stencils: impl IntoIterator<Item = &'a [u32]>) -> Self {
        let mut couplings: Vec<Vec<u32>> = (0..rows).map(|row| vec![index(row)]).collect();
        for stencil in stencils {
            for &row in stencil {
                let known = &mut couplings[row as usize];
                for &column in stencil.iter().filter(|&&column| storage == Storage::Whole || column > row) {
                    if !known.contains(&column) {
                        known.push(column);
                    }
                }
            }
        }
        let blocks = couplings.iter().map(Vec::len).sum();
        let (row_start, columns) = (Vec::with_capacity(rows + 1), Vec::with_capacity(blocks));
        let mut pattern = Self { storage, row_start, columns, diagonal: Vec::with_capacity(rows) };
        pattern.row_start.push(0);
        for (row, mut columns) in couplings.into_iter().enumerate() {
            columns.sort_unstable();
            let before = columns.partition_point(|&column| column < index(row));
            pattern.diagonal.push(index(pattern.columns.len() + before));
            pattern.columns.extend(columns);
            pattern.row_start.push(index(pattern.columns.len()));
        }
        pattern
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

/// A number as indices are stored, with 32 bits.
///
/// # Panics
/// When it has more.
#[must_use]
pub fn index(number: usize) -> u32 {
    u32::try_from(number).expect("fewer than 2³² vertices and blocks")
}
