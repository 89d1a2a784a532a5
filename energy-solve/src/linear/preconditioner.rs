use energy_dsl::Vector3;

/// A diagonal block without an inverse.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the diagonal block of row {row} is singular or not finite; a free vertex needs mass or stiffness")]
pub struct SingularBlock {
    /// Block row of the diagonal block.
    pub row: usize,
}

/// An approximate inverse M⁻¹ of a matrix.
pub trait Preconditioner {
    /// Whether M is positive definite. If not, either the matrix is indefinite or M cannot precondition conjugate
    /// gradients.
    fn is_positive_definite(&self) -> bool;

    /// Computes z ← M⁻¹ r.
    fn apply(&self, r: &[Vector3<f64>], z: &mut [Vector3<f64>]);
}
