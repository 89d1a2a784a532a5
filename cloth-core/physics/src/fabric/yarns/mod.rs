//! Woven and knitted cloth as two families of yarns, from the numbers of textile testers.

mod curve;
mod error;
mod tension;

pub use curve::StiffeningCurve;
pub use error::YarnError;
pub use tension::{Fast, Kes, Shear, Tension, TensionLaw};

use energy_dsl::RestError;
use energy_elements::YarnMembrane;
use schemars::JsonSchema;
use serde::Deserialize;

use super::Bending;
use crate::bounded::{PoissonRatio, Real, Share, Strain};
use crate::mesh::MaterialTriangle;

/// Two families of yarns that stiffen when stretched: A (f(ε_u) + f(ε_v) + K ε_u ε_v + g(s)), where ε are engineering
/// strains, the tension f′ is per original width, and s is the sine of the angle of shear. See
/// [`YarnMembrane`](energy_elements::YarnMembrane).
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Yarns {
    /// Tension along the warp: the number `modulus` in N/m, or a table `law`, `kes` or `fast`, or points `curve`.
    pub warp: Tension,
    /// Tension along the weft, likewise.
    pub weft: Tension,
    /// Shear force: the number `modulus` in N/m per rad, or points `curve`.
    pub shear: Shear,
    /// Poisson's ratio ν at small strains: K = ν √(k_u k_v), where k are the slopes at rest. A strip along the warp
    /// contracts by ν √(k_u/k_v) of its strain. Default 0.
    #[serde(default, with = "Real::<PoissonRatio>")]
    pub poisson_ratio: f64,
    /// How yarns buckle when pushed together. Default: they resist as they do when stretched, with the slope at rest.
    #[serde(default)]
    pub compression: Option<Compression>,
    /// Bending resistance. Default none.
    #[serde(default)]
    pub bending: Bending,
}

/// How yarns buckle when pushed together: over a strain, their stiffness falls to a share of that at rest.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Compression {
    /// Stiffness of buckled yarns over that at rest; above 0 and at most 1.
    #[serde(with = "Real::<Share>")]
    pub ratio: f64,
    /// Compressive strain at which the stiffness has fallen to that. Default 0.01.
    #[serde(default = "buckling_strain", with = "Real::<Strain>")]
    pub strain: f64,
}

fn buckling_strain() -> f64 {
    0.01
}

/// The curves of a yarn law.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct YarnLaw {
    /// Tension over strain along the warp.
    pub warp: StiffeningCurve,
    /// Tension over strain along the weft.
    pub weft: StiffeningCurve,
    /// Shear force over the sine of the angle of shear.
    pub shear: StiffeningCurve,
    /// Coupling K of the directions, in N/m.
    pub coupling: f64,
    /// How yarns buckle.
    pub compression: Compression,
    /// The largest misfit of points along warp and weft and in shear, relative to their tensions. 0 without points.
    pub misfits: [f64; 3],
}

/// The misfit of points above which the fabric has a warning.
const LARGEST_MISFIT: f64 = 0.05;

impl Yarns {
    /// Returns the law, with the coupling K = ν √(min(k_u, c_u) min(k_v, c_v)), which keeps it convex.
    ///
    /// # Errors
    /// Returns an error if a curve bends down or its numbers contradict each other.
    ///
    /// ```
    /// use cloth_physics::fabric::{Kes, Shear, Tension, Yarns};
    /// let suiting = Kes { emt: 0.05, lt: 0.6, load: 490.0 };
    /// let yarns = Yarns {
    ///     warp: Tension::Kes(suiting),
    ///     weft: Tension::Modulus(2000.0),
    ///     shear: Shear::Modulus(33.0),
    ///     poisson_ratio: 0.2,
    ///     compression: None,
    ///     bending: Default::default(),
    /// };
    /// let law = yarns.law().unwrap();
    /// assert!((law.warp.tension(0.05) - 490.0).abs() < 1e-9);
    /// assert!((law.warp.k - 0.2 * 490.0 / 0.05).abs() < 1e-9); // (2 LT − 1) F/EMT
    /// ```
    pub fn law(&self) -> Result<YarnLaw, YarnError> {
        let ((warp, of_warp), (weft, of_weft)) = (self.warp.curve("warp")?, self.weft.curve("weft")?);
        let (shear, of_shear) = self.shear.curve()?;
        let compression = self.compression.unwrap_or(Compression { ratio: 1.0, strain: buckling_strain() });
        let coupling = self.poisson_ratio * compression.ratio * (warp.k * weft.k).sqrt();
        Ok(YarnLaw { warp, weft, shear, coupling, compression, misfits: [of_warp, of_weft, of_shear] })
    }
}

impl YarnLaw {
    /// Returns the element on a triangle at rest.
    ///
    /// # Errors
    /// Returns an error if the triangle has no area.
    pub fn element(&self, [u0, u1, u2]: MaterialTriangle) -> Result<YarnMembrane, RestError> {
        let Self { warp, weft, shear, coupling, compression: Compression { ratio, strain }, .. } = *self;
        #[rustfmt::skip]
        let element = YarnMembrane::new(
            u0, u1, u2,
            warp.k, warp.a, warp.b, warp.m, ratio * warp.k, strain,
            weft.k, weft.a, weft.b, weft.m, ratio * weft.k, strain,
            coupling, shear.k, shear.a, shear.b, shear.m,
        );
        element
    }

    /// Warns of points that the curves miss by more than 5 %.
    pub(super) fn warnings(&self, part: &str) -> Vec<String> {
        let directions = ["warp", "weft", "shear"].into_iter().zip(self.misfits);
        let missed = directions.filter(|(_, misfit)| *misfit > LARGEST_MISFIT);
        let warning = |(direction, misfit): (&str, f64)| {
            format!(
                "{part}material.yarns.{direction}: the curve misses its points by up to {:.0} %; a convex curve \
                 k ε + a ε³ + b ε⁵ cannot follow them",
                100.0 * misfit
            )
        };
        missed.map(warning).collect()
    }
}
