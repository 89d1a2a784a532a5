//! Motions of nodes and bones as six numbers.

use std::f64::consts::PI;

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};

/// A twist (θ, t): a rotation about θ, followed by a translation t, in m.
pub type Twist = [f64; 6];

/// The angle of a twist's rotation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum AngleConvention {
    /// The angle is 2 ‖θ‖, as in the papers' formulas: θ is half the rotation vector.
    #[default]
    HalfAngle,
    /// The angle is ‖θ‖: θ is the rotation vector.
    RotationVector,
}

impl AngleConvention {
    /// Returns the parameter `turn` of the declared residuals: half the angle divided by ‖θ‖.
    #[must_use]
    pub fn turn(self) -> f64 {
        match self {
            Self::HalfAngle => 1.0,
            Self::RotationVector => 0.5,
        }
    }

    /// Returns the motion of a twist.
    #[must_use]
    pub fn motion(self, twist: &Twist) -> Isometry3<f64> {
        let rotation = 2.0 * self.turn() * Vector3::from_column_slice(&twist[..3]);
        Isometry3::from_parts(
            Translation3::new(twist[3], twist[4], twist[5]),
            UnitQuaternion::from_scaled_axis(rotation),
        )
    }

    /// Returns the twist of a motion, with the smallest angle.
    #[must_use]
    pub fn twist(self, motion: &Isometry3<f64>) -> Twist {
        let rotation = motion.rotation.scaled_axis() / (2.0 * self.turn());
        let shift = motion.translation.vector;
        [rotation.x, rotation.y, rotation.z, shift.x, shift.y, shift.z]
    }

    /// Returns the twist of the same motion with the smallest angle: ‖θ‖ ≤ π/2 for [`Self::HalfAngle`], ≤ π for
    /// [`Self::RotationVector`]. The quaternion may change its sign, which blends align.
    #[must_use]
    pub fn wrapped(self, twist: &Twist) -> Twist {
        let period = PI / self.turn();
        let length = twist[0].hypot(twist[1]).hypot(twist[2]);
        if length <= period / 2.0 {
            return *twist;
        }
        let factor = 1.0 - (length / period).round() * period / length;
        let [x, y, z, ..] = *twist;
        [factor * x, factor * y, factor * z, twist[3], twist[4], twist[5]]
    }
}

/// Blends motions as dual quaternions, each in the hemisphere of the heaviest one. Returns the identity if all weights
/// are zero.
#[must_use]
pub fn blended<'a>(motions: impl Iterator<Item = (f64, &'a Isometry3<f64>)> + Clone) -> Isometry3<f64> {
    let heaviest = motions.clone().max_by(|a, b| a.0.total_cmp(&b.0));
    let Some((_, pivot)) = heaviest.filter(|(weight, _)| *weight > 0.0) else { return Isometry3::identity() };
    let zero = Quaternion::new(0.0, 0.0, 0.0, 0.0);
    let (mut real, mut dual) = (zero, zero);
    for (weight, motion) in motions {
        let q = motion.rotation.into_inner();
        let signed = if q.dot(&pivot.rotation) < 0.0 { -weight } else { weight };
        real += q * signed;
        dual += Quaternion::from_imag(motion.translation.vector) * q * (0.5 * signed);
    }
    let length = real.norm();
    let shift = (dual * real.conjugate()).imag() * (2.0 / (length * length));
    Isometry3::from_parts(shift.into(), UnitQuaternion::from_quaternion(real))
}

#[cfg(test)]
mod tests {
    use super::*;

    const CONVENTIONS: [AngleConvention; 2] = [AngleConvention::HalfAngle, AngleConvention::RotationVector];

    #[test]
    fn twists_and_motions_convert_both_ways() {
        for convention in CONVENTIONS {
            let twist = [0.3, -0.2, 0.5, 1.0, 2.0, 3.0];
            let back = convention.twist(&convention.motion(&twist));
            assert!(twist.iter().zip(back).all(|(a, b)| (a - b).abs() < 1e-14), "{convention:?}: {back:?}");
        }
        let [half, full] = CONVENTIONS.map(|c| c.motion(&[0.4, 0.0, 0.0, 0.0, 0.0, 0.0]).rotation.angle());
        assert!((half - 0.8).abs() < 1e-14 && (full - 0.4).abs() < 1e-14);
    }

    #[test]
    fn wrapping_keeps_the_motion() {
        for convention in CONVENTIONS {
            for length in [0.5, 1.7, 3.0, 3.3, 6.0, 40.0] {
                let twist = [0.6 * length, 0.0, -0.8 * length, 1.0, 2.0, 3.0];
                let wrapped = convention.wrapped(&twist);
                let (a, b) = (convention.motion(&twist), convention.motion(&wrapped));
                assert!(a.rotation.angle_to(&b.rotation) < 1e-7, "{convention:?}, {length}");
                assert!(wrapped[0].hypot(wrapped[2]) <= PI / convention.turn() / 2.0 + 1e-12);
                assert_eq!(wrapped[3..], twist[3..]);
            }
        }
    }

    #[test]
    fn a_blend_of_equal_motions_is_the_motion_for_either_sign() {
        let motion = AngleConvention::HalfAngle.motion(&[1.4, 0.3, 0.0, 1.0, 2.0, 3.0]);
        let negative =
            Isometry3::from_parts(motion.translation, UnitQuaternion::new_unchecked(-motion.rotation.into_inner()));
        let blend = blended([(0.7, &motion), (0.3, &negative)].into_iter());
        assert!((blend.to_homogeneous() - motion.to_homogeneous()).norm() < 1e-14);
        assert_eq!(blended([(0.0, &motion)].into_iter()), Isometry3::identity());
    }
}
