//! Tables from the joints of common body trackers to bones.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// The joints that move a bone. Names are compared without regard to case.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BoneJoints {
    /// Joints whose mean the bone is fixed to. If it is a single joint with orientations, the bone turns with it.
    pub head: Vec<String>,
    /// Joints whose mean the bone points to.
    pub tail: Vec<String>,
    /// Two joints, from the right to the left of the body, that determine the rotation about the bone. `None` lets the
    /// bone turn with its parent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub side: Option<[String; 2]>,
}

/// The joints of each bone, by the bone's name.
pub type JointMapping = BTreeMap<String, BoneJoints>;

/// A body tracker with a built-in mapping.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum BodyTracker {
    /// Azure Kinect Body Tracking, 32 joints: `PELVIS`, `SPINE_NAVEL`, … (`K4ABT_JOINT_` is optional).
    AzureKinect,
    /// MediaPipe Pose, 33 landmarks: `nose`, `left_shoulder`, …
    Mediapipe,
    /// The 17 key points of COCO.
    Coco,
}

/// Bones, and the joints of head, tail and side. `{}` stands for the body's side.
type Row = (&'static [&'static str], &'static [&'static str], &'static [&'static str], Option<[&'static str; 2]>);

const KINECT: &[Row] = &[
    (&["Hips"], &["PELVIS"], &["SPINE_NAVEL"], Some(["HIP_RIGHT", "HIP_LEFT"])),
    (&["Spine", "LowerBack"], &["SPINE_NAVEL"], &["SPINE_CHEST"], None),
    (&["Chest", "Spine1"], &["SPINE_CHEST"], &["NECK"], Some(["CLAVICLE_RIGHT", "CLAVICLE_LEFT"])),
    (&["Neck"], &["NECK"], &["HEAD"], None),
    (&["Head"], &["HEAD"], &["NOSE"], Some(["EAR_RIGHT", "EAR_LEFT"])),
    (&["{}Shoulder"], &["CLAVICLE_{}"], &["SHOULDER_{}"], None),
    (&["{}Arm"], &["SHOULDER_{}"], &["ELBOW_{}"], None),
    (&["{}ForeArm"], &["ELBOW_{}"], &["WRIST_{}"], None),
    (&["{}Hand"], &["WRIST_{}"], &["HANDTIP_{}"], None),
    (&["{}UpLeg"], &["HIP_{}"], &["KNEE_{}"], None),
    (&["{}Leg"], &["KNEE_{}"], &["ANKLE_{}"], None),
    (&["{}Foot"], &["ANKLE_{}"], &["FOOT_{}"], None),
];

const COCO: &[Row] = &[
    (&["Hips"], HIPS, SHOULDERS, Some(["right_hip", "left_hip"])),
    (&["Spine", "LowerBack"], TRUNK, SHOULDERS, None),
    (&["Chest", "Spine1"], SHOULDERS, HIPS, Some(["right_shoulder", "left_shoulder"])),
    (&["Head"], &["left_ear", "right_ear"], &["nose"], Some(["right_ear", "left_ear"])),
    (&["{}Arm"], &["{}_shoulder"], &["{}_elbow"], None),
    (&["{}ForeArm"], &["{}_elbow"], &["{}_wrist"], None),
    (&["{}UpLeg"], &["{}_hip"], &["{}_knee"], None),
    (&["{}Leg"], &["{}_knee"], &["{}_ankle"], None),
];

/// Landmarks that MediaPipe has in addition to COCO.
const MEDIAPIPE: &[Row] =
    &[(&["{}Hand"], &["{}_wrist"], &["{}_index"], None), (&["{}Foot"], &["{}_ankle"], &["{}_foot_index"], None)];

const HIPS: &[&str] = &["left_hip", "right_hip"];
const SHOULDERS: &[&str] = &["left_shoulder", "right_shoulder"];
const TRUNK: &[&str] = &["left_hip", "right_hip", "left_shoulder", "right_shoulder"];

impl BodyTracker {
    /// Returns the mapping to bones with the names of Biovision's and CMU's skeletons: `Hips`, `LeftForeArm`, …
    #[must_use]
    pub fn mapping(self) -> JointMapping {
        let rows: Vec<&Row> = match self {
            Self::AzureKinect => KINECT.iter().collect(),
            Self::Mediapipe => COCO.iter().chain(MEDIAPIPE).collect(),
            Self::Coco => COCO.iter().collect(),
        };
        rows.into_iter().flat_map(expanded).collect()
    }
}

/// Returns the entries of a row: one per bone, and per side of a limb.
fn expanded((bones, head, tail, side): &Row) -> Vec<(String, BoneJoints)> {
    let mut all = Vec::new();
    for bone in *bones {
        let sides: &[&str] = if bone.contains("{}") { &["Left", "Right"] } else { &[""] };
        for body_side in sides {
            let named = |joints: &[&str]| -> Vec<String> {
                joints.iter().map(|joint| joint.replace("{}", body_side).to_lowercase()).collect()
            };
            let side = side.map(|pair| pair.map(str::to_lowercase));
            all.push((bone.replace("{}", body_side), BoneJoints { head: named(head), tail: named(tail), side }));
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limbs_have_the_joints_of_their_side() {
        let mapping = BodyTracker::AzureKinect.mapping();
        assert_eq!(mapping["LeftForeArm"].head, ["elbow_left"]);
        assert_eq!(mapping["RightForeArm"].tail, ["wrist_right"]);
        assert_eq!(mapping.len(), 6 + 1 + 2 * 7);
        let (media, coco) = (BodyTracker::Mediapipe.mapping(), BodyTracker::Coco.mapping());
        assert!(media["RightFoot"].tail == ["right_foot_index"] && !coco.contains_key("RightFoot"));
        assert!(coco.iter().all(|(bone, joints)| media[bone] == *joints));
    }
}
