//! Times, taken in turns so that whatever else the machine does meets all contenders alike.

use std::time::Instant;

use energy_dsl::OperationCount;
use serde::Serialize;

use crate::accuracy::NearRest;
use crate::contender::Contender;
use crate::work::Work;

/// A contender's time.
#[derive(Clone, Copy, Debug)]
pub struct Time {
    /// Whose.
    pub contender: Contender,
    /// The median, in nanoseconds an element.
    pub nanoseconds: f64,
    /// The least, in nanoseconds an element.
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

/// What was measured of a kernel.
#[derive(Clone, Debug, Serialize)]
pub struct Measured {
    /// `K1` to `K5`.
    pub key: &'static str,
    /// What it is.
    pub title: &'static str,
    /// The operations of the library's routine; a fused multiply-add counts as two.
    pub operations: usize,
    /// Its instructions, a fused multiply-add counting as one.
    pub instructions: usize,
    /// Its divisions and roots.
    pub divisions_and_roots: usize,
    /// The largest relative difference of any contender's results from the library's.
    pub difference: f64,
    /// Errors near rest, where there is one.
    pub near_rest: Option<NearRest>,
    /// All times.
    pub times: Vec<Time>,
}

impl Measured {
    /// The header of a kernel's measurements, without times.
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
            near_rest: None,
            times: Vec::new(),
        }
    }

    /// The median of a contender, in nanoseconds an element, if it was measured.
    #[must_use]
    pub fn time(&self, of: Contender) -> Option<f64> {
        self.times.iter().find(|time| time.contender == of).map(|time| time.nanoseconds)
    }

    /// The least median of the contenders that are chosen.
    #[must_use]
    pub fn best(&self, chosen: impl Fn(Contender) -> bool) -> Option<f64> {
        let times = self.times.iter().filter(|time| chosen(time.contender)).map(|time| time.nanoseconds);
        times.min_by(f64::total_cmp)
    }
}

/// Runs every contender `repetitions` times, one after the other in turns and each time once more before, to fill the
/// caches; calls `progress` after every turn. `elements` is how many elements a run computes.
///
/// # Panics
/// When there are no repetitions.
pub fn measure(
    contenders: &mut [(Contender, Work)],
    elements: usize,
    repetitions: usize,
    mut progress: impl FnMut(),
) -> Vec<Time> {
    assert!(repetitions > 0, "a median needs repetitions");
    let mut times = vec![Vec::with_capacity(repetitions); contenders.len()];
    for _ in 0..repetitions {
        for ((_, work), times) in contenders.iter_mut().zip(&mut times) {
            // Once for the caches, which the others have filled.
            work();
            let start = Instant::now();
            work();
            times.push(start.elapsed().as_secs_f64() * 1e9 / elements as f64);
        }
        progress();
    }
    let medians = times.iter_mut().map(|times| {
        times.sort_by(f64::total_cmp);
        (times[times.len() / 2], times[0])
    });
    let time = |((contender, _), (nanoseconds, least)): (&(Contender, Work), _)| Time {
        contender: *contender,
        nanoseconds,
        least,
    };
    contenders.iter().zip(medians).map(time).collect()
}
