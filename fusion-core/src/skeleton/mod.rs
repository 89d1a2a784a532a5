//! Motions of a body's bones: from motion capture or files, and with the errors of body trackers.

mod bvh;
mod joint_mapping;
mod joints;
mod matching;
mod noise;
mod retarget;
mod stored;

pub use bvh::{Bvh, BvhError, Joint};
pub use joint_mapping::{BodyTracker, BoneJoints, JointMapping};
pub use joints::{JointTrack, JointTrackError};
pub use matching::{half_interval, matched};
pub use noise::{BoneNoise, noisy};
pub use retarget::{Retarget, RetargetError};
pub use stored::{Skeleton, SkeletonError};
