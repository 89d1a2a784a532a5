//! Motions of bones from the joints of a body tracker.

use std::path::{Path, PathBuf};

use nalgebra::{Isometry3, Matrix3, Quaternion, Rotation3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use super::joint_mapping::{BodyTracker, JointMapping};
use super::matching::matched;
use super::stored::Skeleton;
use crate::body::Bone;
use crate::json_file::{JsonFileError, read_json};

/// A file of joints that cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum JointTrackError {
    /// The file cannot be read or is malformed.
    #[error(transparent)]
    Json(#[from] JsonFileError),
    /// The contents do not fit together, or do not fit the model.
    #[error("{}: {fault}", .path.display())]
    Fault {
        /// Path of the file.
        path: PathBuf,
        /// Description of the error.
        fault: String,
    },
}

/// Joints of a body tracker in the depth camera's coordinates (x right, y down, z forwards).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct JointTrack {
    /// Names of the joints.
    pub joints: Vec<String>,
    /// Position of each joint, by frame, then joint; `None` for a joint that was not found.
    pub positions: Vec<Vec<Option<[f64; 3]>>>,
    /// Unit quaternion (w, x, y, z) of each joint, by frame, then joint; `None` without orientations.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub orientations: Option<Vec<Vec<Option<[f64; 4]>>>>,
    /// Time of each frame in s, on the clock of the images; `None` if frames belong to images by their order.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub timestamps: Option<Vec<f64>>,
    /// Units of the positions per metre: 1 for metres, 1000 for millimetres.
    #[serde(default = "metres")]
    pub units_per_metre: f64,
    /// Body tracker whose built-in mapping is used; `None` if there is a mapping.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tracker: Option<BodyTracker>,
    /// Joints of each bone; `None` if there is a tracker.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mapping: Option<JointMapping>,
}

fn metres() -> f64 {
    1.0
}

/// Indices of the joints of a bone.
struct Indices {
    head: Vec<usize>,
    tail: Vec<usize>,
    side: Option<[usize; 2]>,
}

/// Head, direction and side of a bone in a frame, and the orientation of its joint.
struct Placed {
    head: Vector3<f64>,
    along: Vector3<f64>,
    side: Option<Vector3<f64>>,
    orientation: Option<UnitQuaternion<f64>>,
}

impl JointTrack {
    /// Reads a file and checks its contents.
    ///
    /// # Errors
    /// If the file cannot be read or is malformed, or its parts do not fit together.
    pub fn read(path: &Path) -> Result<Self, JointTrackError> {
        let track: Self = read_json(path)?;
        track.check().map_err(|fault| JointTrackError::Fault { path: path.into(), fault })?;
        Ok(track)
    }

    fn check(&self) -> Result<(), String> {
        let (frames, count) = (self.positions.len(), self.joints.len());
        let scale = self.units_per_metre;
        if !(scale > 0.0 && scale.is_finite()) {
            return Err(format!("units_per_metre: expected a number greater than 0, got {scale}"));
        }
        if self.tracker.is_some() == self.mapping.is_some() {
            return Err("expected either `tracker` (azure-kinect, mediapipe or coco) or `mapping`".into());
        }
        if let Some(frame) = self.positions.iter().position(|joints| joints.len() != count) {
            let found = self.positions[frame].len();
            return Err(format!("frame {frame}: expected {count} positions, one per joint, got {found}"));
        }
        if let Some(orientations) = &self.orientations {
            let fits = orientations.len() == frames && orientations.iter().all(|joints| joints.len() == count);
            if !fits {
                return Err(format!("expected orientations for {frames} frames of {count} joints; use null for none"));
            }
        }
        Ok(())
    }

    /// Converts joints to motions of a model's bones. The model is at rest in the first image, so that motions are
    /// those from the joints of its frame: the first one, or the one of the nearest timestamp. `times` are the images'
    /// timestamps, and `path` is the file, for messages.
    ///
    /// A bone keeps its place relative to its head joint. It turns as its joint's orientation; without one, by the
    /// rotation that takes its direction and its side there; without a side, by its parent's rotation and then the
    /// smallest to its direction. A bone without joints moves with its parent. A frame without the root's joints has
    /// no bones.
    ///
    /// # Errors
    /// If the mapping names an unknown bone or joint, lacks the root, or a joint is missing at rest.
    pub fn skeleton(&self, path: &Path, bones: &[Bone], times: Option<&[f64]>) -> Result<Skeleton, JointTrackError> {
        self.convert(bones, times).map_err(|fault| JointTrackError::Fault { path: path.into(), fault })
    }

    fn convert(&self, bones: &[Bone], times: Option<&[f64]>) -> Result<Skeleton, String> {
        let indices = self.indices(bones)?;
        let rest = match (&self.timestamps, times) {
            (Some(own), Some(times)) => matched(own, times).first().copied().flatten().ok_or(
                "no frame is within half a frame of the first image, which shows the model at rest; \
                 expected the clock of the images, in s",
            )?,
            _ => 0,
        };
        if rest >= self.positions.len() {
            return Err("expected at least one frame of positions".into());
        }
        let mut at_rest = Vec::new();
        for (bone, indices) in bones.iter().zip(&indices) {
            let placed = indices.as_ref().map(|indices| {
                self.placed(rest, indices).ok_or_else(|| {
                    format!(
                        "frame {rest}: a joint of bone `{}` is missing or coincides with another, but the model is at \
                         rest in this frame; begin where all joints are found",
                        bone.name
                    )
                })
            });
            at_rest.push(placed.transpose()?);
        }
        let mut skeleton = Skeleton { timestamps: self.timestamps.clone(), ..Skeleton::of(bones) };
        for frame in 0..self.positions.len() {
            let motions = self.motions(frame, bones, &indices, &at_rest);
            skeleton.push(&motions.unwrap_or_default());
        }
        Ok(skeleton)
    }

    /// Returns the joints of each bone; `None` for a bone that moves with its parent.
    fn indices(&self, bones: &[Bone]) -> Result<Vec<Option<Indices>>, String> {
        let mapping = match (self.tracker, &self.mapping) {
            (Some(tracker), _) => tracker.mapping(),
            (None, mapping) => mapping.clone().unwrap_or_default(),
        };
        let names = || bones.iter().map(|bone| bone.name.as_str()).collect::<Vec<_>>().join(", ");
        if self.tracker.is_none()
            && let Some(bone) = mapping.keys().find(|key| bones.iter().all(|bone| bone.name != **key))
        {
            return Err(format!("mapping: the model has no bone `{bone}`; it has {}", names()));
        }
        let normal = |name: &str| name.to_lowercase().trim_start_matches("k4abt_joint_").to_owned();
        let own: Vec<String> = self.joints.iter().map(|name| normal(name)).collect();
        let joint = |bone: &str, name: &String| {
            let at = own.iter().position(|own| *own == normal(name));
            at.ok_or_else(|| format!("bone `{bone}` needs the joint `{name}`; the file has {}", self.joints.join(", ")))
        };
        let mut all = Vec::new();
        for bone in bones {
            let Some(joints) = mapping.get(&bone.name) else {
                if bone.parent.is_none() {
                    let root = &bone.name;
                    return Err(format!("the mapping lacks `{root}`, a root of the model, which has {}", names()));
                }
                all.push(None);
                continue;
            };
            let list =
                |names: &[String]| names.iter().map(|name| joint(&bone.name, name)).collect::<Result<Vec<_>, _>>();
            let (head, tail) = (list(&joints.head)?, list(&joints.tail)?);
            if head.is_empty() || tail.is_empty() {
                return Err(format!("mapping: bone `{}` needs at least one joint for head and for tail", bone.name));
            }
            let side = match &joints.side {
                Some([right, left]) => Some([joint(&bone.name, right)?, joint(&bone.name, left)?]),
                None => None,
            };
            all.push(Some(Indices { head, tail, side }));
        }
        Ok(all)
    }

    /// Returns a bone's place in a frame; `None` if a joint is missing, not finite, or coincides with another.
    fn placed(&self, frame: usize, Indices { head, tail, side }: &Indices) -> Option<Placed> {
        let place = |joint: usize| {
            let place = Vector3::from(self.positions[frame][joint]?) / self.units_per_metre;
            place.iter().all(|x| x.is_finite()).then_some(place)
        };
        let mean = |joints: &[usize]| {
            let sum: Option<Vector3<f64>> = joints.iter().map(|&joint| place(joint)).sum();
            sum.map(|sum| sum / joints.len() as f64)
        };
        let head_place = mean(head)?;
        let along = (mean(tail)? - head_place).try_normalize(1e-6)?;
        let across = |[right, left]: [usize; 2]| {
            let across = place(left)? - place(right)?;
            (across - along * along.dot(&across)).try_normalize(1e-6)
        };
        let side = side.and_then(across);
        let orientation = match (&self.orientations, head.as_slice()) {
            (Some(all), &[joint]) => all[frame][joint].and_then(rotation),
            _ => None,
        };
        Some(Placed { head: head_place, along, side, orientation })
    }

    /// Returns the motions of the bones from rest; `None` if a root has no place.
    fn motions(
        &self,
        frame: usize,
        bones: &[Bone],
        indices: &[Option<Indices>],
        at_rest: &[Option<Placed>],
    ) -> Option<Vec<Isometry3<f64>>> {
        let mut motions: Vec<Isometry3<f64>> = Vec::with_capacity(bones.len());
        for (bone, (indices, rest)) in bones.iter().zip(indices.iter().zip(at_rest)) {
            let parent = bone.parent.map(|parent| motions[parent]);
            let now = indices.as_ref().and_then(|indices| self.placed(frame, indices));
            let motion = match (rest, now) {
                (Some(rest), Some(now)) => {
                    let before = parent.map_or(UnitQuaternion::identity(), |parent| parent.rotation);
                    let rotation = turned(rest, &now, before);
                    Isometry3::from_parts((now.head - rotation * rest.head).into(), rotation)
                }
                _ => parent?,
            };
            motions.push(motion);
        }
        Some(motions)
    }
}

/// Returns the rotation of a bone from rest.
fn turned(rest: &Placed, now: &Placed, parent: UnitQuaternion<f64>) -> UnitQuaternion<f64> {
    if let (Some(rest), Some(now)) = (rest.orientation, now.orientation) {
        return now * rest.inverse();
    }
    if let (Some(side), Some(side_now)) = (rest.side, now.side) {
        let axes = |along: Vector3<f64>, side: Vector3<f64>| Matrix3::from_columns(&[along, side, along.cross(&side)]);
        let matrix = axes(now.along, side_now) * axes(rest.along, side).transpose();
        return UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(matrix));
    }
    let carried = parent * rest.along;
    // Opposite directions have no smallest rotation; the parent's is as good as any.
    UnitQuaternion::rotation_between(&carried, &now.along).unwrap_or_default() * parent
}

/// Returns the rotation of a quaternion (w, x, y, z); `None` if it is not a unit quaternion.
fn rotation([w, x, y, z]: [f64; 4]) -> Option<UnitQuaternion<f64>> {
    let q = Quaternion::new(w, x, y, z);
    ((q.norm() - 1.0).abs() < 1e-2).then(|| UnitQuaternion::from_quaternion(q))
}
