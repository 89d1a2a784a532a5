//! Membrane locking: how much a mesh of linear triangles stiffens the folds of a cloth.
//!
//! A triangle measures the chord of an arc. On an irregular mesh the error κ² l²/24 of an edge of length l under a
//! curvature κ differs from edge to edge, so no displacement removes it. The energy that this costs, as a share of the
//! bending energy of a fold, is
//!
//! Λ = 7.5e-5 (K/D) κ² h⁴
//!
//! with the tensile stiffness K in N/m, the flexural rigidity D in N m and the mean edge length h. The factor was
//! measured; it lies between 4.6e-5 and 1.1e-4 on irregular meshes. Folds under a cloth's own weight have κ = 1/c with
//! the bending length c = (D/σg)^⅓.

/// The wasted share, times D/(K κ² h⁴).
const WASTE: f64 = 7.5e-5;
/// The share that plain triangles may waste if nodal averages carry the rest of the stiffness.
const PLAIN_SHARE: f64 = 0.05;
/// The largest strain that the cloth's weight may cause in plain triangles within an edge's length.
const PLAIN_STRAIN: f64 = 1e-3;

/// The folds of a cloth under its own weight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Folds {
    /// Flexural rigidity D, in N m.
    pub rigidity: f64,
    /// Weight per area σ g, in N/m².
    pub weight: f64,
}

impl Folds {
    /// Returns the radius of curvature of folds on a mesh with this edge length, in m: the bending length, but no less
    /// than two edges.
    fn radius(&self, edge: f64) -> f64 {
        (self.rigidity / self.weight).cbrt().max(2.0 * edge)
    }

    /// Returns the stiffness that plain triangles may have without locking, in N/m.
    pub fn plain_stiffness(&self, edge: f64) -> f64 {
        let radius = self.radius(edge);
        let unlocked = PLAIN_SHARE * self.rigidity * radius * radius / (WASTE * edge.powi(4));
        unlocked.max(self.weight * edge / PLAIN_STRAIN)
    }
}
