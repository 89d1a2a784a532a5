use energy_dsl::{Declaration, Lane};

use super::{MOST, Square};

/// The largest number of difference vectors.
const VECTORS: usize = MOST / 3;

/// Transformation between an element's difference vectors and orthonormal ones with the same span.
///
/// Let q = D x be the difference vectors (D ⊗ 1₃ acts on the points' coordinates) and H the Hessian by q. The Hessian
/// by points is Dᵀ H D. With D Dᵀ = L Lᵀ, the rows of Q = L⁻¹ D are orthonormal, and Dᵀ H D = Qᵀ (Lᵀ H L) Q. Its
/// eigenvalues are zeros and those of Lᵀ H L. Therefore the projection acts on Lᵀ H L, not on H, whose eigenvalues
/// differ.
#[derive(Clone, Debug)]
pub(crate) struct Orthonormal {
    /// The triangle L.
    lower: [[f64; VECTORS]; VECTORS],
    /// The triangle L⁻¹.
    inverse: [[f64; VECTORS]; VECTORS],
}

impl Orthonormal {
    /// Creates the transformation for a declaration. `None` if there are too many difference vectors, or they are
    /// linearly dependent.
    pub(crate) fn new(declaration: &Declaration) -> Option<Self> {
        let vectors = &*declaration.reduced_vectors;
        if vectors.is_empty() || vectors.len() > VECTORS || declaration.reduced_coordinates != 3 * vectors.len() {
            return None;
        }
        let sign = |added: bool| if added { 1.0 } else { -1.0 };
        let dot = |a: &[(usize, bool)], b: &[(usize, bool)]| -> f64 {
            let terms = a.iter().flat_map(|p| b.iter().map(move |q| (p, q)));
            terms.filter(|(p, q)| p.0 == q.0).map(|(p, q)| sign(p.1) * sign(q.1)).sum()
        };
        let n = vectors.len();
        let (mut lower, mut inverse) = ([[0.0; VECTORS]; VECTORS], [[0.0; VECTORS]; VECTORS]);
        for i in 0..n {
            for j in 0..=i {
                let known: f64 = (0..j).map(|k| lower[i][k] * lower[j][k]).sum();
                let rest = dot(&vectors[i], &vectors[j]) - known;
                if i == j && rest < 1e-9 {
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
        Some(Self { lower, inverse })
    }

    /// H ← Lᵀ H L, for a symmetric H.
    #[inline(always)]
    pub(super) fn make_orthonormal<V: Lane<f64>, const N: usize>(&self, h: &mut Square<V, N>) {
        self.congruent(&self.lower, h);
    }

    /// H ← L⁻ᵀ H L⁻¹, for a symmetric H.
    #[inline(always)]
    pub(super) fn make_differences<V: Lane<f64>, const N: usize>(&self, h: &mut Square<V, N>) {
        self.congruent(&self.inverse, h);
    }

    /// H ← Tᵀ H T.
    #[inline(always)]
    fn congruent<V: Lane<f64>, const N: usize>(&self, t: &[[f64; VECTORS]; VECTORS], h: &mut Square<V, N>) {
        if N == 3 {
            return; // a single vector only changes its length, which eigenvectors do not see
        }
        // Twice H ← (H T)ᵀ.
        for _ in 0..2 {
            let old = *h;
            for row in 0..N {
                let turned = columns_times(t, &old[row]);
                for column in 0..N {
                    h[column][row] = turned[column];
                }
            }
        }
    }
}

/// Returns (T ⊗ 1₃)ᵀ z for a lower triangle T.
#[inline(always)]
fn columns_times<V: Lane<f64>, const N: usize>(t: &[[f64; VECTORS]; VECTORS], z: &[V; N]) -> [V; N] {
    let mut product = [V::splat(0.0); N];
    for vector in 0..N / 3 {
        for k in vector..N / 3 {
            for axis in 0..3 {
                let place = 3 * vector + axis;
                product[place] = product[place] + V::splat(t[k][vector]) * z[3 * k + axis];
            }
        }
    }
    product
}
