//! Factorisation of small symmetric matrices.

/// P A Pᵀ = L D Lᵀ with the largest remaining diagonal entry as pivot. The signs of D are those of A's eigenvalues.
///
/// Pivots are single entries, so a matrix such as [0 1; 1 0] has no factors; definite and quasi-definite matrices
/// always do (Vanderbei, SIAM J. Optim. 5, 1995).
#[derive(Clone, Debug, Default)]
pub(crate) struct DenseFactor {
    /// L below the diagonal and D on it, row by row, in the order of elimination.
    entries: Vec<f64>,
    /// Row of A at each position.
    order: Vec<usize>,
}

/// No remaining diagonal entry is a pivot: all are zero or not finite.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct NoPivot;

impl DenseFactor {
    /// Factors an n×n matrix given row by row.
    pub(crate) fn new(mut a: Vec<f64>, n: usize) -> Result<Self, NoPivot> {
        let mut order: Vec<usize> = (0..n).collect();
        for k in 0..n {
            let largest = (k..n).max_by(|&i, &j| a[i * n + i].abs().total_cmp(&a[j * n + j].abs())).unwrap_or(k);
            exchange(&mut a, n, k, largest);
            order.swap(k, largest);
            let pivot = a[k * n + k];
            if pivot == 0.0 || !pivot.is_finite() {
                return Err(NoPivot);
            }
            for i in k + 1..n {
                let factor = a[i * n + k] / pivot;
                for j in k + 1..=i {
                    a[i * n + j] -= factor * a[j * n + k];
                }
            }
            for i in k + 1..n {
                a[i * n + k] /= pivot;
            }
        }
        Ok(Self { entries: a, order })
    }

    /// Returns the number of rows.
    fn rows(&self) -> usize {
        self.order.len()
    }

    /// Returns the number of negative eigenvalues.
    pub(crate) fn negative(&self) -> usize {
        let n = self.rows();
        (0..n).filter(|k| self.entries[k * n + k] < 0.0).count()
    }

    /// x ← A⁻¹ x.
    pub(crate) fn solve(&self, x: &mut [f64]) {
        let (n, a) = (self.rows(), &self.entries);
        let mut y: Vec<f64> = self.order.iter().map(|&row| x[row]).collect();
        for i in 0..n {
            y[i] -= (0..i).map(|j| a[i * n + j] * y[j]).sum::<f64>();
        }
        for i in (0..n).rev() {
            y[i] = y[i] / a[i * n + i] - (i + 1..n).map(|j| a[j * n + i] * y[j]).sum::<f64>();
        }
        self.order.iter().zip(y).for_each(|(&row, y)| x[row] = y);
    }
}

/// Exchanges two rows and columns of the lower triangle, k ≤ l, with L left of column k.
fn exchange(a: &mut [f64], n: usize, k: usize, l: usize) {
    if k == l {
        return;
    }
    (0..k).for_each(|j| a.swap(k * n + j, l * n + j));
    (k + 1..l).for_each(|j| a.swap(j * n + k, l * n + j));
    (l + 1..n).for_each(|i| a.swap(i * n + k, i * n + l));
    a.swap(k * n + k, l * n + l);
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn solutions_and_signs_are_those_of_a_dense_matrix(
            n in 1..7_usize,
            entries in prop::collection::vec(-1.0..1.0, 49),
            negative in 0..7_usize,
        ) {
            // Quasi-definite: the first rows have a negative, the others a positive diagonal that dominates.
            let sign = |i: usize| if i < negative { -8.0 } else { 8.0 };
            let entry = |i: usize, j: usize| entries[7 * i.min(j) + i.max(j)] + if i == j { sign(i) } else { 0.0 };
            let dense = DMatrix::from_fn(n, n, entry);
            let factor = DenseFactor::new(dense.transpose().as_slice().to_vec(), n).unwrap();
            prop_assert_eq!(factor.negative(), negative.min(n));
            let expected = DVector::from_fn(n, |i, _| i as f64 + 0.5);
            let mut x = (&dense * &expected).as_slice().to_vec();
            factor.solve(&mut x);
            for (x, expected) in x.iter().zip(&expected) {
                prop_assert!((x - expected).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn a_pivot_of_zero_is_refused() {
        assert_eq!(DenseFactor::new(vec![0.0, 1.0, 1.0, 0.0], 2).unwrap_err(), NoPivot);
    }
}
