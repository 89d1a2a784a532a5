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

use std::fmt;

use super::Strain;

/// The wasted share, times D/(K κ² h⁴).
const WASTE: f64 = 7.5e-5;
/// Triangles that waste no more have their own strain: the error of a drape coefficient is below 3 points, about the
/// scatter between meshes.
const LARGEST_SHARE: f64 = 0.25;
/// The share that plain triangles waste where nodal averages carry the rest of the stiffness.
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
    /// Returns Λ of plain triangles with this stiffness, in N/m, and edge length, in m.
    fn wasted(&self, stiffness: f64, edge: f64) -> f64 {
        WASTE * stiffness / self.rigidity * edge.powi(4) / self.radius(edge).powi(2)
    }

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

/// An estimate of the locking of a garment.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Locking {
    /// Mean length of the edges, in m.
    pub edge: f64,
    /// Tensile stiffness of the membrane, in N/m: of its stiffer direction.
    pub stiffness: f64,
    /// Λ: the energy that plain triangles of this stiffness would waste, as a share of the bending energy of a fold.
    pub wasted: f64,
    /// Whether the membrane takes nodal averages of the strain, as far as its weight allows.
    pub is_nodal: bool,
    /// The edge length whose plain triangles waste no more than 25 %, in m.
    pub sufficient_edge: f64,
    /// The stiffness whose plain triangles waste no more than 25 % on this mesh, in N/m.
    pub sufficient_stiffness: f64,
}

impl Locking {
    pub(super) fn new(folds: &Folds, stiffness: f64, edge: f64, strain: Strain) -> Self {
        let wasted = folds.wasted(stiffness, edge);
        let bending_length = (folds.rigidity / folds.weight).cbrt();
        Self {
            edge,
            stiffness,
            wasted,
            is_nodal: strain == Strain::Nodal,
            sufficient_edge: (LARGEST_SHARE * folds.rigidity * bending_length.powi(2) / (WASTE * stiffness)).powf(0.25),
            sufficient_stiffness: LARGEST_SHARE * stiffness / wasted,
        }
    }

    /// Whether plain triangles would bend too stiffly: they would waste more than 25 %.
    pub(super) fn would_lock(&self) -> bool {
        self.wasted > LARGEST_SHARE
    }

    /// Whether the cloth bends too stiffly on its mesh: its triangles lock, and nothing avoids it.
    #[must_use]
    pub fn locks(&self) -> bool {
        self.would_lock() && !self.is_nodal
    }

    /// Returns the estimated error of a drape coefficient with plain triangles, in points of a hundred.
    #[must_use]
    pub fn drape_error(&self) -> f64 {
        DRAPE_POINTS * self.wasted / (1.0 + DRAPE_SATURATION * self.wasted)
    }
}

/// Error of the drape coefficient over Λ, for small Λ: fitted to nine irregular meshes, within 2 points.
const DRAPE_POINTS: f64 = 12.0;
/// Its decrease with Λ.
const DRAPE_SATURATION: f64 = 0.55;

impl fmt::Display for Locking {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { edge, stiffness, wasted, sufficient_edge, sufficient_stiffness, .. } = self;
        let (edge, sufficient_edge, share) = (1e3 * edge, 1e3 * sufficient_edge, 100.0 * wasted);
        write!(
            f,
            "membrane locking: on a mesh with edges of {edge:.1} mm, triangles of {stiffness:.0} N/m would waste \
             {share:.0} % of the bending energy of a fold"
        )?;
        if !self.would_lock() {
            return f.write_str(", which is little");
        }
        if self.is_nodal {
            return f.write_str("; nodal averages of the strain avoid it");
        }
        let effect = if *wasted > 2.0 { "its folds are frozen" } else { "it bends too stiffly" };
        write!(
            f,
            ": {effect}, by about {:.0} points of a drape coefficient. Use `strain = \"nodal\"`, edges of \
             {sufficient_edge:.1} mm, or a stiffness of {sufficient_stiffness:.2} N/m with a strain limit",
            self.drape_error()
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A cloth with a bending length of 15 mm.
    const FOLDS: Folds = Folds { rigidity: 6.62e-6, weight: 1.962 };

    #[test]
    fn the_sufficient_edge_and_stiffness_waste_a_quarter() {
        let locking = Locking::new(&FOLDS, 2e4, 7.5e-3, Strain::PerTriangle);
        assert!(locking.locks() && locking.wasted > 1.0 && locking.to_string().contains("frozen"), "{locking}");
        for (stiffness, edge) in [(2e4, locking.sufficient_edge), (locking.sufficient_stiffness, 7.5e-3)] {
            let wasted = FOLDS.wasted(stiffness, edge);
            assert!((wasted / LARGEST_SHARE - 1.0).abs() < 1e-12, "{wasted}");
            assert!(!Locking::new(&FOLDS, 0.999 * stiffness, edge, Strain::PerTriangle).locks());
        }
        assert!(!Locking::new(&FOLDS, 2e4, 7.5e-3, Strain::Nodal).locks());
    }

    #[test]
    fn plain_triangles_are_as_stiff_as_five_percent_allow_or_the_weight_asks() {
        let fine = FOLDS.plain_stiffness(5e-3);
        assert!((FOLDS.wasted(fine, 5e-3) / PLAIN_SHARE - 1.0).abs() < 1e-12);
        let limp = Folds { rigidity: 0.0, ..FOLDS };
        assert!((limp.plain_stiffness(1e-2) - 19.62).abs() < 1e-9);
    }
}
