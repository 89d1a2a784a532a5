use std::collections::BTreeSet;
use std::sync::Arc;

use energy_dsl::{Block, Vector3};

use crate::vector::block_times;

/// Which 3×3 blocks of a square sparse matrix exist: by rows, columns ascending, the diagonal always there.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pattern {
    row_start: Vec<usize>,
    columns: Vec<usize>,
    diagonal: Vec<usize>,
}

impl Pattern {
    /// The pattern of `rows` block rows in which the rows of each stencil are all coupled.
    #[must_use]
    pub fn from_stencils(rows: usize, stencils: &[Vec<usize>]) -> Self {
        let mut neighbours: Vec<BTreeSet<usize>> = (0..rows).map(|row| BTreeSet::from([row])).collect();
        for stencil in stencils {
            for &row in stencil {
                neighbours[row].extend(stencil);
            }
        }
        let mut pattern = Self { row_start: vec![0], columns: Vec::new(), diagonal: Vec::new() };
        for (row, columns) in neighbours.iter().enumerate() {
            pattern.diagonal.push(pattern.columns.len() + columns.range(..row).count());
            pattern.columns.extend(columns);
            pattern.row_start.push(pattern.columns.len());
        }
        pattern
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

    /// Where block (row, column) is stored; `None` when it is not in the pattern.
    #[must_use]
    pub fn slot(&self, row: usize, column: usize) -> Option<usize> {
        let (start, end) = (self.row_start[row], self.row_start[row + 1]);
        self.columns[start..end].binary_search(&column).ok().map(|offset| start + offset)
    }
}

/// A square sparse matrix of 3×3 blocks. Both triangles are stored, so that it need not be symmetric.
#[derive(Clone, Debug)]
pub struct BlockMatrix {
    pattern: Arc<Pattern>,
    values: Vec<Block<f64>>,
}

impl BlockMatrix {
    /// The zero matrix of a pattern.
    #[must_use]
    pub fn zeros(pattern: Arc<Pattern>) -> Self {
        let values = vec![[[0.0; 3]; 3]; pattern.blocks()];
        Self { pattern, values }
    }

    /// Sets every entry to zero.
    pub fn clear(&mut self) {
        self.values.fill([[0.0; 3]; 3]);
    }

    /// The pattern.
    #[must_use]
    pub fn pattern(&self) -> &Arc<Pattern> {
        &self.pattern
    }

    /// The diagonal block of a row.
    #[must_use]
    pub fn diagonal(&self, row: usize) -> &Block<f64> {
        &self.values[self.pattern.diagonal[row]]
    }

    /// The diagonal block of a row, to be changed.
    pub fn diagonal_mut(&mut self, row: usize) -> &mut Block<f64> {
        &mut self.values[self.pattern.diagonal[row]]
    }

    /// A block; zero where the pattern has none.
    #[must_use]
    pub fn block(&self, row: usize, column: usize) -> Block<f64> {
        self.pattern.slot(row, column).map_or([[0.0; 3]; 3], |slot| self.values[slot])
    }

    /// The stored blocks in the order of [`Pattern::slot`].
    pub fn values_mut(&mut self) -> &mut [Block<f64>] {
        &mut self.values
    }

    /// Σ_j |a_ij| of every row i, by block rows: bounds on the eigenvalues (Gershgorin).
    #[must_use]
    pub fn absolute_row_sums(&self) -> Vec<Vector3<f64>> {
        let size = |row: &Vector3<f64>| row.iter().map(|entry| entry.abs()).sum::<f64>();
        let sum = |range: &[usize]| -> Vector3<f64> {
            std::array::from_fn(|axis| self.values[range[0]..range[1]].iter().map(|block| size(&block[axis])).sum())
        };
        self.pattern.row_start.windows(2).map(sum).collect()
    }

    /// y ← A x.
    pub fn multiply(&self, x: &[Vector3<f64>], y: &mut [Vector3<f64>]) {
        let Pattern { row_start, columns, .. } = &*self.pattern;
        for (row, sum) in y.iter_mut().enumerate() {
            *sum = [0.0; 3];
            for slot in row_start[row]..row_start[row + 1] {
                let part = block_times(&self.values[slot], &x[columns[slot]]);
                for axis in 0..3 {
                    sum[axis] += part[axis];
                }
            }
        }
    }
}
