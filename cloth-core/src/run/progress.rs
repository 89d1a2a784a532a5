//! Progress of a run: how far it is, how long it will take, and whether it is stuck.

use std::io::{IsTerminal, Write};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};

use super::progress_lines::{LineFormat, ProgressLines};
use crate::integrator::StepReport;

/// The form of the progress of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Log {
    /// A bar on standard error if that is a terminal, otherwise a line every 10 s.
    #[default]
    Text,
    /// JSON objects on standard output, one per line.
    Json,
}

/// A progress bar or lines, and a watchdog. The watchdog warns if no step ends for 20 s and for 20 times the mean step
/// time.
#[derive(Debug)]
pub struct Progress {
    bar: ProgressBar,
    /// `None` if a terminal shows the bar.
    lines: Option<ProgressLines>,
    log: Log,
    steps: Option<Sender<u64>>,
    watchdog: Option<JoinHandle<()>>,
    recent: Recent,
}

/// Moving averages over recent steps.
#[derive(Clone, Copy, Debug, Default)]
struct Recent {
    solves: f64,
    iterations: f64,
}

/// Minimum time without a completed step before a warning.
const PATIENCE: Duration = Duration::from_secs(20);
/// Minimum time without a completed step, in mean step times.
const FACTOR: u32 = 20;

impl Progress {
    /// Starts the display for `steps` steps, of which `done` are completed.
    #[must_use]
    pub fn new(steps: u64, done: u64, log: Log) -> Self {
        let is_terminal = std::io::stderr().is_terminal();
        let lines = match log {
            Log::Json => Some(ProgressLines::new(LineFormat::Json, steps, done)),
            Log::Text => (!is_terminal).then(|| ProgressLines::new(LineFormat::Text, steps, done)),
        };
        let style = ProgressStyle::with_template("{wide_bar} step {pos}/{len}, {eta} left{msg}");
        let bar = if lines.is_some() { ProgressBar::hidden() } else { ProgressBar::new(steps) };
        let bar = bar.with_style(style.expect("the template is valid")).with_position(done);
        bar.reset_eta();
        let (sender, receiver) = channel::<u64>();
        let shown = bar.clone();
        let watchdog = std::thread::spawn(move || {
            watchdog(&receiver, done, PATIENCE, |warning| shown.suspend(|| energy_cli::tell(&warning)));
        });
        Self { bar, lines, log, steps: Some(sender), watchdog: Some(watchdog), recent: Recent::default() }
    }

    /// Records a completed step.
    pub fn step(&mut self, step: u64, report: &StepReport) {
        let blend = |mean: &mut f64, new: u64| *mean += (new as f64 - *mean) / 8.0;
        blend(&mut self.recent.solves, report.solves);
        blend(&mut self.recent.iterations, report.iterations);
        if self.recent.solves > 0.0 {
            let Recent { solves, iterations } = self.recent;
            self.bar.set_message(format!(", {solves:.1} solves of {:.0} iterations a step", iterations / solves));
        }
        self.bar.set_position(step);
        let line = self.lines.as_mut().and_then(|lines| lines.step(step, report, Instant::now()));
        if let Some(line) = line {
            self.tell(&line);
        }
        // The watchdog stops once the sender is dropped, so sending cannot fail before that.
        let _ = self.steps.as_ref().map(|steps| steps.send(step));
    }

    /// Prints a line. A reader that has gone does not end a run.
    fn tell(&self, line: &str) {
        let _ = match self.log {
            Log::Json => writeln!(std::io::stdout(), "{line}"),
            Log::Text => writeln!(std::io::stderr(), "{line}"),
        };
    }

    /// Records that no step follows: the watchdog stops.
    pub fn last_step(&mut self) {
        self.bar.set_message(", writing files");
        self.stop_watchdog();
    }

    /// Removes the progress bar and stops the watchdog.
    pub fn finish(mut self) {
        self.bar.finish_and_clear();
        self.stop_watchdog();
    }

    fn stop_watchdog(&mut self) {
        drop(self.steps.take());
        if let Some(watchdog) = self.watchdog.take() {
            let _ = watchdog.join();
        }
    }
}

/// Receives completed steps until the sender is dropped. Warns if none arrives for `patience` and for [`FACTOR`] times
/// the mean step time.
fn watchdog(steps: &Receiver<u64>, done: u64, patience: Duration, mut warn: impl FnMut(String)) {
    let (start, mut last, mut ended, mut count) = (Instant::now(), done, Instant::now(), 0);
    loop {
        let mean = ended.duration_since(start) / count.max(1);
        match steps.recv_timeout(patience.max(FACTOR * mean)) {
            Ok(step) => (last, ended, count) = (step, Instant::now(), count + 1),
            Err(RecvTimeoutError::Disconnected) => return,
            Err(RecvTimeoutError::Timeout) => warn(stuck(last, ended.elapsed(), mean)),
        }
    }
}

/// Formats the warning.
fn stuck(last: u64, silent: Duration, mean: Duration) -> String {
    format!(
        "warning: the step after {last} has taken {:.0} s so far, others took {:.2} s: it may be stuck. \
         Interrupt with Ctrl-C; a smaller dt or `adaptive = true` may help",
        silent.as_secs_f64(),
        mean.as_secs_f64()
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_warning_says_which_step_and_for_how_long() {
        let text = stuck(41, Duration::from_secs(30), Duration::from_millis(250));
        assert!(text.contains("after 41 has taken 30 s so far, others took 0.25 s"), "{text}");
        // Finishing joins the watchdog.
        let mut progress = Progress::new(10, 3, Log::Text);
        progress.step(4, &StepReport::default());
        progress.last_step();
        assert!(progress.watchdog.is_none(), "no step is awaited while files are written");
        progress.finish();
    }

    #[test]
    fn a_step_that_does_not_end_is_reported_while_steps_that_do_are_not() {
        let (steps, ended) = channel();
        let (warn, warnings) = channel();
        let watching = std::thread::spawn(move || {
            watchdog(&ended, 7, Duration::from_millis(100), |warning| warn.send(warning).expect("somebody listens"));
        });
        for step in 8..12 {
            steps.send(step).unwrap();
            std::thread::sleep(Duration::from_millis(2));
        }
        assert!(warnings.try_recv().is_err(), "all is well");
        let warning = warnings.recv_timeout(Duration::from_secs(60)).unwrap();
        assert!(warning.contains("the step after 11 has taken"), "{warning}");
        drop(steps);
        watching.join().unwrap();
    }
}
