use energy_dsl::Vector3;
use energy_solve::BlockMatrix;

/// A banded Cholesky factor.
#[derive(Clone, Debug)]
pub(super) struct Banded {
    /// Position of each block row in the ordering.
    place: Vec<usize>,
    /// Entries in a row of the band, the diagonal last.
    width: usize,
    rows: Vec<f64>,
}

impl Banded {
    /// Factors A + σ diag(weights) = L Lᵀ; `None` if the sum is not positive definite. In the given order, rows couple
    /// to nearby rows only.
    pub fn factor(matrix: &BlockMatrix, order: &[usize], weights: &[f64], shift: f64) -> Option<Self> {
        let mut place = vec![0; order.len()];
        order.iter().enumerate().for_each(|(at, &row)| place[row] = at);
        let pattern = matrix.pattern();
        let rows = 0..pattern.rows();
        let reach = rows
            .clone()
            .flat_map(|row| pattern.row(row).map(move |(_, column)| (row, column)))
            .map(|(row, column)| place[row].abs_diff(place[column]))
            .max()
            .unwrap_or(0);
        let width = 3 * reach + 3;
        let mut band = Self { rows: vec![0.0; 3 * place.len() * width], place, width };
        for row in rows {
            for (slot, column) in pattern.row(row) {
                let block = &matrix.values()[slot];
                for i in 0..3 {
                    for j in 0..3 {
                        let (a, b) = (3 * band.place[row] + i, 3 * band.place[column] + j);
                        if row != column || a >= b {
                            *band.entry(a.max(b), a.min(b)) = block[i][j];
                        }
                    }
                }
            }
            for i in 0..3 {
                let at = 3 * band.place[row] + i;
                *band.entry(at, at) += shift * weights[row];
            }
        }
        band.eliminate().then_some(band)
    }

    fn entry(&mut self, row: usize, column: usize) -> &mut f64 {
        &mut self.rows[row * self.width + self.width - 1 - (row - column)]
    }

    /// Eliminates row by row: l_ij = (a_ij − Σ l_ik l_jk)/l_jj. Returns `false` if a pivot is not positive.
    fn eliminate(&mut self) -> bool {
        let (width, n) = (self.width, self.rows.len() / self.width);
        for i in 0..n {
            let first = (i + 1).saturating_sub(width);
            let (above, here) = self.rows.split_at_mut(i * width);
            let here = &mut here[..width];
            // Column j of row r is stored at j − (r + 1 − width).
            let at = |row: usize, column: usize| column + width - 1 - row;
            for j in first..i {
                let other = &above[j * width..][..width];
                let start = first.max((j + 1).saturating_sub(width));
                let (a, b) = (&here[at(i, start)..at(i, j)], &other[at(j, start)..at(j, j)]);
                let sum: f64 = a.iter().zip(b).map(|(a, b)| a * b).sum();
                here[at(i, j)] = (here[at(i, j)] - sum) / other[width - 1];
            }
            let square: f64 = here[..width - 1].iter().map(|l| l * l).sum();
            let pivot = here[width - 1] - square;
            // A pivot below this is rounding error.
            if pivot.is_nan() || pivot <= 1e-15 * here[width - 1].abs() {
                return false;
            }
            here[width - 1] = pivot.sqrt();
        }
        true
    }

    /// Returns A⁻¹ b.
    pub fn solve(&self, b: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
        let (width, n) = (self.width, self.rows.len() / self.width);
        let mut y = vec![0.0; n];
        for (row, vector) in b.iter().enumerate() {
            y[3 * self.place[row]..][..3].copy_from_slice(vector);
        }
        for i in 0..n {
            let first = (i + 1).saturating_sub(width);
            let row = &self.rows[i * width + width - 1 - (i - first)..][..i - first];
            let sum: f64 = row.iter().zip(&y[first..i]).map(|(l, y)| l * y).sum();
            y[i] = (y[i] - sum) / self.rows[i * width + width - 1];
        }
        for i in (0..n).rev() {
            y[i] /= self.rows[i * width + width - 1];
            let first = (i + 1).saturating_sub(width);
            let row = &self.rows[i * width + width - 1 - (i - first)..][..i - first];
            let value = y[i];
            row.iter().zip(&mut y[first..i]).for_each(|(l, y)| *y -= l * value);
        }
        let back = |row: usize| std::array::from_fn(|axis| y[3 * self.place[row] + axis]);
        (0..b.len()).map(back).collect()
    }
}
