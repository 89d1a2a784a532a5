use std::ops::Range;

use energy_dsl::{Block, Lane, Level, Mask, Vector3};

use super::Wide;
use crate::matrix::block_matrix::BlockMatrix;
use crate::matrix::precision::{Precision, doubled};

/// C⁻¹ by columns, each padded with a zero, where C is lower triangular and C Cᵀ is a diagonal block or a multiple of
/// it.
pub(crate) type InverseFactor<T> = [Wide<T>; 3];

/// Converts C⁻¹ to another precision.
#[inline(always)]
pub(crate) fn rounded<T: Precision, M: Precision>(inverse: &InverseFactor<T>) -> [Wide<M>; 3] {
    let mut rounded = [[M::from_f64(0.0); 4]; 3];
    for column in 0..3 {
        for lane in 0..4 {
            rounded[column][lane] = M::from_f64(inverse[column][lane].into());
        }
    }
    rounded
}

/// Returns C⁻¹ b.
#[inline(always)]
pub(crate) fn scaled<T: Precision>(inverse: &InverseFactor<T>, [u, v, w]: &Vector3<f64>) -> Vector3<f64> {
    let [[a, d, f, _], [_, e, g, _], [_, _, h, _]] = rounded::<T, f64>(inverse);
    [a * u, d * u + e * v, f * u + g * v + h * w]
}

/// Returns C⁻ᵀ x.
#[inline(always)]
pub(crate) fn unscaled<T: Precision>(inverse: &InverseFactor<T>, [u, v, w]: &Vector3<f64>) -> Vector3<f64> {
    let [[a, b, d, _], [_, c, e, _], [_, _, f, _]] = rounded::<T, f64>(inverse);
    [a * u + b * v + d * w, c * v + e * w, f * w]
}

/// Returns C⁻¹ of a block C Cᵀ; `None` if the block is not positive definite.
pub(crate) fn inverse_factor([[a, ..], [b, c, _], [d, e, f]]: &Block<f64>) -> Option<InverseFactor<f64>> {
    let (inverse, definite) = inverse_factors([*a, *b, *c, *d, *e, *f], 1.0);
    definite.then(|| by_columns(inverse))
}

/// The largest number of lanes of any SIMD level.
const LANES: usize = 16;

/// Computes C⁻¹ of some rows, with C Cᵀ = D/ω. Fails with the first row whose diagonal block is not positive definite.
#[inline(always)]
pub(crate) fn invert<T: Precision, M: Precision, L: Level>(
    matrix: &BlockMatrix<M>,
    rows: Range<usize>,
    relaxation: f64,
    inverses: &mut [InverseFactor<T>],
) -> Result<(), usize> {
    let lanes = <L::F64 as Lane<f64>>::LANES;
    for (row, inverses) in rows.step_by(lanes).zip(inverses.chunks_mut(lanes)) {
        // Unused lanes hold unit matrices.
        let mut numbers = [[1.0; LANES], [0.0; LANES], [1.0; LANES], [0.0; LANES], [0.0; LANES], [1.0; LANES]];
        for lane in 0..inverses.len() {
            let [[a, ..], [b, c, _], [d, e, f]] = doubled(matrix.diagonal(row + lane));
            for (entry, number) in [a, b, c, d, e, f].into_iter().enumerate() {
                numbers[entry][lane] = number;
            }
        }
        let mut triangle = [L::F64::splat(0.0); 6];
        for entry in 0..6 {
            triangle[entry] = L::F64::load(&numbers[entry]);
        }
        let (triangle, definite) = inverse_factors(triangle, relaxation);
        if !definite.all() {
            return Err(row + (0..lanes).find(|&lane| !definite.lane(lane)).unwrap_or(0));
        }
        for entry in 0..6 {
            triangle[entry].store(&mut numbers[entry]);
        }
        for lane in 0..inverses.len() {
            let mut rows = [0.0; 6];
            for entry in 0..6 {
                rows[entry] = numbers[entry][lane];
            }
            inverses[lane] = by_columns(rows);
        }
    }
    Ok(())
}

/// Converts the rows of a lower triangle to padded columns.
#[inline(always)]
fn by_columns<T: Precision>(rows: [f64; 6]) -> InverseFactor<T> {
    let ([a, b, c, d, e, f], zero) = (rows.map(T::from_f64), T::from_f64(0.0));
    [[a, b, d, zero], [zero, c, e, zero], [zero, zero, f, zero]]
}

/// Returns C⁻¹ with C Cᵀ = D/ω, and a mask of the lanes where D is positive definite. Triangles are given by rows. C
/// has the diagonal 1/x, 1/y, 1/z and the entries p, q, r below it.
#[inline(always)]
fn inverse_factors<V: Lane<f64>>([a, b, c, d, e, f]: [V; 6], relaxation: f64) -> ([V; 6], V::Mask) {
    let (one, unit) = (V::splat(1.0), V::splat(1.0 / relaxation));
    let [a, b, c, d, e, f] = [a * unit, b * unit, c * unit, d * unit, e * unit, f * unit];
    // A negative pivot has no square root, a zero pivot no reciprocal.
    let x = one / a.sqrt();
    let (p, q) = (b * x, d * x);
    let y = one / (c - p * p).sqrt();
    let r = (e - q * p) * y;
    let z = one / (f - q * q - r * r).sqrt();
    let below = -(p * x) * y;
    let last = -(r * y) * z;
    let corner = -(q * x + r * below) * z;
    let largest = V::splat(f64::MAX);
    let zero = V::splat(0.0);
    let mut definite = zero.less(x) & zero.less(y) & zero.less(z);
    for number in [x, y, z, corner] {
        definite = definite & number.abs().less_or_equal(largest);
    }
    ([x, below, y, corner, last, z], definite)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use energy_dsl::{Kernel, dispatch};

    use super::*;
    use crate::matrix::pattern::{Pattern, Storage};

    const RELAXATION: f64 = 1.6;

    struct Inversion<'a>(&'a BlockMatrix<f64>, &'a mut [InverseFactor<f64>]);

    impl Kernel for Inversion<'_> {
        type Output = Result<(), usize>;

        fn run<L: Level>(self) -> Self::Output {
            invert::<f64, f64, L>(self.0, 0..11, RELAXATION, self.1)
        }
    }
    /// 11 rows: full registers and a remainder.
    fn matrix() -> BlockMatrix<f64> {
        let mut matrix = BlockMatrix::zeros(Arc::new(Pattern::from_stencils(Storage::Upper, 11, [])));
        for row in 0..11 {
            let s = row as f64;
            *matrix.diagonal_mut(row) = [[4.0 + s, 1.0, -0.5 * s], [1.0, 3.0, 0.25], [-0.5 * s, 0.25, 9.0 + s]];
        }
        matrix
    }

    fn inverted(matrix: &BlockMatrix<f64>) -> Result<Vec<InverseFactor<f64>>, usize> {
        let mut inverses = vec![[[0.0; 4]; 3]; 11];
        dispatch(Inversion(matrix, &mut inverses))?;
        Ok(inverses)
    }

    #[test]
    fn the_scaled_diagonal_is_the_relaxation_factor() {
        let matrix = matrix();
        for (row, inverse) in inverted(&matrix).unwrap().iter().enumerate() {
            let block = matrix.diagonal(row);
            // C⁻¹ D, then its rows times C⁻ᵀ.
            let columns: Vec<_> = (0..3).map(|j| scaled(inverse, &[block[0][j], block[1][j], block[2][j]])).collect();
            for i in 0..3 {
                let unit = scaled(inverse, &[columns[0][i], columns[1][i], columns[2][i]]);
                for j in 0..3 {
                    let expected = if i == j { RELAXATION } else { 0.0 };
                    assert!((unit[j] - expected).abs() < 1e-14, "row {row}: {i}, {j}: {}", unit[j]);
                }
            }
        }
    }

    #[test]
    fn the_first_indefinite_row_is_named() {
        for (row, entry) in [(2, -1.0), (9, 0.0), (10, f64::NAN), (4, f64::INFINITY)] {
            let mut matrix = matrix();
            matrix.diagonal_mut(row)[1][1] = entry;
            assert_eq!(inverted(&matrix), Err(row), "{entry}");
        }
    }
}
