//! The state of a tracker between two frames.

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use serde::{Deserialize, Serialize};

use super::Tracker;
use super::prediction::PredictionState;
use crate::twist::Twist;

/// Everything that a frame leaves for the next one. A tracker of the same model and options that is
/// [restored](Tracker::restore) to it continues bit by bit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrackerState {
    twists: Vec<Twist>,
    offsets: Vec<StoredMotion>,
    node_prediction: PredictionState,
    bone_prediction: PredictionState,
    bone_trust: f64,
}

/// A state that does not fit the tracker.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum TrackerStateError {
    /// The state is that of another model.
    #[error("the state has {found} {what}, the tracker {expected}; it belongs to another model or other options")]
    OtherModel {
        /// The kind of numbers.
        what: &'static str,
        /// Count of the tracker.
        expected: usize,
        /// Count of the state.
        found: usize,
    },
    /// A number is infinite or NaN.
    #[error("the state has a number among its {what} that is not finite")]
    NonFinite {
        /// The kind of numbers.
        what: &'static str,
    },
}

/// A motion with the bits of its quaternion (w, x, y, z) and its translation.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct StoredMotion(pub [f64; 7]);

impl From<&Isometry3<f64>> for StoredMotion {
    fn from(motion: &Isometry3<f64>) -> Self {
        let (q, t) = (motion.rotation, motion.translation);
        Self([q.w, q.i, q.j, q.k, t.x, t.y, t.z])
    }
}

impl From<StoredMotion> for Isometry3<f64> {
    fn from(StoredMotion([w, i, j, k, x, y, z]): StoredMotion) -> Self {
        // Normalised before; another time would change bits.
        let rotation = UnitQuaternion::new_unchecked(Quaternion::new(w, i, j, k));
        Self::from_parts(Translation3::new(x, y, z), rotation)
    }
}

impl Tracker {
    /// Returns the state after the last frame.
    #[must_use]
    pub fn state(&self) -> TrackerState {
        TrackerState {
            twists: self.twists.clone(),
            offsets: self.offsets.iter().map(StoredMotion::from).collect(),
            node_prediction: self.node_prediction.state(),
            bone_prediction: self.bone_prediction.state(),
            bone_trust: self.bone_trust.square(),
        }
    }

    /// Continues from a state of a tracker of the same model, camera and options.
    ///
    /// # Errors
    /// If the state has other counts, or a number that is not finite. The tracker is then unchanged.
    pub fn restore(&mut self, state: &TrackerState) -> Result<(), TrackerStateError> {
        let TrackerState { twists, offsets, node_prediction, bone_prediction, bone_trust } = state;
        let fits = |what: &'static str, expected: usize, found: usize| match expected == found {
            true => Ok(()),
            false => Err(TrackerStateError::OtherModel { what, expected, found }),
        };
        fits("twists", self.twists.len(), twists.len())?;
        fits("offsets", self.offsets.len(), offsets.len())?;
        for (own, stored) in [(&self.node_prediction, node_prediction), (&self.bone_prediction, bone_prediction)] {
            let (expected, [last, velocities]) = (own.len(), stored.lengths());
            fits("predicted motions", expected, last)?;
            fits("velocities", expected, velocities)?;
        }
        let finite = |what: &'static str, numbers: &[f64]| match numbers.iter().all(|x| x.is_finite()) {
            true => Ok(()),
            false => Err(TrackerStateError::NonFinite { what }),
        };
        let predicted: Vec<f64> = node_prediction.numbers().chain(bone_prediction.numbers()).collect();
        finite("twists", twists.as_flattened())?;
        finite("offsets", &offsets.iter().flat_map(|motion| motion.0).collect::<Vec<f64>>())?;
        finite("predictions", &predicted)?;
        finite("trusts in bones", &[*bone_trust])?;
        self.twists.clone_from(twists);
        self.offsets = offsets.iter().map(|&motion| motion.into()).collect();
        self.node_prediction.restore(node_prediction);
        self.bone_prediction.restore(bone_prediction);
        self.bone_trust.restore(*bone_trust);
        Ok(())
    }
}
