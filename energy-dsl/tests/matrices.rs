//! Rows and entries of matrices; determinant, inverse and adjugate of 4×4 matrices.

use energy_dsl::{Residual, energy};

energy! {
    residual Entries(u: Scalar; M: Mat2x3, N: Mat4x4) {
        let T = transpose(M);
        [u * M[0], u * M[1], u * T[2], u * M[1][2], u * N[3][1], u * (M * vector(1, 2, 3))[1], u * (N * N)[2][0]]
    }
    residual Inverse(M: Mat4x4) {
        let B = inverse(M);
        let P = M * B - identity(4);
        let Q = adjugate(M) * M - det(M) * identity(4);
        [P[0], P[1], P[2], P[3], Q[0], Q[1], Q[2], Q[3], det(M)]
    }
    residual Four(a, b, c, d: Vec4) { det(columns(a, b, c, d)) }
}

#[test]
fn a_matrix_has_rows_and_entries() {
    let m = [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]];
    let n: [[f64; 4]; 4] = std::array::from_fn(|i| std::array::from_fn(|j| (4 * i + j) as f64));
    let at = Entries::new(m, n).jacobian(&[2.0]);
    let square: f64 = (0..4).map(|k| n[2][k] * n[k][0]).sum();
    let expected = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 3.0, 6.0, 6.0, 13.0, 32.0, square];
    assert_eq!(at.jacobian, expected);
    assert_eq!(at.value, expected.map(|entry| 2.0 * entry));
}

/// The determinant by its definition, as a sum over permutations.
fn determinant(m: &[[f64; 4]; 4]) -> f64 {
    let mut sum = 0.0;
    for code in 0..256_usize {
        let p = [code & 3, code >> 2 & 3, code >> 4 & 3, code >> 6];
        let inversions = (0..4).flat_map(|i| (i + 1..4).map(move |j| (i, j)));
        if inversions.clone().all(|(i, j)| p[i] != p[j]) {
            let odd = inversions.filter(|&(i, j)| p[i] > p[j]).count() % 2 == 1;
            let product: f64 = (0..4).map(|row| m[row][p[row]]).product();
            sum += if odd { -product } else { product };
        }
    }
    sum
}

#[test]
fn the_inverse_of_a_large_matrix_is_its_inverse() {
    let m: [[f64; 4]; 4] =
        std::array::from_fn(|i| std::array::from_fn(|j| ((7 * i * i + 5 * j + 3 * i * j) % 11) as f64 - 4.0));
    let at = Inverse::new().residual(m.as_flattened().try_into().expect("16 numbers"));
    let expected = determinant(&m);
    assert!(expected != 0.0);
    let (identities, found) = at.value.split_at(32);
    assert_eq!(found, [expected]);
    assert!(identities.iter().all(|entry| entry.abs() < 1e-12), "{identities:?}");
    let columns: Vec<f64> = (0..16).map(|k| m[k % 4][k / 4]).collect();
    let at = Four::new().jacobian(&columns.try_into().expect("16 numbers"));
    assert_eq!(at.value, [expected]);
    // Each derivative of a determinant is a cofactor: the determinant with a unit vector as this column.
    for k in 0..16 {
        let mut unit = m;
        (0..4).for_each(|row| unit[row][k / 4] = f64::from(u8::from(row == k % 4)));
        assert_eq!(at.jacobian[k], determinant(&unit), "{k}");
    }
}
