use serde::{Deserialize, Serialize};

use crate::correspondence::Gates;
use crate::energy::{BoneMode, EnergyOptions};

/// Options of a [`Tracker`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TrackerOptions {
    /// Options of the energy.
    pub energy: EnergyOptions,
    /// Searches for correspondences per frame, each followed by one Gauss–Newton step.
    pub iterations: usize,
    /// Criteria of the last search.
    pub gates: Gates,
    /// Largest distance of a match in the first search, in m; it shrinks to that of the last.
    pub first_distance: f64,
    /// Levenberg's damping μ.
    pub damping: f64,
    /// Frames with fewer matches are skipped.
    pub least_matches: usize,
}

impl Default for TrackerOptions {
    fn default() -> Self {
        Self {
            energy: EnergyOptions { data_tukey: Some(0.05), ..EnergyOptions::default() },
            iterations: 6,
            gates: Gates::default(),
            first_distance: 0.06,
            damping: 1e-3,
            least_matches: 50,
        }
    }
}

impl TrackerOptions {
    /// Options for a body tracker with errors of a few degrees and centimetres: bones are unknowns, and searches reach
    /// further and are repeated more often.
    #[must_use]
    pub fn with_unknown_bones() -> Self {
        let mut options = Self { iterations: 12, first_distance: 0.1, ..Self::default() };
        options.energy.bones = BoneMode::Unknown;
        options
    }
}
