use energy_dsl::Block;

/// The stiffness (c cᵀ) ⊗ B of one contact between up to four vertices: block (i, j) is cᵢ cⱼ B.
///
/// The coefficients c express the vector between the closest points, Σ cᵢ xᵢ. B is positive semi-definite: the
/// curvature of the contact's energy with respect to this vector. If Σ c = 0, a translation meets no resistance.
/// Friction on an obstacle leaves out the obstacle's vertices.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// The rows of the four vertices in the matrix; [`Contact::FIXED`] for a pinned vertex.
    pub rows: [u32; 4],
    /// The coefficients c.
    pub weights: [f64; 4],
    /// The block B, in N/m.
    pub block: Block<f64>,
}

impl Contact {
    /// Stands for the row of a pinned vertex, which the matrix does not have.
    pub const FIXED: u32 = u32::MAX;
}
