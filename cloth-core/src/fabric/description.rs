use serde::Deserialize;

use crate::scene::numbers::{non_negative, poisson_ratio, positive};

/// A fabric.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Fabric {
    /// Mass per area σ, in kg/m².
    #[serde(deserialize_with = "positive")]
    pub density: f64,
    /// What resists stretching and bending: the table `mass-spring`, `stvk` or `neo-hookean`.
    pub material: Material,
}

/// What resists stretching and bending.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Material {
    /// Springs between vertices.
    MassSpring(MassSpring),
    /// St. Venant–Kirchhoff triangles and hinges: A (μ ‖E‖² + ½ λ tr² E), E = (FᵀF − 1)/2.
    Stvk(Membrane),
    /// Neo-Hookean triangles and hinges: A (½ μ (tr FᵀF − 2) − μ ln J + ½ λ ln² J), J the ratio of areas. No triangle loses its area.
    NeoHookean(Membrane),
}

/// Springs of rest length L = ‖x̄_P − x̄_Q‖ with energy ½ K (‖x_P − x_Q‖ − L)². Their stiffness is per spring: it does not
/// scale with the mesh. A zero leaves the springs out.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MassSpring {
    /// K of the springs along warp and weft, in N/m.
    #[serde(deserialize_with = "non_negative")]
    pub structural: f64,
    /// K of the springs across the cells, in N/m. Only the built-in sheet has them.
    #[serde(deserialize_with = "non_negative")]
    pub shear: f64,
    /// K of the springs between second neighbours, in N/m.
    #[serde(deserialize_with = "non_negative")]
    pub bending: f64,
    /// Damping k_d along each spring, in N s/m: the force −k_d n (n·(v_P − v_Q)), n the unit vector of the spring. Default 0.
    #[serde(default, deserialize_with = "non_negative")]
    pub damping: f64,
}

/// Triangles in plane stress, μ = Y h/(2(1+ν)), λ = Y h ν/(1−ν²), with hinges between them.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Membrane {
    /// Young's modulus times thickness Y h, in N/m.
    #[serde(deserialize_with = "non_negative")]
    pub stretch_stiffness: f64,
    /// Poisson's ratio ν, in (−1, 1).
    #[serde(deserialize_with = "poisson_ratio")]
    pub poisson_ratio: f64,
    /// What resists bending: `none` (the default), or the table `bridson`, `bridson-force` or `flat`.
    #[serde(default)]
    pub bending: Bending,
}

impl Membrane {
    /// Lamé's λ and μ of plane stress, times thickness, in N/m.
    ///
    /// ```
    /// let fabric = cloth_core::fabric::Membrane { stretch_stiffness: 3.0, poisson_ratio: 0.5, bending: Default::default() };
    /// assert_eq!(fabric.lame(), (2.0, 1.0));
    /// ```
    #[must_use]
    pub fn lame(&self) -> (f64, f64) {
        let (stiffness, nu) = (self.stretch_stiffness, self.poisson_ratio);
        (stiffness * nu / (1.0 - nu * nu), stiffness / (2.0 * (1.0 + nu)))
    }
}

/// What resists bending at the hinge of two triangles with shared edge E and normals N₁, N₂ (twice their areas).
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Bending {
    /// Nothing.
    #[default]
    None,
    /// The conservative potential K′ [2(cos(θ₀/2) − cos(θ/2)) − (θ − θ₀) sin(θ₀/2)], K′ = K ‖Ē‖²/(‖N̄₁‖ + ‖N̄₂‖) of the rest shape.
    Bridson {
        /// K, in N m. A flat sheet with regular diagonals bends along its grid with the flexural rigidity D = K/4.
        #[serde(deserialize_with = "non_negative")]
        stiffness: f64,
    },
    /// The quadratic potential 3 k/(4 (A₁ + A₂)) ‖Σ cᵢ xᵢ‖² of sheets that are flat at rest, c the weights of the cotangent Laplacian: its
    /// Hessian is constant.
    Flat {
        /// k, in N m. A flat sheet with regular diagonals bends along its grid with the flexural rigidity D = 3 k/2.
        #[serde(deserialize_with = "non_negative")]
        stiffness: f64,
    },
    /// The force as printed by Bridson et al. (2003), K ‖E‖²/(‖N₁‖ + ‖N₂‖) (sin(θ/2) − sin(θ₀/2)) uᵢ, which is not conservative.
    BridsonForce {
        /// K, in N m.
        #[serde(deserialize_with = "non_negative")]
        stiffness: f64,
        /// k_d of the force −k_d ‖E‖ (Σ uⱼ·vⱼ) uᵢ, in N s. Default 0.
        #[serde(default, deserialize_with = "non_negative")]
        damping: f64,
    },
}
