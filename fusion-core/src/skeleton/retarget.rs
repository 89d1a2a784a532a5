use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::bvh::Bvh;
use crate::body::Bone;

/// A motion that does not fit a body.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum RetargetError {
    /// No joint of the motion has the name of a bone.
    #[error("no joint of the motion has the name of a bone; its root is `{root}`, the body's is `{bone}`")]
    NothingInCommon {
        /// Root of the motion.
        root: String,
        /// Root of the body.
        bone: String,
    },
    /// The motion lacks the body's root, which determines the position of the body.
    #[error("the motion has no joint `{bone}`, the root of the body")]
    MissingRoot {
        /// Root of the body.
        bone: String,
    },
    /// A bone is not at a finite place: lengths of motion and body differ too much.
    #[error("frame {frame}: bone `{bone}` is not at a finite place; compare the units of motion and body")]
    NonFinite {
        /// Index of the frame.
        frame: usize,
        /// Name of the bone.
        bone: String,
    },
    /// The motion has no such frame.
    #[error("frame {frame} does not exist; the motion has {frames} frames")]
    NoFrame {
        /// Index of the frame.
        frame: usize,
        /// Number of frames.
        frames: usize,
    },
}

/// Transfer of a motion to a body with bones of the same names. The first frame of the motion is a T pose.
#[derive(Clone, Debug)]
pub struct Retarget<'a> {
    bones: &'a [Bone],
    motion: &'a Bvh,
    /// Joint of each bone.
    joints: Vec<Option<usize>>,
    /// Rotation of each bone from rest to the T pose.
    to_t_pose: Vec<UnitQuaternion<f64>>,
    t_pose: Vec<Isometry3<f64>>,
    /// Metres per unit of the motion, chosen so that legs have the same length.
    scale: f64,
}

impl<'a> Retarget<'a> {
    /// Finds the joint of each bone by its name. A bone without a joint moves with its parent; see [`Self::missing`].
    ///
    /// # Errors
    /// If the motion has no frames, or lacks the body's root.
    pub fn new(bones: &'a [Bone], motion: &'a Bvh) -> Result<Self, RetargetError> {
        let joints: Vec<Option<usize>> =
            bones.iter().map(|bone| motion.joints.iter().position(|joint| joint.name == bone.name)).collect();
        let root = || bones.first().map_or_else(String::new, |bone| bone.name.clone());
        if joints.iter().all(Option::is_none) {
            return Err(RetargetError::NothingInCommon { root: motion.joints[0].name.clone(), bone: root() });
        }
        if let Some((_, bone)) = joints.iter().zip(bones).find(|(joint, b)| joint.is_none() && b.parent.is_none()) {
            return Err(RetargetError::MissingRoot { bone: bone.name.clone() });
        }
        let t_pose = motion.pose(0).ok_or(RetargetError::NoFrame { frame: 0, frames: 0 })?;
        let to_t_pose = (0..bones.len()).map(|bone| aligned(bones, motion, &joints, &t_pose, bone)).collect();
        let scale = leg_ratio(bones, &joints, &t_pose);
        Ok(Self { bones, motion, joints, to_t_pose, t_pose, scale })
    }

    /// Returns the bones without a joint, which move with their parents.
    pub fn missing(&self) -> impl Iterator<Item = &'a str> {
        self.bones.iter().zip(&self.joints).filter(|(_, joint)| joint.is_none()).map(|(bone, _)| bone.name.as_str())
    }

    /// Returns the motion of each bone from rest to a frame. The root moves as the motion's root does from its position
    /// in the first frame.
    ///
    /// # Errors
    /// If the motion has no such frame, or a bone is not at a finite place.
    pub fn motions(&self, frame: usize) -> Result<Vec<Isometry3<f64>>, RetargetError> {
        let frames = self.motion.frames();
        let pose = self.motion.pose(frame).ok_or(RetargetError::NoFrame { frame, frames })?;
        let mut motions: Vec<Isometry3<f64>> = Vec::with_capacity(self.bones.len());
        for (bone, &joint) in self.joints.iter().enumerate() {
            let head = Vector3::from(self.bones[bone].head);
            let moved_head = match (self.bones[bone].parent, joint) {
                (Some(parent), _) => motions[parent].transform_point(&head.into()).coords,
                (None, Some(joint)) => {
                    head + self.scale * (pose[joint].translation.vector - self.t_pose[joint].translation.vector)
                }
                (None, None) => head,
            };
            let rotation = match (joint, self.bones[bone].parent) {
                (Some(j), _) => pose[j].rotation * self.t_pose[j].rotation.inverse() * self.to_t_pose[bone],
                (None, Some(parent)) => motions[parent].rotation,
                (None, None) => UnitQuaternion::identity(),
            };
            let motion = Isometry3::from_parts(Translation3::from(moved_head - rotation * head), rotation);
            if !is_finite(&motion) {
                return Err(RetargetError::NonFinite { frame, bone: self.bones[bone].name.clone() });
            }
            motions.push(motion);
        }
        Ok(motions)
    }
}

fn is_finite(motion: &Isometry3<f64>) -> bool {
    motion.translation.vector.iter().chain(motion.rotation.coords.iter()).all(|x| x.is_finite())
}

/// Returns the rotation of each bone from rest to the T pose. A limb rotates by the smallest angle to the direction of
/// its joint; other bones rotate as their parents, or not at all. Rigs draw trunks and hips differently, so that
/// directions are meaningful for limbs only: arms, thighs and legs, found by name.
fn aligned(
    bones: &[Bone],
    motion: &Bvh,
    joints: &[Option<usize>],
    t_pose: &[Isometry3<f64>],
    bone: usize,
) -> UnitQuaternion<f64> {
    const LIMBS: [&str; 4] = ["Arm", "ForeArm", "UpLeg", "Leg"];
    let Bone { name, parent, head, tail } = &bones[bone];
    let identity = UnitQuaternion::identity();
    let limb = LIMBS.iter().any(|limb| name.ends_with(limb));
    let child = joints[bone].and_then(|joint| motion.joints.iter().position(|other| other.parent == Some(joint)));
    if let (true, Some(joint), Some(child)) = (limb, joints[bone], child) {
        let own = Vector3::from(*tail) - Vector3::from(*head);
        let there = t_pose[child].translation.vector - t_pose[joint].translation.vector;
        return UnitQuaternion::rotation_between(&own, &there).unwrap_or(identity);
    }
    let of_limb = |name: &str| LIMBS.iter().any(|limb| name.ends_with(limb));
    // The end of a limb rotates with it: hands with the forearm. Feet do not rotate, because the body stands on them.
    match parent {
        Some(parent) if !name.contains("Foot") && !name.contains("Toe") => {
            let mut at = Some(*parent);
            while let Some(up) = at {
                if of_limb(&bones[up].name) {
                    return aligned(bones, motion, joints, t_pose, up);
                }
                at = bones[up].parent;
            }
            identity
        }
        _ => identity,
    }
}

/// Returns the ratio of leg lengths of body and motion, from the joints that both have.
fn leg_ratio(bones: &[Bone], joints: &[Option<usize>], t_pose: &[Isometry3<f64>]) -> f64 {
    let (mut own, mut there) = (0.0, 0.0);
    for (bone, joint) in bones.iter().zip(joints) {
        let (Some(parent), Some(joint)) = (bone.parent, joint) else { continue };
        let Some(parent_joint) = joints[parent] else { continue };
        if ["Leg", "Foot"].iter().any(|end| bone.name.ends_with(end)) && !bone.name.contains("Up") {
            own += (Vector3::from(bone.head) - Vector3::from(bones[parent].head)).norm();
            there += (t_pose[*joint].translation.vector - t_pose[parent_joint].translation.vector).norm();
        }
    }
    if there > 0.0 { own / there } else { 1.0 }
}
