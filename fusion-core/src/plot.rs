//! The plot of a track's errors.

use energy_cli::plot::{Axes, Line, linear};

use crate::evaluation::{ErrorSummary, TrackErrors};

/// Name and colour of a line, and the summary's number that it shows.
type Statistic = (&'static str, (u8, u8, u8), fn(&ErrorSummary) -> f64);

const STATISTICS: [Statistic; 3] = [
    ("95 %", (204, 121, 167), |summary| summary.p95),
    ("mean", (0, 114, 178), |summary| summary.mean),
    ("median", (0, 158, 115), |summary| summary.median),
];

/// Draws mean, median and 95th percentile of each frame, in mm, as SVG.
///
/// # Errors
/// If the track is empty, or an error is not finite.
pub fn errors_svg(errors: &TrackErrors) -> Result<String, String> {
    let summaries: Vec<ErrorSummary> = errors.frames.iter().map(|frame| ErrorSummary::of(frame.all.clone())).collect();
    let highest = summaries.iter().map(|summary| summary.p95.max(summary.mean)).fold(0.0, f64::max).max(1e-3);
    if summaries.is_empty() || summaries.iter().any(|summary| !summary.mean.is_finite()) {
        return Err("no frames with finite errors to draw".into());
    }
    let axes = Axes {
        title: "end-point error",
        labels: ("frame", "mm"),
        across: 1.0..(summaries.len().max(2) as f64),
        up: 0.0..1.05 * highest,
        size: (800, 420),
    };
    let lines = STATISTICS.map(|(name, colour, value)| {
        let points = summaries.iter().enumerate().map(|(i, summary)| ((i + 1) as f64, value(summary)));
        Line { name, colour, points: points.collect() }
    });
    linear(&axes, &lines)
}
