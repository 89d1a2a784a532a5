use nalgebra::{Isometry3, Translation3, Unit, UnitQuaternion, Vector3};

use crate::body::Bone;

/// How wrong a body tracker's bones are.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct BoneNoise {
    /// Each bone is turned by this about its joint, about a random axis, rad.
    pub turn: f64,
    /// And shifted by this in a random direction, m.
    pub shift: f64,
}

/// Motions with errors, anew for every bone and call.
#[must_use]
pub fn noisy(
    bones: &[Bone],
    motions: &[Isometry3<f64>],
    noise: BoneNoise,
    random: &mut fastrand::Rng,
) -> Vec<Isometry3<f64>> {
    let mut one = |(bone, motion): (&Bone, &Isometry3<f64>)| {
        let joint = motion.transform_point(&bone.head.into()).coords;
        let turn = UnitQuaternion::from_axis_angle(&direction(random), noise.turn);
        let shift = noise.shift * *direction(random);
        Isometry3::from_parts(Translation3::from(joint - turn * joint + shift), turn) * motion
    };
    bones.iter().zip(motions).map(&mut one).collect()
}

fn direction(random: &mut fastrand::Rng) -> Unit<Vector3<f64>> {
    loop {
        let v = Vector3::from_fn(|_, _| 2.0 * random.f64() - 1.0);
        if (0.01..=1.0).contains(&v.norm()) {
            return Unit::new_normalize(v);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_as_large_as_asked_for() {
        let bone = Bone { name: "arm".into(), parent: None, head: [1.0, 2.0, 3.0], tail: [1.0, 3.0, 3.0] };
        let mut random = fastrand::Rng::with_seed(3);
        let noise = BoneNoise { turn: 0.1, shift: 0.02 };
        let wrong = noisy(&[bone.clone()], &[Isometry3::identity()], noise, &mut random)[0];
        assert!((wrong.rotation.angle() - 0.1).abs() < 1e-12);
        let joint = wrong.transform_point(&bone.head.into()).coords - Vector3::from(bone.head);
        assert!((joint.norm() - 0.02).abs() < 1e-12);
        let none = noisy(&[bone], &[Isometry3::identity()], BoneNoise::default(), &mut random)[0];
        assert!((none.to_homogeneous() - nalgebra::Matrix4::identity()).norm() < 1e-14);
    }
}
