use serde::{Deserialize, Serialize};

/// Which of two solvers of sheets is faster, over-relaxation or multigrid: found out by counting their iterations, never by the clock, so that it is the
/// same in every run, on any number of threads, and after a run was resumed.
///
/// Over-relaxation comes first. When it takes more iterations than multigrid is expected to cost, multigrid takes over, until it costs more than
/// over-relaxation did, and otherwise for so many solutions; then over-relaxation is tried again.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub(crate) struct Trial {
    multigrid: bool,
    /// The solutions of this round, their iterations, and the decimal digits that they were solved to, in thousandths.
    count: u32,
    iterations: u32,
    digits: u32,
    /// Rounds since the last change.
    rounds: u32,
    /// Iterations a digit, in thousandths: of over-relaxation in its last round; of multigrid, recent rounds counting more, 0 if that is long ago.
    relaxations: u32,
    cycles: u32,
}

/// Solutions of a round.
const ROUND: u32 = 3;
/// Rounds until the other solver is tried again.
const PATIENCE: u32 = 60;
/// What it costs to take over a matrix, more than over-relaxation does: in iterations of over-relaxation.
const TAKE_OVER: f64 = 6.0;
/// What an iteration of multigrid costs: in iterations of over-relaxation, which reads the blocks above the diagonal half as often, has no coarse levels,
/// and fewer vectors.
const CYCLE: f64 = 3.6;
/// Iterations of multigrid for each decimal digit, on real cotton, in thousandths.
const A_DIGIT: u32 = 4000;
/// By how much one must be cheaper than the other to replace it.
const MARGIN: f64 = 1.2;

impl Trial {
    /// Whether multigrid is next.
    pub(super) fn multigrid(&self) -> bool {
        self.multigrid
    }

    /// Takes note of a solution by what is in use.
    pub(super) fn note(&mut self, iterations: usize, relative_tolerance: f64) {
        self.count += 1;
        self.iterations += iterations as u32;
        self.digits += (-1000.0 * relative_tolerance.log10()).max(1.0) as u32;
        if self.count < ROUND {
            return;
        }
        let digits = f64::from(self.digits) / f64::from(1000 * ROUND);
        let found = (f64::from(self.iterations) / f64::from(ROUND) / digits * 1000.0) as u32;
        (self.count, self.iterations, self.digits, self.rounds) = (0, 0, 0, self.rounds + 1);
        let was = self.multigrid;
        if self.multigrid {
            // A few systems that are nearly indefinite take long with either.
            self.cycles = if self.cycles == 0 { found } else { (self.cycles + found) / 2 };
            let served = cycling(self.cycles, digits) <= MARGIN * relaxing(self.relaxations, digits);
            self.multigrid = served && self.rounds < PATIENCE;
        } else {
            self.relaxations = found;
            if self.rounds >= PATIENCE {
                (self.cycles, self.rounds) = (0, 0);
            }
            let expected = if self.cycles == 0 { A_DIGIT } else { self.cycles };
            self.multigrid = relaxing(found, digits) > MARGIN * cycling(expected, digits);
        }
        if was != self.multigrid {
            self.rounds = 0;
        }
    }
}

/// What a solution by over-relaxation costs, in its iterations.
fn relaxing(a_digit: u32, digits: f64) -> f64 {
    1e-3 * f64::from(a_digit) * digits
}

/// What one by multigrid costs, in iterations of over-relaxation.
fn cycling(a_digit: u32, digits: f64) -> f64 {
    TAKE_OVER + CYCLE * 1e-3 * f64::from(a_digit) * digits
}

#[cfg(test)]
mod tests {
    use super::*;

    fn after(trial: &mut Trial, solutions: usize, iterations: impl Fn(bool) -> usize) -> usize {
        let mut by_multigrid = 0;
        for _ in 0..solutions {
            by_multigrid += usize::from(trial.multigrid());
            trial.note(iterations(trial.multigrid()), 0.03);
        }
        by_multigrid
    }

    #[test]
    fn few_iterations_of_over_relaxation_are_left_alone() {
        let mut trial = Trial::default();
        assert_eq!(after(&mut trial, 1000, |multigrid| if multigrid { 6 } else { 20 }), 0);
    }

    #[test]
    fn many_are_not_but_it_is_tried_again_now_and_then() {
        let mut trial = Trial::default();
        let by_multigrid = after(&mut trial, 1000, |multigrid| if multigrid { 7 } else { 80 });
        assert!((950..1000 - 3).contains(&by_multigrid), "{by_multigrid}");
        // The sheet has become soft.
        assert!(after(&mut trial, 1000, |multigrid| if multigrid { 3 } else { 8 }) < 200);
    }

    #[test]
    fn what_was_expected_in_vain_is_given_up() {
        let mut trial = Trial::default();
        let by_multigrid = after(&mut trial, 1000, |multigrid| if multigrid { 30 } else { 50 });
        assert!((3..60).contains(&by_multigrid), "{by_multigrid}");
    }

    #[test]
    fn how_many_digits_are_asked_for_does_not_matter() {
        let mut trial = Trial::default();
        let mut by_multigrid = 0;
        for solution in 0..300 {
            let digits = if solution % 7 < 3 { 1 } else { 2 };
            by_multigrid += usize::from(trial.multigrid());
            trial.note(digits * if trial.multigrid() { 5 } else { 40 }, 0.1_f64.powi(digits as i32));
        }
        assert!(by_multigrid > 280, "{by_multigrid}");
    }

    #[test]
    fn what_was_saved_goes_on_in_the_same_way() {
        let mut trial = Trial::default();
        after(&mut trial, 100, |multigrid| if multigrid { 7 } else { 80 });
        let text = serde_json::to_string(&trial).unwrap();
        assert_eq!(serde_json::from_str::<Trial>(&text).unwrap(), trial);
    }
}
