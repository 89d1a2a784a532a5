use std::ops::Range;

use energy_dsl::{Kernel, Lane, Level, Mask, Vector3};

use super::RELAXATION;
use super::domain::Wide;
use crate::matrix::BlockMatrix;
use crate::precision::{Precision, doubled};

/// C⁻¹ column by column, each with a fourth component that is zero; C Cᵀ = D/ω, C lower triangular.
pub(super) type Inverse = [Wide<f64>; 3];

/// C⁻¹ b.
#[inline(always)]
pub(super) fn scaled(inverse: &Inverse, [u, v, w]: &Vector3<f64>) -> Vector3<f64> {
    let [[a, d, f, _], [_, e, g, _], [_, _, h, _]] = inverse;
    [a * u, d * u + e * v, f * u + g * v + h * w]
}

/// C⁻¹ of some rows. Fails with the row whose diagonal block is not positive definite.
pub(super) struct Inversion<'a, M> {
    pub(super) rows: Range<usize>,
    pub(super) inverses: &'a mut [Inverse],
    pub(super) matrix: &'a BlockMatrix<M>,
}

/// Most lanes there are.
const LANES: usize = 16;

impl<M: Precision> Kernel for Inversion<'_, M> {
    type Output = Result<(), usize>;

    #[inline(always)]
    fn run<L: Level>(self) -> Self::Output {
        let Self { rows, inverses, matrix } = self;
        let lanes = <L::F64 as Lane<f64>>::LANES;
        for (row, inverses) in rows.step_by(lanes).zip(inverses.chunks_mut(lanes)) {
            // Lanes left over hold unit matrices.
            let mut numbers = [[1.0; LANES], [0.0; LANES], [1.0; LANES], [0.0; LANES], [0.0; LANES], [1.0; LANES]];
            for lane in 0..inverses.len() {
                let [[a, ..], [b, c, _], [d, e, f]] = doubled(matrix.diagonal(row + lane));
                for (place, number) in [a, b, c, d, e, f].into_iter().enumerate() {
                    numbers[place][lane] = number;
                }
            }
            let mut triangle = [L::F64::splat(0.0); 6];
            for place in 0..6 {
                triangle[place] = L::F64::load(&numbers[place]);
            }
            let (triangle, definite) = inverse_factors(triangle);
            if !definite.all() {
                return Err(row + (0..lanes).find(|&lane| !definite.lane(lane)).unwrap_or(0));
            }
            for place in 0..6 {
                triangle[place].store(&mut numbers[place]);
            }
            for lane in 0..inverses.len() {
                let [a, b, c, d, e, f] = numbers;
                inverses[lane] =
                    [[a[lane], b[lane], d[lane], 0.0], [0.0, c[lane], e[lane], 0.0], [0.0, 0.0, f[lane], 0.0]];
            }
        }
        Ok(())
    }
}

/// C⁻¹ of D, both by the rows of their lower triangles, and where D is positive definite. C has the diagonal 1/x, 1/y, 1/z, and p, q, r below it.
#[inline(always)]
fn inverse_factors<V: Lane<f64>>([a, b, c, d, e, f]: [V; 6]) -> ([V; 6], V::Mask) {
    let (one, unit) = (V::splat(1.0), V::splat(1.0 / RELAXATION));
    let [a, b, c, d, e, f] = [a * unit, b * unit, c * unit, d * unit, e * unit, f * unit];
    // A negative pivot has no root, a vanishing one no reciprocal.
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

    use energy_dsl::dispatch;

    use super::*;
    use crate::pattern::{Pattern, Storage};

    /// 11 rows: full registers and some left over.
    fn matrix() -> BlockMatrix<f64> {
        let mut matrix = BlockMatrix::zeros(Arc::new(Pattern::from_stencils(Storage::Upper, 11, [])));
        for row in 0..11 {
            let s = row as f64;
            *matrix.diagonal_mut(row) = [[4.0 + s, 1.0, -0.5 * s], [1.0, 3.0, 0.25], [-0.5 * s, 0.25, 9.0 + s]];
        }
        matrix
    }

    fn inverted(matrix: &BlockMatrix<f64>) -> Result<Vec<Inverse>, usize> {
        let mut inverses = vec![[[0.0; 4]; 3]; 11];
        dispatch(Inversion { rows: 0..11, inverses: &mut inverses, matrix })?;
        Ok(inverses)
    }

    #[test]
    fn what_is_scaled_on_both_sides_has_the_relaxation_on_its_diagonal() {
        let matrix = matrix();
        for (row, inverse) in inverted(&matrix).unwrap().iter().enumerate() {
            let block = matrix.diagonal(row);
            // C⁻¹ D, and then its rows times C⁻ᵀ.
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
    fn the_first_row_that_is_not_definite_is_named() {
        for (row, entry) in [(2, -1.0), (9, 0.0), (10, f64::NAN), (4, f64::INFINITY)] {
            let mut matrix = matrix();
            matrix.diagonal_mut(row)[1][1] = entry;
            assert_eq!(inverted(&matrix), Err(row), "{entry}");
        }
    }
}
