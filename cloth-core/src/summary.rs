use std::fmt;
use std::time::Duration;

use energy_dsl::Vector3;
use energy_solve::{Counts, Tally};
use serde::{Deserialize, Serialize};

use crate::integrator::{Phases, SolvedBy};

/// What a simulation did, and where it ended. Its `Display` is a report for people.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// Vertices.
    pub vertices: usize,
    /// Vertices that are pinned.
    pub pinned: usize,
    /// Triangles.
    pub triangles: usize,
    /// Parts of the whole that nothing couples, each stepped by itself.
    #[serde(default)]
    pub islands: usize,
    /// How many of them sleep.
    #[serde(default)]
    pub asleep: usize,
    /// Steps slept through, of all islands.
    #[serde(default)]
    pub slept: u64,
    /// The integrator.
    pub integrator: String,
    /// Time step, in s.
    pub dt: f64,
    /// Steps done.
    pub steps: u64,
    /// Linear systems solved.
    pub solves: u64,
    /// Of those that are symmetric, by what.
    #[serde(default)]
    pub solved_by: SolvedBy,
    /// Iterations of the linear solver.
    pub iterations: u64,
    /// Steps solved again with projected curvature; see [`crate::integrator::ImplicitEuler`].
    pub projected: u64,
    /// Steps rejected and tried again with a smaller size; see [`crate::integrator::Adaptive`].
    pub rejected: u64,
    /// Time spent by phase; of integrators that solve by Newton's method only.
    pub phases: Phases,
    /// Time spent in steps.
    pub stepping_time: Duration,
    /// The terms.
    pub terms: Vec<TermSummary>,
    /// Terms that were left out, and why.
    pub left_out: Vec<String>,
    /// What should be known about the run.
    pub warnings: Vec<String>,
    /// ½ Σ m v², in J.
    pub kinetic_energy: f64,
    /// Σ m v, in kg m/s.
    pub momentum: Vector3<f64>,
    /// Σ m x × v about the origin, in kg m²/s.
    pub angular_momentum: Vector3<f64>,
    /// The total force of the cloth on its pins, in N.
    pub pin_force: Vector3<f64>,
}

/// What one term did, and its energy at the end.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TermSummary {
    /// Its name.
    pub name: String,
    /// The declared element it is made of.
    pub element: String,
    /// How many.
    #[serde(default)]
    pub elements: usize,
    /// Its energy in J; `None` for a force law.
    pub energy: Option<f64>,
    /// What was evaluated and skipped.
    #[serde(with = "crate::checkpoint::saved_counts")]
    pub counts: Counts,
    /// Hessians that were not evaluated because they are constant and known.
    #[serde(default)]
    pub reused: u64,
}

impl Summary {
    /// The phases of a step, in order, with the time that they took.
    #[must_use]
    pub fn named_phases(&self) -> [(&'static str, Duration); 4] {
        let Phases { assembly, factorisation, solve, line_search } = self.phases;
        [
            ("assembly", assembly),
            ("factorisation", factorisation),
            ("linear solves", solve),
            ("line search", line_search),
        ]
    }

    /// How many islands there are, and what they slept through.
    #[must_use]
    pub fn sleep(&self) -> String {
        let all = self.steps * self.islands as u64;
        let islands = if self.islands == 1 { "1 island".to_owned() } else { format!("{} islands", self.islands) };
        match (self.slept, self.asleep) {
            (0, 0) => islands,
            (slept, asleep) => format!("{islands}, {asleep} asleep; {slept} of their {all} steps slept through"),
        }
    }
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{} vertices ({} pinned), {} triangles", self.vertices, self.pinned, self.triangles)?;
        let simulated = self.steps as f64 * self.dt;
        writeln!(f, "{}: {} steps of {} s = {simulated:.3} s", self.integrator, self.steps, self.dt)?;
        writeln!(f, "{}", self.sleep())?;
        let seconds = self.stepping_time.as_secs_f64();
        writeln!(f, "{:.2} s of computing, {:.2} ms per step", seconds, 1e3 * seconds / self.steps.max(1) as f64)?;
        if self.solves > 0 {
            let mean = self.iterations as f64 / self.solves as f64;
            writeln!(f, "{} linear solves, {} iterations ({mean:.1} each)", self.solves, self.iterations)?;
            if self.solved_by != SolvedBy::default() {
                writeln!(f, "by {}", self.solved_by)?;
            }
            writeln!(f, "{} steps solved again with projected curvature", self.projected)?;
        }
        if self.rejected > 0 {
            writeln!(f, "{} steps rejected and tried again with a smaller size", self.rejected)?;
        }
        writeln!(f)?;
        writeln!(f, "{:<20} {:<20} {:>12}   evaluated (skipped) per routine", "term", "element", "energy, J")?;
        for term in &self.terms {
            let energy = term.energy.map_or("–".to_owned(), |energy| format!("{energy:.4e}"));
            writeln!(f, "{:<20} {:<20} {energy:>12}   {}", term.name, term.element, routines(&term.counts))?;
        }
        for reason in &self.left_out {
            writeln!(f, "left out: {reason}")?;
        }
        writeln!(f)?;
        writeln!(f, "kinetic energy     {:.4e} J", self.kinetic_energy)?;
        writeln!(f, "momentum           {} kg m/s", vector(&self.momentum))?;
        writeln!(f, "angular momentum   {} kg m²/s", vector(&self.angular_momentum))?;
        write!(f, "force on the pins  {} N", vector(&self.pin_force))?;
        for warning in &self.warnings {
            write!(f, "\nwarning: {warning}")?;
        }
        Ok(())
    }
}

fn routines(counts: &Counts) -> String {
    let one = |name: &str, tally: &Tally| {
        let flagged = if tally.flagged > 0 { format!(", {} flagged", tally.flagged) } else { String::new() };
        (tally.evaluated + tally.skipped > 0)
            .then(|| format!("{name} {} ({}{flagged})", tally.evaluated, tally.skipped))
    };
    let all = [("value", &counts.value), ("first", &counts.gradient), ("second", &counts.hessian)];
    all.iter().filter_map(|(name, tally)| one(name, tally)).collect::<Vec<_>>().join(" · ")
}

fn vector(v: &Vector3<f64>) -> String {
    format!("({:.4e}, {:.4e}, {:.4e})", v[0], v[1], v[2])
}
