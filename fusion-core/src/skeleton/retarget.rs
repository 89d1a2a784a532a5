use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::bvh::Bvh;
use crate::body::Bone;

/// A motion that does not fit a body.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum RetargetError {
    /// None of the body's bones is in the motion.
    #[error("the motion has no joint of the name of any bone; its root is `{root}`, the body's is `{bone}`")]
    NothingInCommon {
        /// The motion's root.
        root: String,
        /// The body's.
        bone: String,
    },
    /// The root must be there: nothing else says where the body is.
    #[error("the motion has no joint `{bone}`, the root of the body")]
    MissingRoot {
        /// The body's root.
        bone: String,
    },
    /// There is no such frame.
    #[error("frame {frame} of {frames}")]
    NoFrame {
        /// The frame asked for.
        frame: usize,
        /// How many there are.
        frames: usize,
    },
}

/// A body's bones moved as the joints of the same names in a motion whose first frame is a T pose.
#[derive(Clone, Debug)]
pub struct Retarget<'a> {
    bones: &'a [Bone],
    motion: &'a Bvh,
    /// For each bone its joint.
    joints: Vec<Option<usize>>,
    /// What turns each bone from its rest to the T pose.
    to_t_pose: Vec<UnitQuaternion<f64>>,
    t_pose: Vec<Isometry3<f64>>,
    /// Metres in a unit of the motion, so that legs have the same length.
    scale: f64,
}

impl<'a> Retarget<'a> {
    /// Finds the joint of each bone by its name. A bone without one moves with its parent; see [`Self::missing`].
    ///
    /// # Errors
    /// When the motion has no frames, or lacks the body's root.
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

    /// The bones that move with their parents, for want of a joint.
    pub fn missing(&self) -> impl Iterator<Item = &'a str> {
        self.bones.iter().zip(&self.joints).filter(|(_, joint)| joint.is_none()).map(|(bone, _)| bone.name.as_str())
    }

    /// The motion of each bone from rest to a frame. The root goes where the motion's root goes, from its place in the first frame.
    ///
    /// # Errors
    /// When there is no such frame.
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
            motions.push(Isometry3::from_parts(Translation3::from(moved_head - rotation * head), rotation));
        }
        Ok(motions)
    }
}

/// The least turn from a limb's direction at rest to that of its joint in the T pose; a trunk's, or an end's, is as its parent's, or
/// none. Rigs draw trunks and hips differently, so that directions mean something for limbs only: arms, thighs, legs, by name.
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
    // What hangs on a limb's end turns with it: hands with the forearm, feet with nothing (they stand).
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

/// The body's legs over the motion's, as the lengths between joints that both have.
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
