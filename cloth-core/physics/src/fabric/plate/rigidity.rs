use schemars::JsonSchema;
use serde::Deserialize;

use crate::bounded::{NonNegative, PoissonRatio, Positive, Real};

/// The flexural rigidity of a plate.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Rigidity {
    /// An isotropic plate: D = E h³/(12 (1 − ν²)).
    Isotropic {
        /// Young's modulus E, in Pa.
        #[serde(with = "Real::<NonNegative>")]
        young_modulus: f64,
        /// Thickness h, in m.
        #[serde(with = "Real::<Positive>")]
        thickness: f64,
        /// Poisson's ratio ν, in (−1, 1).
        #[serde(with = "Real::<PoissonRatio>")]
        poisson_ratio: f64,
    },
    /// An isotropic plate, given its flexural rigidity.
    Flexural {
        /// Flexural rigidity D, in N m.
        #[serde(with = "Real::<NonNegative>")]
        rigidity: f64,
        /// Poisson's ratio ν, in (−1, 1).
        #[serde(with = "Real::<PoissonRatio>")]
        poisson_ratio: f64,
    },
    /// A woven plate, from cantilever tests of narrow strips along warp, weft and bias, per width.
    Orthotropic {
        /// Rigidity of a strip along the warp, in N m.
        #[serde(with = "Real::<Positive>")]
        warp: f64,
        /// Rigidity of a strip along the weft, in N m.
        #[serde(with = "Real::<Positive>")]
        weft: f64,
        /// Rigidity of a strip at 45° to both, in N m.
        #[serde(with = "Real::<Positive>")]
        bias: f64,
        /// Opposite curvature across a strip along the warp, relative to the curvature along it. Default 0.
        #[serde(default, with = "Real::<PoissonRatio>")]
        poisson_ratio: f64,
    },
}

/// Rigidities that contradict each other.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RigidityError {
    /// Twist would have negative energy.
    #[error(
        "a strip on the bias with {bias} N m is stiffer than warp {warp} N m and weft {weft} N m with Poisson's ratio \
         {poisson_ratio} allow; at most {most:.4e} N m"
    )]
    Bias {
        /// Rigidity along the warp, in N m.
        warp: f64,
        /// Rigidity along the weft, in N m.
        weft: f64,
        /// Rigidity on the bias, in N m.
        bias: f64,
        /// Poisson's ratio.
        poisson_ratio: f64,
        /// Upper bound of the rigidity on the bias, in N m.
        most: f64,
    },
    /// Poisson's ratio is too large for the ratio of warp and weft.
    #[error("Poisson's ratio {poisson_ratio} must be below √(warp/weft) = {most:.4}")]
    Poisson {
        /// Poisson's ratio.
        poisson_ratio: f64,
        /// Its upper bound.
        most: f64,
    },
}

impl Rigidity {
    /// Returns D of the energy density ½ κᵀ D κ with κ = (κ_uu, κ_vv, 2κ_uv), in N m.
    ///
    /// For woven cloth, D is the inverse of the compliance S with S₁₁ = 1/warp, S₂₂ = 1/weft, S₁₂ = −ν/warp. S₆₆
    /// follows from the strip at 45°, whose compliance ¼ (S₁₁ + S₂₂ + 2 S₁₂ + S₆₆) is the inverse of the bias rigidity.
    ///
    /// # Errors
    /// Returns an error if the rigidities contradict each other.
    ///
    /// ```
    /// use cloth_physics::fabric::Rigidity;
    /// let d = Rigidity::Isotropic { young_modulus: 12.0, thickness: 1.0, poisson_ratio: 0.5 }.matrix().unwrap();
    /// assert_eq!(d[0], [4.0 / 3.0, 2.0 / 3.0, 0.0]);
    /// let woven = Rigidity::Orthotropic { warp: 2.0, weft: 1.0, bias: 0.5, poisson_ratio: 0.0 }.matrix().unwrap();
    /// assert_eq!((woven[0][0], woven[1][1]), (2.0, 1.0));
    /// ```
    pub fn matrix(&self) -> Result<[[f64; 3]; 3], RigidityError> {
        match *self {
            Self::Isotropic { young_modulus, thickness, poisson_ratio: nu } => {
                Ok(isotropic(young_modulus * thickness.powi(3) / (12.0 * (1.0 - nu * nu)), nu))
            }
            Self::Flexural { rigidity, poisson_ratio } => Ok(isotropic(rigidity, poisson_ratio)),
            Self::Orthotropic { warp, weft, bias, poisson_ratio } => {
                let most = (warp / weft).sqrt();
                if poisson_ratio >= most {
                    return Err(RigidityError::Poisson { poisson_ratio, most });
                }
                let [s11, s22, s12] = [1.0 / warp, 1.0 / weft, -poisson_ratio / warp];
                let s66 = 4.0 / bias - s11 - s22 - 2.0 * s12;
                if s66 <= 0.0 {
                    let most = 4.0 / (s11 + s22 + 2.0 * s12);
                    return Err(RigidityError::Bias { warp, weft, bias, poisson_ratio, most });
                }
                let determinant = s11 * s22 - s12 * s12;
                let [d11, d12, d22] = [s22 / determinant, -s12 / determinant, s11 / determinant];
                Ok([[d11, d12, 0.0], [d12, d22, 0.0], [0.0, 0.0, 1.0 / s66]])
            }
        }
    }
}

fn isotropic(d: f64, nu: f64) -> [[f64; 3]; 3] {
    [[d, nu * d, 0.0], [nu * d, d, 0.0], [0.0, 0.0, 0.5 * (1.0 - nu) * d]]
}

/// Returns L of D = L Lᵀ. Zero pivots give columns of zeros.
pub(super) fn cholesky(d: &[[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let mut l = [[0.0; 3]; 3];
    for i in 0..3 {
        for j in 0..=i {
            let rest = d[i][j] - (0..j).map(|k| l[i][k] * l[j][k]).sum::<f64>();
            l[i][j] = match (i == j, l[j][j]) {
                (true, _) => rest.max(0.0).sqrt(),
                (false, 0.0) => 0.0,
                (false, pivot) => rest / pivot,
            };
        }
    }
    l
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_isotropic_plate_has_the_rigidity_of_kirchhoff() {
        // Y h³/12(1 − ν²): a sheet of steel of 2 mm.
        let d = Rigidity::Isotropic { young_modulus: 200e9, thickness: 2e-3, poisson_ratio: 0.25 }.matrix().unwrap();
        let expected = 200e9 * 8e-9 / (12.0 * (1.0 - 0.0625));
        let close = |number: f64, factor: f64| (number / expected - factor).abs() < 1e-14;
        assert!(close(d[0][0], 1.0) && close(d[1][1], 1.0) && close(d[0][1], 0.25) && close(d[2][2], 0.375), "{d:?}");
    }

    #[test]
    fn strips_of_woven_cloth_have_the_measured_rigidities() {
        let woven = Rigidity::Orthotropic { warp: 3.0, weft: 1.0, bias: 1.2, poisson_ratio: 0.2 };
        let d = woven.matrix().unwrap();
        // A strip along the direction a bends to κ = D⁻¹ m, m = (a₁², a₂², a₁a₂); its rigidity is 1/(mᵀ D⁻¹ m).
        let measured = |a: [f64; 2]| {
            let m = [a[0] * a[0], a[1] * a[1], a[0] * a[1]];
            let determinant = d[0][0] * d[1][1] - d[0][1] * d[0][1];
            let k = [
                (d[1][1] * m[0] - d[0][1] * m[1]) / determinant,
                (d[0][0] * m[1] - d[0][1] * m[0]) / determinant,
                m[2] / d[2][2],
            ];
            1.0 / (m[0] * k[0] + m[1] * k[1] + m[2] * k[2])
        };
        let half = 0.5_f64.sqrt();
        for (direction, expected) in [([1.0, 0.0], 3.0), ([0.0, 1.0], 1.0), ([half, half], 1.2), ([half, -half], 1.2)] {
            assert!((measured(direction) - expected).abs() < 1e-12, "{direction:?}: {}", measured(direction));
        }
        let l = cholesky(&d);
        for i in 0..3 {
            for j in 0..3 {
                let product: f64 = (0..3).map(|k| l[i][k] * l[j][k]).sum();
                assert!((product - d[i][j]).abs() < 1e-14);
            }
        }
    }

    #[test]
    fn impossible_plates_are_rejected() {
        let stiff = Rigidity::Orthotropic { warp: 1.0, weft: 1.0, bias: 2.5, poisson_ratio: 0.0 };
        assert!(stiff.matrix().unwrap_err().to_string().ends_with("at most 2.0000e0 N m"));
        let curling = Rigidity::Orthotropic { warp: 1.0, weft: 4.0, bias: 0.5, poisson_ratio: 0.6 };
        assert!(curling.matrix().unwrap_err().to_string().contains("must be below √(warp/weft) = 0.5"));
    }
}
