use energy_dsl::Vector3;
use energy_solve::{Counts, EvaluationError, Tally};
use serde::{Deserialize, Serialize};

use super::island::{Island, SavedIsland};
use super::{Simulation, SimulationError, Totals};
use crate::ledger::Ledger;

/// The complete state of a simulation, from which it can resume bit-identically.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SavedState {
    /// CRC-32 of the masses of all vertices; detects a checkpoint of a different mesh.
    pub masses_checksum: u32,
    /// Totals up to this state.
    #[serde(flatten)]
    pub totals: Totals,
    /// Positions, in m.
    pub x: Vec<Vector3<f64>>,
    /// Velocities, in m/s.
    pub v: Vec<Vector3<f64>>,
    /// Per island: the integrator's history and the sleep state.
    pub islands: Vec<SavedIsland>,
    /// The energy ledger; `None` if none is kept.
    pub ledger: Option<Ledger>,
    /// Evaluation counts of each term.
    pub counts: Vec<SavedCounts>,
    /// Constant Hessians reused by each term; see [`Counts::reused`].
    pub reused: Vec<u64>,
}

/// Evaluation counts of a term, without [`Counts::reused`]. One row each for value, gradient and Hessian, with the
/// numbers evaluated, skipped, flagged and projected.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SavedCounts([[u64; 4]; 3]);

impl From<Counts> for SavedCounts {
    fn from(counts: Counts) -> Self {
        let row = |tally: Tally| [tally.evaluated, tally.skipped, tally.flagged, tally.projected];
        Self([counts.value, counts.gradient, counts.hessian].map(row))
    }
}

impl From<SavedCounts> for Counts {
    fn from(SavedCounts(rows): SavedCounts) -> Self {
        let tally =
            |[evaluated, skipped, flagged, projected]: [u64; 4]| Tally { evaluated, skipped, flagged, projected };
        let mut counts = Self::default();
        [counts.value, counts.gradient, counts.hessian] = rows.map(tally);
        counts
    }
}

impl SavedState {
    /// Returns the same state for a simulation whose steps have another size, after `steps` of them. It has no ledger,
    /// its totals begin at 0, and integrators forget their history.
    #[must_use]
    pub fn after_other_steps(mut self, steps: u64) -> Self {
        self.totals = Totals { steps, ..Totals::default() };
        self.ledger = None;
        self.islands.iter_mut().for_each(SavedIsland::forget_integrator);
        self
    }
}

/// Serialises optional [`Counts`] as [`SavedCounts`], for `#[serde(with)]`.
pub(super) mod saved_counts {
    use super::{Counts, SavedCounts};
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub(in crate::simulation) fn serialize<S: Serializer>(
        counts: &Option<Counts>,
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        counts.map(SavedCounts::from).serialize(serializer)
    }

    pub(in crate::simulation) fn deserialize<'de, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<Option<Counts>, D::Error> {
        Ok(Option::<SavedCounts>::deserialize(deserializer)?.map(Counts::from))
    }
}

/// A saved state that cannot be restored into a simulation.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RestoreError {
    /// The state has other vertices, masses, islands or terms than the scene.
    #[error(
        "the checkpoint belongs to a different scene: it has {found} vertices, the scene has {expected}. \
         Did a mesh or material file change?"
    )]
    OtherScene {
        /// Vertices of the scene.
        expected: usize,
        /// Vertices of the saved state.
        found: usize,
    },
    /// The ledger of the state has other columns or islands than the scene.
    #[error("the ledger of the checkpoint does not fit the scene")]
    OtherLedger,
    /// The scene cannot be assembled without the pins that have let go.
    #[error("cannot release pins: {source}")]
    Release {
        /// Why the pins cannot be released.
        source: Box<SimulationError>,
    },
    /// A term cannot be evaluated at the saved state.
    #[error("cannot evaluate the saved state: {source}")]
    Unfit {
        /// The failed evaluation.
        source: EvaluationError,
    },
}

impl Simulation {
    /// Returns everything that the further motion depends on.
    #[must_use]
    pub fn save(&self) -> SavedState {
        let counts = self.counts();
        SavedState {
            masses_checksum: masses_checksum(&self.masses),
            totals: self.summary.totals.clone(),
            x: self.x.clone(),
            v: self.v.clone(),
            islands: self.islands.iter().map(Island::save).collect(),
            ledger: self.ledger.clone(),
            reused: counts.iter().map(|counts| counts.reused).collect(),
            counts: counts.into_iter().map(Into::into).collect(),
        }
    }

    /// Resumes from a saved state of the same scene, bit-identical to an uninterrupted simulation.
    ///
    /// # Errors
    /// Returns an error if the state belongs to a different scene, or a term cannot be evaluated there.
    pub fn restore(&mut self, saved: SavedState) -> Result<(), RestoreError> {
        if saved.totals.steps > 0 {
            // The pins are those of the last step.
            let time = self.just_after((saved.totals.steps - 1) as f64 * self.dt);
            if !self.is_assembled_for(time) {
                self.assemble_for(time).map_err(|source| RestoreError::Release { source: Box::new(source) })?;
            }
        }
        self.restore_state(saved)
    }

    /// Restores a state of the scene as it is assembled.
    pub(super) fn restore_state(&mut self, saved: SavedState) -> Result<(), RestoreError> {
        self.check_scene(&saved)?;
        (self.x, self.v) = (saved.x, saved.v);
        self.ledger = saved.ledger;
        self.summary.totals = saved.totals;
        self.earlier = saved.counts.into_iter().map(Counts::from).collect();
        self.earlier.iter_mut().zip(saved.reused).for_each(|(counts, reused)| counts.reused = reused);
        // Begin the last step again: obstacles stay where it moved them.
        let (time, dt) = (self.time() - self.dt, self.dt);
        for (island, saved) in self.islands.iter_mut().zip(saved.islands) {
            island.restore(saved);
            island.gather(&self.x, &self.v);
            island.begin_step(time, dt).map_err(|source| RestoreError::Unfit { source })?;
        }
        Ok(())
    }

    fn check_scene(&self, saved: &SavedState) -> Result<(), RestoreError> {
        let (expected, found) = (self.x.len(), saved.x.len());
        let sizes = [saved.v.len(), saved.islands.len(), saved.counts.len(), saved.reused.len()];
        let terms = self.labels.len();
        let fits = expected == found && sizes == [expected, self.islands.len(), terms, terms];
        let known = saved.masses_checksum == masses_checksum(&self.masses)
            || self.controlled.earlier_masses.contains(&saved.masses_checksum);
        match saved.ledger.as_ref().is_none_or(|ledger| ledger.fits(self.islands.len())) {
            _ if !(fits && known) => Err(RestoreError::OtherScene { expected, found }),
            false => Err(RestoreError::OtherLedger),
            true => Ok(()),
        }
    }
}

pub(super) fn masses_checksum(masses: &[f64]) -> u32 {
    let bytes: Vec<u8> = masses.iter().flat_map(|mass| mass.to_le_bytes()).collect();
    crc32fast::hash(&bytes)
}
