use nalgebra::{Isometry3, Translation3, Unit, UnitQuaternion, Vector3};

use crate::body::Bone;
use crate::random::gaussian;

/// Standard deviations of a body tracker's errors, which are normally distributed.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct BoneNoise {
    /// Rotation of each bone about its joint, about a random axis, in rad.
    pub turn: f64,
    /// Translation along each axis, in m.
    pub shift: f64,
}

/// Adds errors to motions, with new random numbers for every bone and call.
#[must_use]
pub fn noisy(
    bones: &[Bone],
    motions: &[Isometry3<f64>],
    noise: BoneNoise,
    random: &mut fastrand::Rng,
) -> Vec<Isometry3<f64>> {
    let mut one = |(bone, motion): (&Bone, &Isometry3<f64>)| {
        let joint = motion.transform_point(&bone.head.into()).coords;
        let turn = UnitQuaternion::from_axis_angle(&direction(random), noise.turn * gaussian(random));
        let shift = noise.shift * Vector3::from_fn(|_, _| gaussian(random));
        Isometry3::from_parts(Translation3::from(joint - turn * joint + shift), turn) * motion
    };
    bones.iter().zip(motions).map(&mut one).collect()
}

fn direction(random: &mut fastrand::Rng) -> Unit<Vector3<f64>> {
    Unit::try_new(Vector3::from_fn(|_, _| gaussian(random)), 1e-6).unwrap_or(Vector3::x_axis())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_have_the_requested_size() {
        let bone = Bone { name: "arm".into(), parent: None, head: [1.0, 2.0, 3.0], tail: [1.0, 3.0, 3.0] };
        let mut random = fastrand::Rng::with_seed(3);
        let noise = BoneNoise { turn: 0.1, shift: 0.02 };
        let (mut turns, mut shifts) = (0.0, 0.0);
        for _ in 0..4000 {
            let wrong = noisy(std::slice::from_ref(&bone), &[Isometry3::identity()], noise, &mut random)[0];
            turns += wrong.rotation.angle().powi(2);
            shifts += (wrong.transform_point(&bone.head.into()).coords - Vector3::from(bone.head)).norm_squared();
        }
        assert!(((turns / 4000.0).sqrt() / 0.1 - 1.0).abs() < 0.05, "{turns}");
        assert!(((shifts / 12000.0).sqrt() / 0.02 - 1.0).abs() < 0.05, "{shifts}");
        let none = noisy(&[bone], &[Isometry3::identity()], BoneNoise::default(), &mut random)[0];
        assert!((none.to_homogeneous() - nalgebra::Matrix4::identity()).norm() < 1e-14);
    }
}
