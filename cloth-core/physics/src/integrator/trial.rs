use serde::{Deserialize, Serialize};

/// Chooses between over-relaxation and multigrid for sheets. Counts iterations instead of measuring time, so the choice
/// is the same in every run, for every number of threads, and after a resumed run.
///
/// Over-relaxation comes first. Multigrid takes over once over-relaxation needs more iterations than multigrid is
/// expected to cost. It stays until it costs more than over-relaxation did, or until [`PATIENCE`] rounds have passed;
/// then over-relaxation is tried again.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub(crate) struct Trial {
    multigrid: bool,
    /// This round: solves, their iterations, and the decimal digits they were solved to, in thousandths.
    count: u32,
    iterations: u32,
    digits: u32,
    /// Rounds since the last change of solver.
    rounds: u32,
    /// Iterations per decimal digit, in thousandths: of over-relaxation in its last round, and a moving average of
    /// multigrid's rounds. 0 if multigrid has not run recently.
    relaxations: u32,
    cycles: u32,
}

/// The choices for systems with and without contacts between rows that no element couples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub(crate) struct Trials {
    alone: Trial,
    in_contact: Trial,
}

impl Trials {
    /// Returns the choice for systems of one kind.
    pub(super) fn of(&mut self, in_contact: bool) -> &mut Trial {
        if in_contact { &mut self.in_contact } else { &mut self.alone }
    }
}

/// Solves per round.
const ROUND: u32 = 3;
/// Rounds until the other solver is tried again.
const PATIENCE: u32 = 60;
/// Extra cost of multigrid's set-up for a new matrix, in iterations of over-relaxation.
const SETUP_COST: f64 = 6.0;
/// Cost of an iteration of multigrid, in iterations of over-relaxation. Over-relaxation reads the blocks above the
/// diagonal half as often, has no coarse levels, and needs fewer vectors.
const CYCLE_COST: f64 = 3.6;
/// Initial guess of multigrid's iterations per decimal digit, in thousandths: measured on cotton.
const INITIAL_ITERATIONS_PER_DIGIT: u32 = 4000;
/// Factor by which one solver must be cheaper than the other to replace it.
const MARGIN: f64 = 1.2;

impl Trial {
    /// Whether the next system goes to multigrid.
    pub(super) fn multigrid(&self) -> bool {
        self.multigrid
    }

    /// Records a solve by the solver in use, and decides which one comes next.
    pub(super) fn record(&mut self, iterations: usize, relative_tolerance: f64) {
        // Sums of a damaged checkpoint may be any.
        self.count = self.count.saturating_add(1);
        self.iterations = self.iterations.saturating_add(iterations as u32);
        self.digits = self.digits.saturating_add((-1000.0 * relative_tolerance.log10()).max(1.0) as u32);
        if self.count < ROUND {
            return;
        }
        let digits = f64::from(self.digits) / f64::from(1000 * ROUND);
        let found = (f64::from(self.iterations) / f64::from(ROUND) / digits * 1000.0) as u32;
        (self.count, self.iterations, self.digits, self.rounds) = (0, 0, 0, self.rounds.saturating_add(1));
        let was_multigrid = self.multigrid;
        if self.multigrid {
            // Average: a few nearly indefinite systems take long with either solver.
            self.cycles = if self.cycles == 0 { found } else { self.cycles.midpoint(found) };
            let served = multigrid_cost(self.cycles, digits) <= MARGIN * relaxation_cost(self.relaxations, digits);
            self.multigrid = served && self.rounds < PATIENCE;
        } else {
            self.relaxations = found;
            if self.rounds >= PATIENCE {
                (self.cycles, self.rounds) = (0, 0);
            }
            let expected = if self.cycles == 0 { INITIAL_ITERATIONS_PER_DIGIT } else { self.cycles };
            self.multigrid = relaxation_cost(found, digits) > MARGIN * multigrid_cost(expected, digits);
        }
        if was_multigrid != self.multigrid {
            self.rounds = 0;
        }
    }
}

/// The cost of a solve by over-relaxation, in its iterations.
fn relaxation_cost(per_digit: u32, digits: f64) -> f64 {
    1e-3 * f64::from(per_digit) * digits
}

/// The cost of a solve by multigrid, in iterations of over-relaxation.
fn multigrid_cost(per_digit: u32, digits: f64) -> f64 {
    SETUP_COST + CYCLE_COST * 1e-3 * f64::from(per_digit) * digits
}

#[cfg(test)]
mod tests {
    use super::*;

    fn after(trial: &mut Trial, solutions: usize, iterations: impl Fn(bool) -> usize) -> usize {
        let mut by_multigrid = 0;
        for _ in 0..solutions {
            by_multigrid += usize::from(trial.multigrid());
            trial.record(iterations(trial.multigrid()), 0.03);
        }
        by_multigrid
    }

    #[test]
    fn few_iterations_keep_over_relaxation() {
        let mut trial = Trial::default();
        assert_eq!(after(&mut trial, 1000, |multigrid| if multigrid { 6 } else { 20 }), 0);
    }

    #[test]
    fn many_iterations_switch_to_multigrid_with_occasional_retries() {
        let mut trial = Trial::default();
        let by_multigrid = after(&mut trial, 1000, |multigrid| if multigrid { 7 } else { 80 });
        assert!((950..1000 - 3).contains(&by_multigrid), "{by_multigrid}");
        // Now over-relaxation converges fast.
        assert!(after(&mut trial, 1000, |multigrid| if multigrid { 3 } else { 8 }) < 200);
    }

    #[test]
    fn multigrid_is_dropped_if_it_does_not_pay() {
        let mut trial = Trial::default();
        let by_multigrid = after(&mut trial, 1000, |multigrid| if multigrid { 30 } else { 50 });
        assert!((3..60).contains(&by_multigrid), "{by_multigrid}");
    }

    #[test]
    fn the_choice_does_not_depend_on_the_tolerance() {
        let mut trial = Trial::default();
        let mut by_multigrid = 0;
        for solution in 0..300 {
            let digits = if solution % 7 < 3 { 1 } else { 2 };
            by_multigrid += usize::from(trial.multigrid());
            trial.record(digits * if trial.multigrid() { 5 } else { 40 }, 0.1_f64.powi(digits as i32));
        }
        assert!(by_multigrid > 280, "{by_multigrid}");
    }

    #[test]
    fn the_state_survives_serialisation() {
        let mut trial = Trial::default();
        after(&mut trial, 100, |multigrid| if multigrid { 7 } else { 80 });
        let text = serde_json::to_string(&trial).unwrap();
        assert_eq!(serde_json::from_str::<Trial>(&text).unwrap(), trial);
    }
}
