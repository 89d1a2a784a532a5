//! Times of contenders. They run in turns, so that other load on the machine affects all of them equally.

use std::time::{Duration, Instant};

use energy_dsl::OperationCount;
use serde::Serialize;

use crate::coincident::Outcome;
use crate::contender::Contender;
use crate::near_rest::GradientError;
use crate::work::Work;

/// Time of one contender.
#[derive(Clone, Copy, Debug)]
pub struct Time {
    /// The routine and its loop.
    pub contender: Contender,
    /// Median, in nanoseconds per element.
    pub nanoseconds: f64,
    /// Minimum, in nanoseconds per element.
    pub least: f64,
}

impl Serialize for Time {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        use serde::ser::SerializeStruct;
        let mut time = serializer.serialize_struct("Time", 3)?;
        time.serialize_field("contender", &self.contender.to_string())?;
        time.serialize_field("nanoseconds", &self.nanoseconds)?;
        time.serialize_field("least", &self.least)?;
        time.end()
    }
}

/// Measurements of one kernel.
#[derive(Clone, Debug, Serialize)]
pub struct Measured {
    /// `K1` to `K5`.
    pub key: &'static str,
    /// Name of the potential.
    pub title: &'static str,
    /// Operations of the generated routine; a fused multiply-add counts as two.
    pub operations: usize,
    /// Instructions of the generated routine; a fused multiply-add counts as one.
    pub instructions: usize,
    /// Divisions and square roots of the generated routine.
    pub divisions_and_roots: usize,
    /// Largest relative difference of any contender's results from the generated ones.
    pub difference: f64,
    /// Gradient errors near rest; empty if the kernel has no rest shape where differences cancel.
    pub near_rest: Vec<GradientError>,
    /// Verdicts on the results at coincident points.
    pub coincident: Vec<Outcome>,
    /// Times of all contenders.
    pub times: Vec<Time>,
}

impl Measured {
    /// Creates an entry without times, errors and verdicts.
    #[must_use]
    pub fn new<K: crate::Subject>(difference: f64) -> Self {
        let count: OperationCount = K::operations();
        Self {
            key: K::KEY,
            title: K::TITLE,
            operations: count.total(),
            instructions: count.instructions(),
            divisions_and_roots: count.divisions_and_roots,
            difference,
            near_rest: Vec::new(),
            coincident: Vec::new(),
            times: Vec::new(),
        }
    }

    /// Returns a contender's median in nanoseconds per element; `None` if it was not measured.
    #[must_use]
    pub fn time(&self, contender: Contender) -> Option<f64> {
        self.times.iter().find(|time| time.contender == contender).map(|time| time.nanoseconds)
    }

    /// Returns the smallest median of the chosen contenders.
    #[must_use]
    pub fn best(&self, chosen: impl Fn(Contender) -> bool) -> Option<f64> {
        let times = self.times.iter().filter(|time| chosen(time.contender)).map(|time| time.nanoseconds);
        times.min_by(f64::total_cmp)
    }
}

/// Runs all elements once to warm up, as the other contenders have filled the caches, and then again. Returns the time of
/// the second run; an error if a program of its own ended.
pub type Timed = Box<dyn FnMut() -> anyhow::Result<Duration>>;

/// Times work of this program.
#[must_use]
pub fn timed(mut work: Work) -> Timed {
    Box::new(move || {
        work();
        let start = Instant::now();
        work();
        Ok(start.elapsed())
    })
}

/// Runs all contenders in turns, `repetitions` times, and calls `progress` after each turn. `elements` is the number of
/// elements of one run.
///
/// # Errors
/// Fails if a contender does.
///
/// # Panics
/// Panics if `repetitions` is 0.
pub fn measure(
    contenders: &mut [(Contender, Timed)],
    elements: usize,
    repetitions: usize,
    mut progress: impl FnMut(),
) -> anyhow::Result<Vec<Time>> {
    assert!(repetitions > 0, "expected at least one repetition, got 0");
    let mut times = vec![Vec::with_capacity(repetitions); contenders.len()];
    for _ in 0..repetitions {
        for ((_, run), times) in contenders.iter_mut().zip(&mut times) {
            times.push(run()?.as_secs_f64() * 1e9 / elements as f64);
        }
        progress();
    }
    let medians = times.iter_mut().map(|times| {
        times.sort_by(f64::total_cmp);
        (times[times.len() / 2], times[0])
    });
    let time = |((contender, _), (nanoseconds, least)): (&(Contender, Timed), _)| Time {
        contender: *contender,
        nanoseconds,
        least,
    };
    Ok(contenders.iter().zip(medians).map(time).collect())
}
