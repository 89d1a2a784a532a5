use std::path::{Path, PathBuf};

use energy_files::excerpt;
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use serde::{Deserialize, Serialize};

use super::matching::matched;
use crate::body::{Bone, FARTHEST};
use crate::json_file::{JsonFileError, read_json, write_json};

/// A file of a skeleton that cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SkeletonError {
    /// The file cannot be read or written, or is malformed.
    #[error(transparent)]
    Json(#[from] JsonFileError),
    /// The skeleton lacks a bone that the model's weights use.
    #[error("the skeleton has no bone `{bone}`, which the model's weights refer to; it has {known}")]
    MissingBone {
        /// Name of the bone.
        bone: String,
        /// Names of the skeleton's bones.
        known: String,
    },
    /// There are fewer frames than images.
    #[error(
        "{}: expected bones for each of {images} images, got {frames} frames; complete the skeleton, shorten \
         depth.txt, add timestamps, or track without bones",
        .path.display()
    )]
    TooShort {
        /// Path of the file.
        path: PathBuf,
        /// Number of images.
        images: usize,
        /// Number of frames.
        frames: usize,
    },
    /// The timestamps cannot be used.
    #[error("{}: {fault}", .path.display())]
    Timestamps {
        /// Path of the file.
        path: PathBuf,
        /// Description of the error.
        fault: String,
    },
    /// A frame has too few bones, or a number that is not finite.
    #[error("frame {frame}: expected a finite unit quaternion and translation for every bone")]
    BadFrame {
        /// Index of the frame.
        frame: usize,
    },
}

/// Bones of a body tracker: for each frame, the motion of each bone from the model's rest.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Skeleton {
    /// Names of the bones.
    pub bones: Vec<String>,
    /// Unit quaternion and translation in m, (w, x, y, z | x, y, z), by frame, then bone.
    /// An empty list is a frame without bones.
    pub frames: Vec<Vec<[f64; 7]>>,
    /// Time of each frame in s, on the clock of the images; `None` if frames belong to images by their order.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub timestamps: Option<Vec<f64>>,
}

impl Skeleton {
    /// Creates a skeleton of these bones without frames.
    #[must_use]
    pub fn of(bones: &[Bone]) -> Self {
        Self { bones: bones.iter().map(|bone| bone.name.clone()).collect(), frames: Vec::new(), timestamps: None }
    }

    /// Adds a frame.
    pub fn push(&mut self, motions: &[Isometry3<f64>]) {
        let numbers = |motion: &Isometry3<f64>| {
            let (q, t) = (motion.rotation, motion.translation);
            [q.w, q.i, q.j, q.k, t.x, t.y, t.z]
        };
        self.frames.push(motions.iter().map(numbers).collect());
    }

    /// Returns the motions of a model's bones in a frame, in the model's order; `None` for a frame without bones
    /// and past the last frame.
    ///
    /// # Errors
    /// If a bone is missing, or a number is not finite.
    pub fn motions(&self, frame: usize, bones: &[Bone]) -> Result<Option<Vec<Isometry3<f64>>>, SkeletonError> {
        let Some(numbers) = self.frames.get(frame).filter(|numbers| !numbers.is_empty()) else { return Ok(None) };
        let motion = |bone: &Bone| {
            let at = self.bones.iter().position(|name| *name == bone.name).ok_or_else(|| {
                let known = excerpt(&self.bones.join(", ")).into_owned();
                SkeletonError::MissingBone { bone: bone.name.clone(), known }
            })?;
            let bad = SkeletonError::BadFrame { frame };
            let Some(&[w, i, j, k, x, y, z]) = numbers.get(at) else { return Err(bad) };
            let q = Quaternion::new(w, i, j, k);
            if !((q.norm() - 1.0).abs() < 1e-3 && [x, y, z].iter().all(|t| t.abs() <= FARTHEST)) {
                return Err(bad);
            }
            Ok(Isometry3::from_parts(Translation3::new(x, y, z), UnitQuaternion::from_quaternion(q)))
        };
        bones.iter().map(motion).collect::<Result<_, _>>().map(Some)
    }

    /// Returns a skeleton with one frame per image: those of the nearest timestamps, or the same order if the skeleton
    /// has no timestamps. Images without bones get a frame without bones. `times` are the images' timestamps; `path` is
    /// the skeleton's file, for messages.
    ///
    /// # Errors
    /// If timestamps cannot be used or match no image, or there are too few frames without timestamps.
    pub fn for_images(self, path: &Path, images: usize, times: Option<&[f64]>) -> Result<Self, SkeletonError> {
        let Some(own) = &self.timestamps else {
            let frames = self.frames.len();
            return if frames < images {
                Err(SkeletonError::TooShort { path: path.into(), images, frames })
            } else {
                Ok(self)
            };
        };
        let wrong = |fault: String| SkeletonError::Timestamps { path: path.into(), fault };
        if own.len() != self.frames.len() {
            return Err(wrong(format!("expected {} timestamps, one per frame, got {}", self.frames.len(), own.len())));
        }
        if let Some(time) = own.iter().find(|time| !time.is_finite()) {
            return Err(wrong(format!("expected finite timestamps in s, got {time}")));
        }
        let Some(times) = times else {
            return Err(wrong(
                "has timestamps, but the images have none; add depth.txt, or remove `timestamps`".into(),
            ));
        };
        let entries = matched(own, times);
        if let (true, &[first, .., last]) = (entries.iter().all(Option::is_none), times) {
            return Err(wrong(format!(
                "no timestamp is within half a frame of an image; images are from {first} s to {last} s, bones from {} \
                 s to {} s; expected the same clock, in s",
                own.iter().fold(f64::INFINITY, |least, &time| least.min(time)),
                own.iter().fold(f64::NEG_INFINITY, |most, &time| most.max(time)),
            )));
        }
        let frame = |entry: Option<usize>| entry.map(|entry| self.frames[entry].clone()).unwrap_or_default();
        Ok(Self { frames: entries.into_iter().map(frame).collect(), bones: self.bones, timestamps: None })
    }

    /// Reads a file.
    ///
    /// # Errors
    /// If the file cannot be read or is malformed.
    pub fn read(path: &Path) -> Result<Self, SkeletonError> {
        Ok(read_json(path)?)
    }

    /// Writes a file completely or not at all.
    ///
    /// # Errors
    /// If a number is not finite, which JSON cannot represent, or the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), SkeletonError> {
        let is_finite = |frame: &[[f64; 7]]| frame.as_flattened().iter().all(|x| x.is_finite());
        if let Some(frame) = self.frames.iter().position(|frame| !is_finite(frame)) {
            return Err(SkeletonError::BadFrame { frame });
        }
        Ok(write_json(path, self)?)
    }
}
