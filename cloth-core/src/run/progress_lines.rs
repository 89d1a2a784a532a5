//! Progress in lines of text or of JSON, where no terminal shows a bar.

use std::time::{Duration, Instant};

use serde_json::{Value, json};

use crate::integrator::StepReport;

/// Time between two lines of text.
const TEXT_EVERY: Duration = Duration::from_secs(10);
/// Time between two lines of JSON.
const JSON_EVERY: Duration = Duration::from_secs(1);

/// The form of progress lines.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum LineFormat {
    /// For people, in log files.
    Text,
    /// One JSON object per line, for programs.
    Json,
}

/// Decides when a line is due, and formats it.
#[derive(Debug)]
pub(super) struct ProgressLines {
    format: LineFormat,
    steps: u64,
    /// Steps that were completed before.
    done: u64,
    started: Instant,
    last_line: Instant,
}

impl ProgressLines {
    /// Starts with `done` of `steps` steps completed.
    pub(super) fn new(format: LineFormat, steps: u64, done: u64) -> Self {
        let now = Instant::now();
        Self { format, steps, done, started: now, last_line: now }
    }

    /// Returns the line after a step, if one is due at a time.
    pub(super) fn step(&mut self, step: u64, report: &StepReport, now: Instant) -> Option<String> {
        let every = if self.format == LineFormat::Json { JSON_EVERY } else { TEXT_EVERY };
        let is_last = self.format == LineFormat::Json && step == self.steps;
        if now.duration_since(self.last_line) < every && !is_last {
            return None;
        }
        self.last_line = now;
        let elapsed = now.duration_since(self.started).as_secs_f64();
        let left = elapsed * (self.steps - step) as f64 / (step - self.done).max(1) as f64;
        Some(match self.format {
            LineFormat::Text => format!("step {step} of {}, about {} left", self.steps, Seconds(left)),
            LineFormat::Json => line(json!({
                "event": "step",
                "step": step,
                "steps": self.steps,
                "elapsed": elapsed,
                "left": left,
                "solves": report.solves,
                "iterations": report.iterations,
                "rejected": report.rejected,
            })),
        })
    }
}

/// Formats a JSON object on one line.
fn line(object: Value) -> String {
    object.to_string()
}

/// A duration in s, for people.
pub(super) struct Seconds(pub f64);

impl std::fmt::Display for Seconds {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.0 {
            seconds if seconds < 100.0 => write!(f, "{seconds:.0} s"),
            seconds if seconds < 6000.0 => write!(f, "{:.0} min", seconds / 60.0),
            seconds => write!(f, "{:.1} h", seconds / 3600.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_come_at_intervals_with_the_time_that_is_left() {
        let mut lines = ProgressLines::new(LineFormat::Text, 110, 10);
        let after = |lines: &ProgressLines, seconds| lines.started + Duration::from_secs(seconds);
        let mut report = StepReport::default();
        report.solves = 3;
        let at = after(&lines, 5);
        assert_eq!(lines.step(15, &report, at), None);
        let at = after(&lines, 20);
        assert_eq!(lines.step(30, &report, at).unwrap(), "step 30 of 110, about 80 s left");
        let at = after(&lines, 25);
        assert_eq!(lines.step(35, &report, at), None);

        let mut lines = ProgressLines::new(LineFormat::Json, 4, 0);
        let at = after(&lines, 2);
        let found: Value = serde_json::from_str(&lines.step(1, &report, at).unwrap()).unwrap();
        assert_eq!((&found["step"], &found["left"], &found["solves"]), (&json!(1), &json!(6.0), &json!(3)));
        assert!(lines.step(2, &report, at).is_none() && lines.step(4, &report, at).is_some(), "the last is told");
        assert_eq!(Seconds(7300.0).to_string(), "2.0 h");
    }
}
