use std::sync::Arc;

use energy_dsl::{Kernel, Level, Vector3, dispatch};

use crate::matrix::{BlockMatrix, Multiply};
use crate::pattern::{Pattern, index};
use crate::rounded_block::{Sums, Wide, add_times, narrow, room, store_columns, store_rows, total, widen};

/// A symmetric [`BlockMatrix`] rounded to single precision, with both triangles stored: multiplies several times as fast. Its relative
/// error of 6·10⁻⁸ does not matter to Newton's method, which solves each linear system to a tenth or a thousandth.
#[derive(Clone, Debug)]
pub struct RoundedMatrix {
    pattern: Arc<Pattern>,
    row_start: Vec<u32>,
    columns: Vec<u32>,
    /// Where each block comes from, and whether it is the mirror image.
    sources: Vec<(u32, bool)>,
    numbers: Vec<f32>,
}

impl RoundedMatrix {
    /// Prepares for matrices of a symmetric pattern.
    #[must_use]
    pub fn new(pattern: &Arc<Pattern>) -> Self {
        let mut rows: Vec<Vec<(u32, (u32, bool))>> = vec![Vec::new(); pattern.rows()];
        for row in 0..pattern.rows() {
            for (slot, column) in pattern.row(row) {
                rows[row].push((index(column), (index(slot), false)));
                if row != column && pattern.place(column, row) == Some((slot, true)) {
                    rows[column].push((index(row), (index(slot), true)));
                }
            }
        }
        let (mut row_start, mut columns, mut sources) = (vec![0], Vec::new(), Vec::new());
        for mut row in rows {
            row.sort_unstable();
            columns.extend(row.iter().map(|(column, _)| *column));
            sources.extend(row.iter().map(|(_, source)| *source));
            row_start.push(index(columns.len()));
        }
        let numbers = room(columns.len());
        Self { pattern: Arc::clone(pattern), row_start, columns, sources, numbers }
    }

    /// Takes over the entries of a matrix.
    ///
    /// # Panics
    /// When the matrix has another pattern.
    pub fn round(&mut self, matrix: &BlockMatrix) {
        assert!(Arc::ptr_eq(&self.pattern, matrix.pattern()), "the matrix has another pattern");
        let values = matrix.values();
        for (place, &(slot, mirrored)) in self.sources.iter().enumerate() {
            let store = if mirrored { store_rows } else { store_columns };
            store(&mut self.numbers, place, &values[slot as usize]);
        }
    }
}

impl Multiply for RoundedMatrix {
    fn multiply(&self, x: &[Vector3<f64>], y: &mut [Vector3<f64>]) {
        let mut wide = vec![[0.0; 4]; y.len()];
        dispatch(Product { matrix: self, x: &widen(x), y: &mut wide });
        narrow(&wide, y);
    }
}

/// y ← A x.
struct Product<'a> {
    matrix: &'a RoundedMatrix,
    x: &'a [Wide],
    y: &'a mut [Wide],
}

impl Kernel for Product<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Level>(self) {
        let RoundedMatrix { row_start, columns, numbers, .. } = self.matrix;
        for row in 0..self.y.len() {
            let mut sums = Sums::default();
            for place in row_start[row] as usize..row_start[row + 1] as usize {
                add_times::<L>(&mut sums, 1.0, numbers, place, &self.x[columns[place] as usize]);
            }
            self.y[row] = total(&sums);
        }
    }
}
