use std::time::Duration;

use serde::{Deserialize, Serialize};

use crate::contact::Passage;
use crate::integrator::{ContactWork, Phases, SolvedBy, StepReport};

/// Running totals over all steps. Summaries and checkpoints hold these as keys of their own.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Totals {
    /// Completed steps.
    pub steps: u64,
    /// Linear systems solved.
    pub solves: u64,
    /// Linear systems of local eliminations, which are not among the solves.
    #[serde(default)]
    pub local_solves: u64,
    /// The sum of the numbers of their vertices.
    #[serde(default)]
    pub local_vertices: u64,
    /// Solves of symmetric systems, by linear solver.
    #[serde(default)]
    pub solved_by: SolvedBy,
    /// Iterations of the linear solver.
    pub iterations: u64,
    /// Evaluations of the energy of all vertices; see [`crate::integrator::Newton`].
    #[serde(default)]
    pub energies: u64,
    /// Halvings by the line search of Newton's method.
    #[serde(default)]
    pub halvings: u64,
    /// Steps that needed Hessians projected to positive semi-definite; see [`crate::integrator::Newton`].
    pub projected: u64,
    /// Steps rejected and retried with a smaller step size; see [`crate::integrator::Adaptive`].
    pub rejected: u64,
    /// Steps skipped by sleeping islands, summed over the islands.
    #[serde(default)]
    pub slept: u64,
    /// The work of certified contact.
    #[serde(default)]
    pub contact: ContactWork,
    /// Frames that were checked for crossings.
    #[serde(default)]
    pub checked_frames: u64,
    /// Frames of these in which cloth or hair crosses itself or an obstacle.
    #[serde(default)]
    pub crossed_frames: u64,
    /// Vertices that passed through obstacles, one entry for each obstacle that any passed through.
    #[serde(default)]
    pub passages: Vec<Passage>,
    /// Wall time of all steps.
    pub stepping_time: Duration,
    /// Wall time by phase; zero for integrators that do not report it.
    pub phases: Phases,
}

impl Totals {
    /// Adds passages through an obstacle.
    pub(super) fn note(&mut self, passage: Passage) {
        match self.passages.iter_mut().find(|known| known.obstacle == passage.obstacle) {
            Some(known) => known.add(&passage),
            None => self.passages.push(passage),
        }
    }

    /// Adds one completed step, during which `slept` islands were asleep.
    pub(super) fn add(&mut self, report: &StepReport, slept: u64, elapsed: Duration) {
        self.steps += 1;
        self.solves += report.solves;
        self.local_solves += report.local_solves;
        self.local_vertices += report.local_vertices;
        self.solved_by += report.solved_by;
        self.iterations += report.iterations;
        self.projected += u64::from(report.projected);
        self.energies += report.energies;
        self.halvings += report.halvings;
        self.rejected += report.rejected;
        self.slept += slept;
        self.contact += report.contact;
        self.stepping_time += elapsed;
        self.phases += report.phases;
    }
}
