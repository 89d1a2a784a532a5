use energy_dsl::Vector3;

/// A diagonal block that has no inverse.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the diagonal block of row {row} is singular or not finite; a free vertex needs mass or stiffness")]
pub struct SingularBlock {
    /// The block row.
    pub row: usize,
}

/// An approximate inverse M⁻¹ of a matrix.
pub trait Preconditioner {
    /// Whether M is positive definite. If it is not, neither is the matrix, or M is no use for conjugate gradients.
    fn is_positive_definite(&self) -> bool;

    /// z ← M⁻¹ r.
    fn apply(&self, r: &[Vector3<f64>], z: &mut [Vector3<f64>]);
}
