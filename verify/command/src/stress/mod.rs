//! Sweeps towards every singularity, down to 1e-300, that compare the errors of generated code and textbook form.

mod report;
mod sweeps;

pub use report::{markdown, plots};
pub use sweeps::{Sweep, sweeps};

use std::num::NonZero;

use serde::Serialize;

use verify::audit::{Subject, Target, amplification};
use verify::blocks::BlockName;
use verify::formula::expected_blocks;
use verify::multiprecision::truth;
use verify::parallel;
use verify::sample::Sample;

/// Errors of one block at one point of a sweep, in units of roundoff of its largest number.
#[derive(Clone, Debug, Serialize)]
pub struct Point {
    /// Distance from the singularity: an angle, a length or a scale.
    pub parameter: f64,
    /// Error of the generated code.
    pub robust: f64,
    /// Error of the generated code divided by max(1, κ).
    pub robust_kappa: f64,
    /// Error of the textbook form by dual numbers.
    pub naive: f64,
    /// Whether the generated code returned a NaN.
    pub nan: bool,
    /// Whether the exact block is beyond the range of doubles.
    pub overflows: bool,
    /// Whether the generated code flagged its result.
    pub flagged: bool,
    /// Whether the exact block has a value.
    pub is_defined: bool,
}

impl Point {
    /// Whether the generated code is as accurate as its edges allow, or flags its result as a convention, without a
    /// NaN. The textbook form may divide 0 by 0 where a limit exists; the table of degenerate inputs has these limits.
    #[must_use]
    pub fn passed(&self) -> bool {
        !self.nan && (self.flagged || !self.is_defined || self.overflows || self.robust_kappa <= 8.0)
    }
}

/// One block of an element along a sweep.
#[derive(Clone, Debug, Serialize)]
pub struct Track {
    /// Name of the element.
    pub element: String,
    /// Name of the sweep.
    pub sweep: &'static str,
    /// Name of the block.
    pub block: BlockName,
    /// Results from far to near.
    pub points: Vec<Point>,
}

impl Track {
    /// Whether every point passed.
    #[must_use]
    pub fn passed(&self) -> bool {
        self.points.iter().all(Point::passed)
    }
}

/// Runs every sweep that fits each element. `None` uses all processors; the result does not depend on the number of
/// threads.
///
/// # Errors
/// If an element cannot be read.
pub fn stress(targets: &[Target], threads: Option<NonZero<usize>>) -> Result<Vec<Track>, String> {
    // Threads share sweeps rather than elements: a single element may take a third of the time of all.
    let pairs = targets.iter().flat_map(|target| sweeps(target.declaration()).into_iter().map(move |s| (target, s)));
    let pairs: Vec<(&Target, Sweep)> = pairs.collect();
    let cost = |(target, sweep): &(&Target, Sweep)| target.cost() * sweep.inputs.len();
    let tracks: Result<Vec<_>, _> =
        parallel::map(&pairs, threads, cost, |(target, sweep)| run(target, sweep)).into_iter().collect();
    tracks.map(|tracks| tracks.concat())
}

/// Runs one sweep of an element.
fn run(target: &Target, Sweep { name, inputs }: &Sweep) -> Result<Vec<Track>, String> {
    let subject = target.subject_without_faults()?;
    let mut tracks: Vec<Track> = Vec::new();
    for (parameter, sample) in inputs {
        for (block, point) in at(&subject, sample, *parameter) {
            match tracks.iter_mut().find(|track| track.block == block) {
                Some(track) => track.points.push(point),
                None => tracks.push(Track {
                    element: subject.declaration.name.to_string(),
                    sweep: name,
                    block,
                    points: vec![point],
                }),
            }
        }
    }
    Ok(tracks)
}

/// Evaluates all blocks at one input; empty if the rest shape is rejected.
fn at(subject: &Subject, sample: &Sample, parameter: f64) -> Vec<(BlockName, Point)> {
    const DIGITS: usize = 20;
    let declaration = &*subject.declaration;
    let Ok(answer) = subject.answer(sample) else { return Vec::new() };
    let naive = expected_blocks(declaration, &subject.formula, sample);
    let truths = truth(declaration, &subject.formula, sample, DIGITS);
    let point = |block: &verify::blocks::Block| {
        let truth = truths.iter().find(|t| t.block.name == block.name)?;
        let naive = naive.iter().find(|n| n.name == block.name)?;
        let nan = block.numbers.iter().any(|x| x.is_nan());
        let overflows = truth.largest().is_infinite();
        let robust = if truth.is_defined { truth.error_in_roundoffs(&block.numbers) } else { 0.0 };
        let robust_kappa = match robust {
            error if error > 8.0 => error / amplification(subject, sample, &answer, block.name).max(1.0),
            error => error,
        };
        let naive = if truth.is_defined { truth.error_in_roundoffs(&naive.numbers) } else { f64::NAN };
        let flagged = answer.flags[block.name.order(declaration.kind)].any();
        let is_defined = truth.is_defined;
        let point = Point { parameter, robust, robust_kappa, naive, nan, overflows, flagged, is_defined };
        Some((block.name, point))
    };
    answer.blocks.iter().filter_map(point).collect()
}
