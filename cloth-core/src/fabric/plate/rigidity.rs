use schemars::JsonSchema;
use serde::Deserialize;

use crate::bounded::{non_negative, poisson_ratio, positive};

/// How stiff a plate is against bending.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Rigidity {
    /// Alike in all directions: D = E h³/(12 (1 − ν²)).
    Isotropic {
        /// Young's modulus E, in Pa.
        #[serde(deserialize_with = "non_negative")]
        young_modulus: f64,
        /// The thickness h, in m.
        #[serde(deserialize_with = "positive")]
        thickness: f64,
        /// Poisson's ratio ν, in (−1, 1).
        #[serde(deserialize_with = "poisson_ratio")]
        poisson_ratio: f64,
    },
    /// Alike in all directions, by its flexural rigidity.
    Flexural {
        /// D, in N m.
        #[serde(deserialize_with = "non_negative")]
        rigidity: f64,
        /// Poisson's ratio ν, in (−1, 1).
        #[serde(deserialize_with = "poisson_ratio")]
        poisson_ratio: f64,
    },
    /// Woven: what narrow strips cut along warp, weft and the bias show in a cantilever test, per width.
    Orthotropic {
        /// Of a strip along the warp, in N m.
        #[serde(deserialize_with = "positive")]
        warp: f64,
        /// Of a strip along the weft, in N m.
        #[serde(deserialize_with = "positive")]
        weft: f64,
        /// Of a strip at 45° to both, in N m.
        #[serde(deserialize_with = "positive")]
        bias: f64,
        /// By what part of its curvature a strip along the warp curls across, the other way. Default 0.
        #[serde(default, deserialize_with = "poisson_ratio")]
        poisson_ratio: f64,
    },
}

/// Stiffnesses that no plate has.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum RigidityError {
    /// Twist would have negative energy.
    #[error(
        "a strip on the bias with {bias} N m is stiffer than warp {warp} N m and weft {weft} N m with Poisson's ratio {poisson_ratio} allow; \
         at most {most:.4e} N m"
    )]
    Bias {
        /// As given, in N m.
        warp: f64,
        /// As given, in N m.
        weft: f64,
        /// As given, in N m.
        bias: f64,
        /// As given.
        poisson_ratio: f64,
        /// What the bias must stay below, in N m.
        most: f64,
    },
    /// Warp and weft curl each other too much.
    #[error("Poisson's ratio {poisson_ratio} must be below √(warp/weft) = {most:.4}")]
    Poisson {
        /// As given.
        poisson_ratio: f64,
        /// Its bound.
        most: f64,
    },
}

impl Rigidity {
    /// D of the energy density ½ κᵀ D κ on (κ_uu, κ_vv, 2κ_uv), in N m.
    ///
    /// Of woven cloth it is the inverse of the compliance S with S₁₁ = 1/warp, S₂₂ = 1/weft, S₁₂ = −ν/warp, and S₆₆ such that a strip at 45°,
    /// whose compliance is ¼ (S₁₁ + S₂₂ + 2 S₁₂ + S₆₆), has the bias' rigidity.
    ///
    /// # Errors
    /// When no plate is like that.
    ///
    /// ```
    /// use cloth_core::fabric::Rigidity;
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

/// L of D = L Lᵀ; rows of zeros where D has none.
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
    fn strips_of_woven_cloth_have_the_rigidities_that_were_measured() {
        let woven = Rigidity::Orthotropic { warp: 3.0, weft: 1.0, bias: 1.2, poisson_ratio: 0.2 };
        let d = woven.matrix().unwrap();
        // A strip along the direction a bends to κ = D⁻¹ m, m = (a₁², a₂², a₁a₂), and shows 1/(mᵀ D⁻¹ m).
        let shown = |a: [f64; 2]| {
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
            assert!((shown(direction) - expected).abs() < 1e-12, "{direction:?}: {}", shown(direction));
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
    fn impossible_plates_are_refused() {
        let stiff = Rigidity::Orthotropic { warp: 1.0, weft: 1.0, bias: 2.5, poisson_ratio: 0.0 };
        assert!(stiff.matrix().unwrap_err().to_string().ends_with("at most 2.0000e0 N m"));
        let curling = Rigidity::Orthotropic { warp: 1.0, weft: 4.0, bias: 0.5, poisson_ratio: 0.6 };
        assert!(curling.matrix().unwrap_err().to_string().contains("must be below √(warp/weft) = 0.5"));
    }
}
