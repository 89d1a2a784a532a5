use schemars::JsonSchema;
use serde::Deserialize;

use super::Declared;
use super::plate::Rigidity;
use super::warp_choice::WarpChoice;
use super::yarns::Yarns;
use crate::Coulomb;
use crate::bounded::{AboveOne, MaybeReal, NonNegative, PoissonRatio, Positive, Real, Reals};
use crate::mesh::Warp;

/// A fabric: its density and its resistance to deformation.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Fabric {
    /// Mass per area σ, in kg/m².
    #[serde(with = "Real::<Positive>")]
    pub density: f64,
    /// Thickness in contact with cloth, in m. Default `density` over 470 kg/m³, the bulk density of plain cotton.
    #[serde(default, with = "MaybeReal::<Positive>")]
    pub thickness: Option<f64>,
    /// Friction with cloth: a coefficient, or the table `static`, `kinetic`; between two fabrics, the means of theirs.
    /// Default 0.
    #[serde(default)]
    pub friction: Coulomb,
    /// Resistance to stretching and bending: the table `mass-spring`, `stvk`, `neo-hookean`, `stable-neo-hookean`,
    /// `stable-neo-hookean-log`, `arap`, `baraff-witkin`, `orthotropic-stvk`, `yarns`, or `file` for elements of your
    /// own.
    pub material: Material,
    /// Direction of the warp in the rest shape, projected onto each triangle; or `uv`, the direction in which the first
    /// texture coordinate of the OBJ file grows. Default [1, 0, 0].
    #[serde(default = "first_axis", with = "WarpChoice")]
    pub warp: Warp,
    /// How the membrane measures strain: `nodal` (the default), which lets stiff cloth fold on any mesh, or
    /// `per-triangle`.
    #[serde(default)]
    pub strain: Strain,
    /// Limits the stretch of the threads. Default none.
    #[serde(default)]
    pub strain_limit: Option<StrainLimit>,
    /// Stiffness-proportional damping. Default none.
    #[serde(default)]
    pub rayleigh: Option<Rayleigh>,
    /// Limits beyond which the cloth stays deformed. Default none.
    #[serde(default)]
    pub plasticity: Option<Plasticity>,
    /// Friction between yarns that bend. Default none.
    #[serde(default)]
    pub hysteresis: Option<Hysteresis>,
}

impl Fabric {
    /// Creates a fabric with its warp along the first axis, no strain limit and no damping.
    #[must_use]
    pub fn new(density: f64, material: Material) -> Self {
        Self {
            density,
            thickness: None,
            friction: Coulomb::default(),
            material,
            warp: first_axis(),
            strain: Strain::default(),
            strain_limit: None,
            rayleigh: None,
            plasticity: None,
            hysteresis: None,
        }
    }

    /// Returns the thickness in contact, in m.
    #[must_use]
    pub fn thickness(&self) -> f64 {
        self.thickness.unwrap_or(self.density / BULK_DENSITY)
    }
}

/// Mass per volume of plain cotton, in kg/m³: 0.1503 kg/m² at a thickness of 0.318 mm.
const BULK_DENSITY: f64 = 470.0;

fn first_axis() -> Warp {
    Warp::Direction([1.0, 0.0, 0.0])
}

/// The strain that a membrane of triangles responds to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Strain {
    /// The mean over the triangles around each vertex. A part of the stiffness stays with each triangle. Linear
    /// triangles alone lock: on an irregular mesh a stiff cloth cannot fold. Fabrics so soft, or meshes so fine, that
    /// triangles do not lock have plain triangles. Springs and elements of your own have no mean.
    #[default]
    Nodal,
    /// Each triangle has its own.
    PerTriangle,
}

/// Strain limit of triangles: energy A k/3 (o_u³ + o_v³), where o is the excess stretch of warp and weft.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StrainLimit {
    /// Stretch above which the limit acts, relative to the rest length; greater than 1.
    #[serde(with = "Real::<AboveOne>")]
    pub stretch: f64,
    /// Stiffness k, in N/m. Adds 2 k o to the stiffness of the membrane.
    #[serde(with = "Real::<NonNegative>")]
    pub stiffness: f64,
}

/// Stiffness-proportional (Rayleigh) damping, with forces that vanish under rigid motions. The viscosities are those of
/// the deformation in the middle of each step.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Rayleigh {
    /// β of the membrane, in s; its viscosities are β λ and β μ. Default 0.
    #[serde(default, with = "Real::<NonNegative>")]
    pub stretching: f64,
    /// β of bending, in s. Default 0.
    #[serde(default, with = "Real::<NonNegative>")]
    pub bending: f64,
}

/// Limits of perfect plasticity: at the end of each step, the rest shape follows what is strained beyond them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Plasticity {
    /// The largest principal stretch relative to the rest length; greater than 1. Default unlimited.
    #[serde(default, with = "MaybeReal::<AboveOne>")]
    pub stretch: Option<f64>,
    /// The largest change of a curvature relative to the rest shape, in 1/m. Default unlimited.
    #[serde(default, with = "MaybeReal::<Positive>")]
    pub curvature: Option<f64>,
}

/// Friction between yarns that bend: a second plate, in parallel to the bending resistance, that is elastic up to a
/// moment and yields there. So the curve of moment over curvature is a loop of this half width.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Hysteresis {
    /// The largest moment per width, in N: half of what KES-F bending testers print as 2HB (1 gf·cm/cm is 9.807 mN).
    #[serde(with = "Real::<Positive>")]
    pub moment: f64,
    /// The change of curvature after which the moment is reached, in 1/m. Default 20.
    #[serde(default = "yield_curvature", with = "Real::<Positive>")]
    pub curvature: f64,
}

impl Hysteresis {
    /// Returns the rigidity of the plate that yields.
    pub(super) fn rigidity(&self) -> Rigidity {
        Rigidity::Flexural { rigidity: self.moment / self.curvature, poisson_ratio: 0.0 }
    }
}

fn yield_curvature() -> f64 {
    20.0
}

/// Resistance to stretching and bending.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Material {
    /// Springs between vertices.
    MassSpring(MassSpring),
    /// Saint Venant–Kirchhoff triangles and hinges: A (μ ‖E‖² + ½ λ tr² E), E = (FᵀF − 1)/2.
    Stvk(Membrane),
    /// Neo-Hookean triangles and hinges: A (½ μ (tr FᵀF − 2) − μ ln J + ½ λ ln² J), where J is the ratio of areas.
    /// Prevents triangles from collapsing.
    NeoHookean(Membrane),
    /// Stable neo-Hookean triangles without logarithm: A (½ μ (I − 2) − μ (J − 1) + ½ λ (J − 1)²).
    StableNeoHookean(Membrane),
    /// Stable neo-Hookean triangles with logarithm (Smith et al. 2018).
    StableNeoHookeanLog(Membrane),
    /// ARAP (as-rigid-as-possible) triangles: ½ A μ ((s₁ − 1)² + (s₂ − 1)²), where s are the principal stretches.
    Arap(Arap),
    /// Stretch along warp and weft, and shear (Baraff & Witkin 1998).
    BaraffWitkin(BaraffWitkin),
    /// Woven St. Venant–Kirchhoff triangles, from tensile tests of strips along warp, weft and bias.
    OrthotropicStvk(Woven),
    /// Two families of yarns that stiffen when stretched, from the numbers of KES or FAST testers or from curves.
    Yarns(Yarns),
    /// Elements declared in your own `.energy` file.
    File(Declared),
}

impl Material {
    /// Returns the bending resistance; `None` for springs.
    pub(super) fn bending(&self) -> Option<&Bending> {
        match self {
            Self::MassSpring(_) => None,
            Self::Stvk(material)
            | Self::NeoHookean(material)
            | Self::StableNeoHookean(material)
            | Self::StableNeoHookeanLog(material) => Some(&material.bending),
            Self::Arap(material) => Some(&material.bending),
            Self::BaraffWitkin(material) => Some(&material.bending),
            Self::OrthotropicStvk(material) => Some(&material.bending),
            Self::Yarns(material) => Some(&material.bending),
            Self::File(declared) => Some(&declared.bending),
        }
    }
}

/// ARAP (as-rigid-as-possible) triangles.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Arap {
    /// Stiffness μ, in N/m: tension per width over strain of a narrow strip.
    #[serde(with = "Real::<NonNegative>")]
    pub stretch_stiffness: f64,
    /// Bending resistance. Default none.
    #[serde(default)]
    pub bending: Bending,
}

/// Energy A (½ K_s ((‖w_u‖ − b_u)² + (‖w_v‖ − b_v)²) + ½ K_h (w_u·w_v)²), where w_u and w_v are the deformed unit
/// vectors along warp and weft. The condition functions of the source include the area A; its constants are these over
/// A.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BaraffWitkin {
    /// Stretch stiffness K_s, in N/m.
    #[serde(with = "Real::<NonNegative>")]
    pub stretch: f64,
    /// Shear stiffness K_h, in N/m.
    #[serde(with = "Real::<NonNegative>")]
    pub shear: f64,
    /// Rest stretches b_u and b_v. Default 1: the mesh is the rest shape.
    #[serde(default = "ones", with = "Reals::<Positive, 2>")]
    pub rest_stretch: [f64; 2],
    /// Bending resistance. Default none.
    #[serde(default)]
    pub bending: Bending,
}

fn ones() -> [f64; 2] {
    [1.0; 2]
}

/// Woven cloth, by the stiffness of narrow strips: tension per width over strain in N/m, for small strains.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Woven {
    /// Stiffness of a strip along the warp, in N/m.
    #[serde(with = "Real::<Positive>")]
    pub warp: f64,
    /// Stiffness of a strip along the weft, in N/m.
    #[serde(with = "Real::<Positive>")]
    pub weft: f64,
    /// Stiffness of a strip at 45° to both, in N/m.
    #[serde(with = "Real::<Positive>")]
    pub bias: f64,
    /// Contraction of a strip along the warp across its length, relative to its strain. Default 0.
    #[serde(default, with = "Real::<PoissonRatio>")]
    pub poisson_ratio: f64,
    /// Bending resistance. Default none.
    #[serde(default)]
    pub bending: Bending,
}

/// Springs of rest length L = ‖x̄_P − x̄_Q‖ with energy ½ K (‖x_P − x_Q‖ − L)². K is the stiffness of one spring and
/// does not scale with the mesh. A value of 0 omits the springs.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MassSpring {
    /// Stiffness K of the springs along warp and weft, in N/m.
    #[serde(with = "Real::<NonNegative>")]
    pub structural: f64,
    /// Stiffness K of the springs across the cells, in N/m. Only built-in sheets have them.
    #[serde(with = "Real::<NonNegative>")]
    pub shear: f64,
    /// Stiffness K of the springs between second neighbours, in N/m.
    #[serde(with = "Real::<NonNegative>")]
    pub bending: f64,
    /// Damping k_d along each spring, in N s/m: the force −k_d n (n·(v_P − v_Q)), where n is the direction of the
    /// spring. Default 0.
    #[serde(default, with = "Real::<NonNegative>")]
    pub damping: f64,
}

/// Triangles in plane stress with μ = Y h/(2(1+ν)), λ = Y h ν/(1−ν²), and hinges between them.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Membrane {
    /// Young's modulus times thickness Y h, in N/m.
    #[serde(with = "Real::<NonNegative>")]
    pub stretch_stiffness: f64,
    /// Poisson's ratio ν, in (−1, 1).
    #[serde(with = "Real::<PoissonRatio>")]
    pub poisson_ratio: f64,
    /// Bending resistance: `none` (the default), or the table `plate`, `bridson`, `bridson-force` or `flat`.
    #[serde(default)]
    pub bending: Bending,
}

impl Membrane {
    /// Returns Lamé's λ and μ of plane stress times thickness, in N/m.
    ///
    /// ```
    /// use cloth_physics::fabric::Membrane;
    /// let fabric = Membrane { stretch_stiffness: 3.0, poisson_ratio: 0.5, bending: Default::default() };
    /// assert_eq!(fabric.lame(), (2.0, 1.0));
    /// ```
    #[must_use]
    pub fn lame(&self) -> (f64, f64) {
        let (stiffness, nu) = (self.stretch_stiffness, self.poisson_ratio);
        (stiffness * nu / (1.0 - nu * nu), stiffness / (2.0 * (1.0 + nu)))
    }
}

/// Bending resistance at the hinge of two triangles, with shared edge E and normals N₁, N₂ of twice the triangles'
/// areas.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Bending {
    /// No bending resistance.
    #[default]
    None,
    /// A plate with the given flexural rigidity, in every direction and on every mesh: the table `isotropic`,
    /// `flexural` or `orthotropic`. See [`crate::fabric::plate`].
    Plate(Rigidity),
    /// The conservative potential K′ [2(cos(θ₀/2) − cos(θ/2)) − (θ − θ₀) sin(θ₀/2)], with K′ = K ‖Ē‖²/(‖N̄₁‖ + ‖N̄₂‖)
    /// of the rest shape.
    Bridson {
        /// Stiffness K, in N m. A flat sheet with regular diagonals has the flexural rigidity D = K/4 along its grid.
        #[serde(with = "Real::<NonNegative>")]
        stiffness: f64,
    },
    /// The quadratic potential 3 k/(4 (A₁ + A₂)) ‖Σ cᵢ xᵢ‖² of sheets that are flat at rest, with the weights c of the
    /// cotangent Laplacian. Its Hessian is constant.
    Flat {
        /// Stiffness k, in N m. A flat sheet with regular diagonals has the flexural rigidity D = 3 k/2 along its grid.
        #[serde(with = "Real::<NonNegative>")]
        stiffness: f64,
    },
    /// The force as printed by Bridson et al. (2003), K ‖E‖²/(‖N₁‖ + ‖N₂‖) (sin(θ/2) − sin(θ₀/2)) uᵢ, which is not
    /// conservative.
    BridsonForce {
        /// Stiffness K, in N m.
        #[serde(with = "Real::<NonNegative>")]
        stiffness: f64,
        /// Damping k_d, in N s: the force −k_d ‖E‖ (Σ uⱼ·vⱼ) uᵢ. Default 0.
        #[serde(default, with = "Real::<NonNegative>")]
        damping: f64,
    },
}
