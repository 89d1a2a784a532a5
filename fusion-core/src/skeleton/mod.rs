//! Motions of a body's bones: from motion capture or files, and with the errors of body trackers.

mod bvh;
mod noise;
mod retarget;
mod stored;

pub use bvh::{Bvh, BvhError, Joint};
pub use noise::{BoneNoise, noisy};
pub use retarget::{Retarget, RetargetError};
pub use stored::{Skeleton, SkeletonError};
