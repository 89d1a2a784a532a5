//! Assembled matrices in the formats of other libraries: triplets, compressed rows of numbers and of 3×3 blocks.

use energy_dsl::Block;

use super::block_matrix::BlockMatrix;
use super::pattern::Storage;
use super::precision::Precision;
use super::vector::transposed;

/// A square sparse matrix by compressed rows (CSR). Columns ascend within a row.
///
/// The fields are what other libraries take, without a copy for their views:
///
/// | library | matrix |
/// |---|---|
/// | nalgebra-sparse | `CsrMatrix::try_from_csr_data(n, n, csr.offsets, csr.columns, csr.values)` |
/// | sprs | `CsMatView::new((n, n), &csr.offsets, &csr.columns, &csr.values)` |
/// | faer | `SparseRowMatRef::new(pattern, &csr.values)` |
///
/// with `n = csr.rows()`, and for faer `pattern = SymbolicSparseRowMatRef::new_checked(n, n, &csr.offsets, None,
/// &csr.columns)`. Matrices of one [`Pattern`](crate::Pattern) have the same `offsets` and `columns`, so a
/// symbolic factorisation stays valid from step to step. Compressed rows of a symmetric matrix are its compressed
/// columns, too.
#[derive(Clone, Debug, PartialEq)]
pub struct Csr<T = f64> {
    /// Index of the first entry of each row, and the number of entries: one more than there are rows.
    pub offsets: Vec<usize>,
    /// Column of each entry.
    pub columns: Vec<usize>,
    /// Value of each entry, next to its column.
    pub values: Vec<T>,
}

impl<T> Csr<T> {
    /// Returns the number of rows: three per free vertex.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.offsets.len() - 1
    }
}

/// A square sparse matrix by compressed rows of 3×3 blocks (BSR), one row per free vertex. Columns ascend within a row.
#[derive(Clone, Debug, PartialEq)]
pub struct Bsr<T = f64> {
    /// Index of the first block of each block row, and the number of blocks: one more than there are block rows.
    pub offsets: Vec<usize>,
    /// Block column of each block.
    pub columns: Vec<usize>,
    /// Each block, row by row. `as_flattened().as_flattened()` is one slice of numbers.
    pub blocks: Vec<Block<T>>,
}

impl<T> Bsr<T> {
    /// Returns the number of block rows: one per free vertex.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.offsets.len() - 1
    }

    /// Calls `visit` with row, column and value of each number of `part`, by ascending rows and columns.
    fn for_each_number(&self, part: Storage, mut visit: impl FnMut(usize, usize, &T)) {
        for row in 0..3 * self.rows() {
            for slot in self.offsets[row / 3]..self.offsets[row / 3 + 1] {
                for (axis, value) in self.blocks[slot][row % 3].iter().enumerate() {
                    let column = 3 * self.columns[slot] + axis;
                    if part == Storage::Whole || row <= column {
                        visit(row, column, value);
                    }
                }
            }
        }
    }
}

impl<T: Precision> BlockMatrix<T> {
    /// Returns row, column and value of each number: of the whole matrix, or of its part on and above the diagonal.
    /// Zeros within a stored block are included. Rows ascend, and columns within a row.
    #[must_use]
    pub fn to_triplets(&self, part: Storage) -> Vec<(usize, usize, T)> {
        let mut triplets = Vec::new();
        self.to_bsr(part).for_each_number(part, |row, column, &value| triplets.push((row, column, value)));
        triplets
    }

    /// Returns compressed rows of the whole matrix, or of its part on and above the diagonal.
    ///
    /// ```
    /// use energy_solve::{BlockMatrix, Pattern, Storage};
    ///
    /// // Two vertices joined by a spring of 3 N/m along x.
    /// let mut matrix = BlockMatrix::zeros(Pattern::from_stencils(Storage::Upper, 2, [&[0, 1][..]]).into());
    /// for (i, j, stiffness) in [(0, 0, 3.0), (0, 1, -3.0), (1, 1, 3.0)] {
    ///     let (slot, _) = matrix.pattern().slot(i, j).expect("coupled");
    ///     matrix.values_mut()[slot][0][0] = stiffness;
    /// }
    /// let csr = matrix.to_csr(Storage::Whole);
    /// assert_eq!((csr.rows(), csr.values.len()), (6, 36));
    /// // Row 3 is the x component of the second vertex; the stored part is above the diagonal.
    /// let row = csr.offsets[3]..csr.offsets[4];
    /// assert_eq!(csr.columns[row.clone()], [0, 1, 2, 3, 4, 5]);
    /// assert_eq!(csr.values[row], [-3.0, 0.0, 0.0, 3.0, 0.0, 0.0]);
    /// ```
    #[must_use]
    pub fn to_csr(&self, part: Storage) -> Csr<T> {
        let bsr = self.to_bsr(part);
        let mut csr = Csr { offsets: vec![0; 3 * bsr.rows() + 1], columns: Vec::new(), values: Vec::new() };
        bsr.for_each_number(part, |row, column, &value| {
            csr.columns.push(column);
            csr.values.push(value);
            csr.offsets[row + 1] += 1;
        });
        for row in 0..csr.rows() {
            csr.offsets[row + 1] += csr.offsets[row];
        }
        csr
    }

    /// Returns compressed rows of blocks of the whole matrix, or of its part on and above the diagonal; there, diagonal
    /// blocks are whole.
    #[must_use]
    pub fn to_bsr(&self, part: Storage) -> Bsr<T> {
        let (pattern, values) = (self.pattern(), self.values());
        let mirrored = pattern.storage() == Storage::Upper && part == Storage::Whole;
        let wanted = |row: usize, column: usize| part == Storage::Whole || row <= column;
        let mut offsets = vec![0; pattern.rows() + 1];
        for row in 0..pattern.rows() {
            for (_, column) in pattern.row(row).filter(|&(_, column)| wanted(row, column)) {
                offsets[row + 1] += 1;
                if mirrored && column != row {
                    offsets[column + 1] += 1;
                }
            }
        }
        for row in 0..pattern.rows() {
            offsets[row + 1] += offsets[row];
        }
        let blocks = offsets[pattern.rows()];
        let (mut columns, mut numbers) = (vec![0; blocks], vec![[[T::from_f64(0.0); 3]; 3]; blocks]);
        // The mirrored blocks of a row come from earlier rows, and so before its own: columns ascend.
        let mut next = offsets.clone();
        let mut put = |row: usize, column: usize, block: Block<T>| {
            columns[next[row]] = column;
            numbers[next[row]] = block;
            next[row] += 1;
        };
        for row in 0..pattern.rows() {
            for (slot, column) in pattern.row(row).filter(|&(_, column)| wanted(row, column)) {
                put(row, column, values[slot]);
                if mirrored && column != row {
                    put(column, row, transposed(&values[slot]));
                }
            }
        }
        Bsr { offsets, columns, blocks: numbers }
    }
}
