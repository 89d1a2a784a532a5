use schemars::JsonSchema;
use serde::Deserialize;

use super::Declared;
use super::plate::Rigidity;
use crate::bounded::{all_positive, finite_triple, non_negative, poisson_ratio, positive};

/// A fabric.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Fabric {
    /// Mass per area σ, in kg/m².
    #[serde(deserialize_with = "positive")]
    pub density: f64,
    /// What resists stretching and bending: the table `mass-spring`, `stvk`, `neo-hookean`, `stable-neo-hookean`, `stable-neo-hookean-log`,
    /// `arap`, `baraff-witkin`, `orthotropic-stvk`, or `file` for elements of the user's own.
    pub material: Material,
    /// The direction of the warp in the rest shape, projected on each triangle. Default [1, 0, 0].
    #[serde(default = "first_axis", deserialize_with = "finite_triple")]
    pub warp: [f64; 3],
    /// Resists what stretches the threads beyond a limit. Default nothing.
    #[serde(default)]
    pub strain_limit: Option<StrainLimit>,
    /// Damping in proportion to stiffness. Default none.
    #[serde(default)]
    pub rayleigh: Option<Rayleigh>,
}

impl Fabric {
    /// A fabric with its warp along the first axis, without strain limit and damping.
    #[must_use]
    pub fn new(density: f64, material: Material) -> Self {
        Self { density, material, warp: first_axis(), strain_limit: None, rayleigh: None }
    }
}

fn first_axis() -> [f64; 3] {
    [1.0, 0.0, 0.0]
}

/// Strain limiting of triangles: A k/3 (o_u³ + o_v³), o the stretch of warp and weft beyond the limit.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StrainLimit {
    /// The stretch beyond which it acts, over the length at rest; above 1.
    #[serde(deserialize_with = "positive")]
    pub stretch: f64,
    /// k, in N/m. Twice k o is what it adds to the membrane's stiffness.
    #[serde(deserialize_with = "non_negative")]
    pub stiffness: f64,
}

/// Damping in proportion to stiffness (Rayleigh), by forces that take no part in rigid motions. Needs the integrator `implicit-euler` or an
/// explicit one.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Rayleigh {
    /// β of the membrane, in s. Its viscosities are β λ and β μ. Default 0.
    #[serde(default, deserialize_with = "non_negative")]
    pub stretching: f64,
    /// β of bending, in s. Default 0.
    #[serde(default, deserialize_with = "non_negative")]
    pub bending: f64,
}

/// What resists stretching and bending.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Material {
    /// Springs between vertices.
    MassSpring(MassSpring),
    /// St. Venant–Kirchhoff triangles and hinges: A (μ ‖E‖² + ½ λ tr² E), E = (FᵀF − 1)/2.
    Stvk(Membrane),
    /// Neo-Hookean triangles and hinges: A (½ μ (tr FᵀF − 2) − μ ln J + ½ λ ln² J), J the ratio of areas. No triangle loses its area.
    NeoHookean(Membrane),
    /// Stable neo-Hookean triangles without logarithm: A (½ μ (I − 2) − μ (J − 1) + ½ λ (J − 1)²).
    StableNeoHookean(Membrane),
    /// Stable neo-Hookean triangles with logarithm (Smith et al. 2018).
    StableNeoHookeanLog(Membrane),
    /// As-rigid-as-possible triangles: ½ A μ ((s₁ − 1)² + (s₂ − 1)²), s the principal stretches.
    Arap(Arap),
    /// Stretch along warp and weft, and shear (Baraff & Witkin 1998).
    BaraffWitkin(BaraffWitkin),
    /// Woven St. Venant–Kirchhoff triangles from what strips along warp, weft and the bias show in a tensile test.
    OrthotropicStvk(Woven),
    /// Elements declared in a `.energy` file of the user's own.
    File(Declared),
}

/// As-rigid-as-possible triangles.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Arap {
    /// μ, in N/m: the tension per width over the strain of a narrow strip.
    #[serde(deserialize_with = "non_negative")]
    pub stretch_stiffness: f64,
    /// What resists bending. Default nothing.
    #[serde(default)]
    pub bending: Bending,
}

/// A (½ K_s ((‖w_u‖ − b_u)² + (‖w_v‖ − b_v)²) + ½ K_h (w_u·w_v)²), w_u and w_v what became of unit vectors along warp and weft. The source's
/// condition functions carry the area A, so that its constants are these over A.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BaraffWitkin {
    /// K_s, in N/m.
    #[serde(deserialize_with = "non_negative")]
    pub stretch: f64,
    /// K_h, in N/m.
    #[serde(deserialize_with = "non_negative")]
    pub shear: f64,
    /// b_u and b_v. Default 1: at rest as drawn.
    #[serde(default = "ones", deserialize_with = "all_positive")]
    pub rest_stretch: [f64; 2],
    /// What resists bending. Default nothing.
    #[serde(default)]
    pub bending: Bending,
}

fn ones() -> [f64; 2] {
    [1.0; 2]
}

/// Woven cloth by its strips: the tension per width over the strain, in N/m, for small strains.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Woven {
    /// Of a strip along the warp, in N/m.
    #[serde(deserialize_with = "positive")]
    pub warp: f64,
    /// Of a strip along the weft, in N/m.
    #[serde(deserialize_with = "positive")]
    pub weft: f64,
    /// Of a strip at 45° to both, in N/m.
    #[serde(deserialize_with = "positive")]
    pub bias: f64,
    /// By what part of its stretch a strip along the warp becomes narrower. Default 0.
    #[serde(default, deserialize_with = "poisson_ratio")]
    pub poisson_ratio: f64,
    /// What resists bending. Default nothing.
    #[serde(default)]
    pub bending: Bending,
}

/// Springs of rest length L = ‖x̄_P − x̄_Q‖ with energy ½ K (‖x_P − x_Q‖ − L)². Their stiffness is per spring: it does not
/// scale with the mesh. A zero leaves the springs out.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
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
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Membrane {
    /// Young's modulus times thickness Y h, in N/m.
    #[serde(deserialize_with = "non_negative")]
    pub stretch_stiffness: f64,
    /// Poisson's ratio ν, in (−1, 1).
    #[serde(deserialize_with = "poisson_ratio")]
    pub poisson_ratio: f64,
    /// What resists bending: `none` (the default), or the table `plate`, `bridson`, `bridson-force` or `flat`.
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
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Bending {
    /// Nothing.
    #[default]
    None,
    /// A plate with the given flexural rigidity in every direction on every mesh: the tables `isotropic`, `flexural` or `orthotropic`. See
    /// [`crate::fabric::plate`].
    Plate(Rigidity),
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
