use std::f64::consts::FRAC_PI_2;

use serde::{Deserialize, Serialize};

use crate::correspondence::Gates;
use crate::energy::{BoneMode, EnergyOptions, TermWeights};
use crate::option_error::OptionError;

/// Options of a [`Tracker`](super::Tracker).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
#[non_exhaustive]
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
    /// Tolerance of conjugate gradients, relative to the right-hand side; `None` for a Cholesky factorisation.
    pub solver_tolerance: Option<f64>,
    /// Frames with fewer matches are skipped.
    pub least_matches: usize,
    /// Also match measured points that the body does not cover with its silhouette.
    pub silhouette: bool,
    /// Estimate the errors of reported bones from the track, and weigh unknown bones accordingly.
    pub adapt_prior: bool,
}

impl Default for TrackerOptions {
    fn default() -> Self {
        Self {
            energy: EnergyOptions { data_tukey: Some(0.05), ..EnergyOptions::default() },
            iterations: 6,
            gates: Gates::default(),
            first_distance: 0.06,
            damping: 1e-3,
            solver_tolerance: Some(0.01),
            least_matches: 50,
            silhouette: true,
            adapt_prior: true,
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
        let Self { energy, iterations, gates, first_distance, damping, solver_tolerance, least_matches, .. } = self;
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
        if let Some(tolerance) = *solver_tolerance {
            let part = tolerance > 0.0 && tolerance < 1.0;
            OptionError::ensure(part, "tracker.solver_tolerance", "a number between 0 and 1", tolerance)?;
        }
        OptionError::ensure(*least_matches > 0, "tracker.least_matches", "at least 1", least_matches)
    }

    /// Options for a body tracker with errors of a few degrees and centimetres: bones are unknowns, and searches reach
    /// further and are repeated more often.
    #[must_use]
    pub fn with_unknown_bones() -> Self {
        let mut options = Self { iterations: 6, first_distance: 0.1, ..Self::default() };
        options.energy.bones = BoneMode::Unknown;
        options.energy.weights = TermWeights { graph: 2.0, binding: 5.0, ..options.energy.weights };
        options
    }

    /// Stiffens the graph and the ties to bones, for the fusion of a surface: what the model lacks then stays in the
    /// surface at rest. Soft nodes would follow it as a motion.
    #[must_use]
    pub fn stiffened(mut self) -> Self {
        self.energy.weights.graph = 10.0;
        self.energy.weights.binding = 50.0;
        self.energy.normal_slack = 0.0;
        self
    }

    /// Options for tracking without bones: a stiffer graph takes the place of the bones.
    #[must_use]
    pub fn without_bones() -> Self {
        let mut options = Self::default();
        options.energy.weights.graph = 2.0;
        options
    }
}
