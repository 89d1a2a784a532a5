/// Returns the eigenvalues of a symmetric n×n matrix by Jacobi rotations. NaN entries give NaN eigenvalues.
pub(crate) fn eigenvalues(n: usize, matrix: &[f64]) -> Vec<f64> {
    let mut a = matrix.to_vec();
    let largest = a.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    // Convergence is quadratic: a dozen sweeps leave only rounding errors.
    for _ in 0..30 {
        let off = (0..n).flat_map(|i| (0..i).map(move |j| (i, j))).map(|(i, j)| a[i * n + j].abs()).fold(0.0, f64::max);
        if off <= f64::EPSILON * 1e-3 * largest {
            break;
        }
        for p in 0..n {
            for q in p + 1..n {
                rotate(&mut a, n, p, q);
            }
        }
    }
    (0..n).map(|i| a[i * n + i]).collect()
}

/// Rotates so that entry (p, q) becomes zero.
fn rotate(a: &mut [f64], n: usize, p: usize, q: usize) {
    let off = a[p * n + q];
    if off == 0.0 {
        return;
    }
    let tau = (a[q * n + q] - a[p * n + p]) / (2.0 * off);
    let t = tau.signum() / (tau.abs() + tau.hypot(1.0));
    let c = 1.0 / t.hypot(1.0);
    let s = t * c;
    for k in 0..n {
        let (x, y) = (a[k * n + p], a[k * n + q]);
        (a[k * n + p], a[k * n + q]) = (c * x - s * y, s * x + c * y);
    }
    for k in 0..n {
        let (x, y) = (a[p * n + k], a[q * n + k]);
        (a[p * n + k], a[q * n + k]) = (c * x - s * y, s * x + c * y);
    }
}

#[cfg(test)]
mod tests {
    use super::eigenvalues;

    #[test]
    fn known_eigenvalues() {
        // [[2, 1, 0], [1, 2, 1], [0, 1, 2]] has the eigenvalues 2 and 2 ± √2.
        let mut values = eigenvalues(3, &[2.0, 1.0, 0.0, 1.0, 2.0, 1.0, 0.0, 1.0, 2.0]);
        values.sort_by(f64::total_cmp);
        for (got, want) in values.iter().zip([2.0 - 2.0_f64.sqrt(), 2.0, 2.0 + 2.0_f64.sqrt()]) {
            assert!((got - want).abs() < 1e-14, "{values:?}");
        }
        assert_eq!(eigenvalues(2, &[0.0; 4]), [0.0, 0.0]);
    }
}
