use energy_dsl::{Declaration, Lane};

use super::{MOST, Square};

/// Transformation between the vectors of an element's reduced coordinates and orthonormal ones with the same span.
///
/// Let q = D x be the vectors, differences or other sums of the points (D ⊗ 1₃ acts on the points' coordinates) and H
/// the Hessian by q. The Hessian by points is Dᵀ H D. With D Dᵀ = L Lᵀ, the rows of Q = L⁻¹ D are orthonormal, and Dᵀ H
/// D = Qᵀ (Lᵀ H L) Q. Its eigenvalues are zeros and those of Lᵀ H L. Therefore the projection acts on Lᵀ H L, not on H,
/// whose eigenvalues differ.
#[derive(Clone, Debug)]
pub(crate) struct Orthonormal {
    /// The triangle L.
    lower: Triangle,
    /// The triangle L⁻¹.
    inverse: Triangle,
}

impl Orthonormal {
    /// Creates the transformation for a declaration. `None` without such vectors, or if they are linearly
    /// dependent.
    pub(crate) fn new(declaration: &Declaration) -> Option<Self> {
        let vectors = &*declaration.reduced_vectors;
        if vectors.is_empty() || declaration.reduced_coordinates != 3 * vectors.len() {
            return None;
        }
        let dot = |a: &[(usize, f64)], b: &[(usize, f64)]| -> f64 {
            let terms = a.iter().flat_map(|p| b.iter().map(move |q| (p, q)));
            terms.filter(|(p, q)| p.0 == q.0).map(|(p, q)| p.1 * q.1).sum()
        };
        let n = vectors.len();
        let (mut lower, mut inverse) = (vec![vec![0.0; n]; n], vec![vec![0.0; n]; n]);
        for i in 0..n {
            for j in 0..=i {
                let known: f64 = (0..j).map(|k| lower[i][k] * lower[j][k]).sum();
                let rest = dot(&vectors[i], &vectors[j]) - known;
                if i == j && rest < 1e-9 * dot(&vectors[i], &vectors[i]) {
                    return None;
                }
                lower[i][j] = if i == j { rest.sqrt() } else { rest / lower[j][j] };
            }
        }
        for j in 0..n {
            inverse[j][j] = 1.0 / lower[j][j];
            for i in j + 1..n {
                let sum: f64 = (j..i).map(|k| lower[i][k] * inverse[k][j]).sum();
                inverse[i][j] = -sum / lower[i][i];
            }
        }
        Some(Self { lower: Triangle::new(lower), inverse: Triangle::new(inverse) })
    }

    /// H ← Lᵀ H L, for a symmetric H.
    #[inline(always)]
    pub(super) fn make_orthonormal<V: Lane<f64>, A: Square<V>>(&self, h: &mut A) {
        self.lower.make_congruent(h);
    }

    /// H ← L⁻ᵀ H L⁻¹, for a symmetric H.
    #[inline(always)]
    pub(super) fn make_differences<V: Lane<f64>, A: Square<V>>(&self, h: &mut A) {
        self.inverse.make_congruent(h);
    }
}

/// A lower triangle.
#[derive(Clone, Debug)]
struct Triangle {
    rows: Vec<Vec<f64>>,
    /// The first rows again, for matrices whose size is known when this is compiled.
    array: [[f64; MOST / 3]; MOST / 3],
}

impl Triangle {
    fn new(rows: Vec<Vec<f64>>) -> Self {
        let entry = |i: usize, j: usize| rows.get(i).and_then(|row| row.get(j)).copied().unwrap_or(0.0);
        let array = std::array::from_fn(|i| std::array::from_fn(|j| entry(i, j)));
        Self { rows, array }
    }

    /// H ← (T ⊗ 1₃)ᵀ H (T ⊗ 1₃) for a symmetric H.
    #[inline(always)]
    fn make_congruent<V: Lane<f64>, A: Square<V>>(&self, h: &mut A) {
        let n = h.size();
        if n == 3 {
            return; // a single vector only changes its length, which eigenvectors do not see
        }
        // Twice H ← (H T)ᵀ.
        for _ in 0..2 {
            let old = h.clone();
            for row in 0..n {
                for vector in 0..n / 3 {
                    for axis in 0..3 {
                        let mut sum = V::splat(0.0);
                        for k in vector..n / 3 {
                            let factor = if n <= MOST { self.array[k][vector] } else { self.rows[k][vector] };
                            sum = sum + V::splat(factor) * old.at(row, 3 * k + axis);
                        }
                        h.set(3 * vector + axis, row, sum);
                    }
                }
            }
        }
    }
}
