use energy_dsl::{Block, Vector3};

/// The stiffness (c cᵀ) ⊗ B of one contact between up to four vertices: block (i, j) is cᵢ cⱼ B.
///
/// The coefficients c express the vector between the closest points, Σ cᵢ xᵢ. B is positive semi-definite: the
/// curvature of the contact's energy with respect to this vector. If Σ c = 0, a translation meets no resistance.
/// Friction on an obstacle leaves out the obstacle's vertices.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// The rows of the four vertices in the matrix; [`Contact::FIXED`] for a pinned vertex.
    pub rows: [u32; 4],
    /// c.
    pub weights: [f64; 4],
    /// B.
    pub block: Block<f64>,
}

impl Contact {
    /// Stands for the row of a pinned vertex, which the matrix does not have.
    pub const FIXED: u32 = u32::MAX;

    /// Iterates over the rows in the matrix, with their coefficients.
    pub(crate) fn free(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        let all = self.rows.iter().zip(&self.weights);
        all.filter(|(row, weight)| **row != Self::FIXED && **weight != 0.0)
            .map(|(row, weight)| (*row as usize, *weight))
    }
}

/// Writes B as a sum of at most three products r rᵀ and returns each r: Cholesky's factorisation with diagonal pivots.
/// Pivots below 10⁻¹⁴ of the largest count as zero, so the barrier along a normal is a single product.
pub(crate) fn factors(contact: &Contact) -> impl Iterator<Item = Vector3<f64>> {
    let mut rest = contact.block;
    let largest = (0..3).map(|axis| rest[axis][axis]).fold(0.0, f64::max);
    (0..3).map_while(move |_| {
        let pivot = (0..3).max_by(|&i, &j| rest[i][i].total_cmp(&rest[j][j])).unwrap_or(0);
        // False for NaN, which has no root.
        let is_positive = rest[pivot][pivot] > 1e-14 * largest;
        if !is_positive {
            return None;
        }
        let scale = 1.0 / rest[pivot][pivot].sqrt();
        let root: Vector3<f64> = std::array::from_fn(|axis| scale * rest[axis][pivot]);
        for i in 0..3 {
            for j in 0..3 {
                rest[i][j] -= root[i] * root[j];
            }
        }
        Some(root)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn product(roots: &[Vector3<f64>]) -> Block<f64> {
        std::array::from_fn(|i| std::array::from_fn(|j| roots.iter().map(|root| root[i] * root[j]).sum()))
    }

    #[test]
    fn factors_multiply_to_the_block() {
        let n = [0.6, -0.48, 0.64];
        let t = [0.8, 0.36, -0.48];
        for (roots, count) in [(vec![n], 1), (vec![n, t.map(|c| 1e-3 * c)], 2), (vec![n, t, [0.1, 2.0, 0.3]], 3)] {
            let block = product(&roots);
            let contact = Contact { rows: [0, 1, 2, 3], weights: [1.0, -0.25, -0.25, -0.5], block };
            let found: Vec<_> = factors(&contact).collect();
            assert_eq!(found.len(), count);
            let again = product(&found);
            for (entry, expected) in again.iter().flatten().zip(block.iter().flatten()) {
                assert!((entry - expected).abs() < 1e-15, "{entry} {expected}");
            }
        }
        let none = Contact { rows: [0; 4], weights: [0.0; 4], block: [[0.0; 3]; 3] };
        assert_eq!(factors(&none).count(), 0);
        let invalid = Contact { block: [[f64::NAN; 3]; 3], ..none };
        assert_eq!(factors(&invalid).count(), 0);
    }
}
