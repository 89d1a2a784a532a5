use std::f64::consts::FRAC_PI_2;

use serde::{Deserialize, Serialize};

use crate::correspondence::Gates;
use crate::energy::{BoneMode, EnergyOptions};
use crate::option_error::OptionError;

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
    /// Largest number of searches per frame.
    const MOST_ITERATIONS: usize = 1000;

    /// Checks every option.
    ///
    /// # Errors
    /// Names the first option that cannot be used.
    pub fn validate(&self) -> Result<(), OptionError> {
        let Self { energy, iterations, gates, first_distance, damping, least_matches } = self;
        energy.validate()?;
        let some = (1..=Self::MOST_ITERATIONS).contains(iterations);
        OptionError::ensure(some, "tracker.iterations", "a number from 1 to 1000", iterations)?;
        OptionError::ensure_positive("tracker.gates.distance", gates.distance)?;
        let acute = gates.angle > 0.0 && gates.angle <= FRAC_PI_2;
        OptionError::ensure(acute, "tracker.gates.angle", "an angle in rad, above 0 and at most π/2", gates.angle)?;
        let window = (1..=Gates::FURTHEST_REACH).contains(&gates.normal_reach);
        OptionError::ensure(window, "tracker.gates.normal_reach", "1 to 20 pixels", gates.normal_reach)?;
        OptionError::ensure_positive("tracker.first_distance", *first_distance)?;
        OptionError::ensure_not_negative("tracker.damping", *damping)?;
        OptionError::ensure(*least_matches > 0, "tracker.least_matches", "at least 1", least_matches)
    }

    /// Options for a body tracker with errors of a few degrees and centimetres: bones are unknowns, and searches reach
    /// further and are repeated more often.
    #[must_use]
    pub fn with_unknown_bones() -> Self {
        let mut options = Self { iterations: 12, first_distance: 0.1, ..Self::default() };
        options.energy.bones = BoneMode::Unknown;
        options
    }
}
