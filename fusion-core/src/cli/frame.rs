//! One frame of a track: its row in the table, and the messages about it.

use std::time::Instant;

use fusion_core::depth::{DepthImage, SequenceError};
use fusion_core::skeleton::Skeleton;
use fusion_core::tracker::{FrameReport, Tracker};
use serde::{Deserialize, Serialize};

/// A row of the table of frames.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Line {
    pub frame: usize,
    status: Status,
    matches: usize,
    iterations: usize,
    energy: f64,
    nonrigid: f64,
    graph: f64,
    binding: f64,
    skeleton: f64,
    prior: f64,
    joints: f64,
    /// Empty if the image was used.
    pub reason: String,
    visible: f64,
    inliers: f64,
    residual_mm: f64,
    /// Time of the frame without reading and writing files.
    time_ms: f64,
}

impl Line {
    /// Whether the image was used.
    pub fn is_tracked(&self) -> bool {
        self.reason.is_empty()
    }
}

/// Whether the image of a frame was used.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Status {
    #[default]
    Skipped,
    Tracked,
}

/// Tracks one frame. If its image cannot be used, the body moves by its bones or its last motion, and the row has the
/// reason.
pub fn track_frame(
    frame: usize,
    image: Result<DepthImage, SequenceError>,
    skeleton: Option<&Skeleton>,
    tracker: &mut Tracker,
) -> Line {
    let skipped = |error: &anyhow::Error| Line { frame, reason: format!("{error:#}"), ..Line::default() };
    let bones = skeleton.map_or(Ok(None), |skeleton| skeleton.motions(frame, &tracker.model().bones));
    let (bones, fault) = match bones {
        Ok(bones) => (bones, None),
        Err(error) => (None, Some(anyhow::Error::new(error))),
    };
    let image = match fault {
        None => image.map_err(anyhow::Error::new),
        Some(fault) => Err(fault),
    };
    match image {
        Ok(image) => {
            let start = Instant::now();
            let result = tracker.track(&image, bones.as_deref());
            let time_ms = 1e3 * start.elapsed().as_secs_f64();
            match result {
                Ok(report) => Line { time_ms, ..line(frame, &report) },
                Err(error) => Line { time_ms, ..skipped(&error.into()) },
            }
        }
        Err(error) => {
            let moved = tracker.predict(bones.as_deref());
            skipped(&moved.err().map_or(error, anyhow::Error::new))
        }
    }
}

/// Summarises the times of the tracked frames.
pub fn times(lines: &[Line]) -> String {
    let mut times: Vec<f64> = lines.iter().filter(|line| line.is_tracked()).map(|line| line.time_ms).collect();
    times.sort_by(f64::total_cmp);
    let quantile = |q: f64| times.get((q * times.len().saturating_sub(1) as f64).round() as usize).unwrap_or(&0.0);
    let mean = times.iter().sum::<f64>() / times.len().max(1) as f64;
    format!(
        "time per frame: mean {mean:.1} ms ({:.0} Hz), median {:.1} ms, 95 % {:.1} ms, longest {:.1} ms\n",
        1e3 / mean,
        quantile(0.5),
        quantile(0.95),
        quantile(1.0)
    )
}

/// Describes the loss or the recovery of the track from one frame to the next; `None` without either.
pub fn change(before: Option<&Line>, now: &Line) -> Option<String> {
    match (before.is_none_or(Line::is_tracked), now.is_tracked()) {
        (true, false) => Some(format!(
            "track lost in frame {}: {}; following the bones, or the last motion without bones",
            now.frame, now.reason
        )),
        (false, true) => Some(format!(
            "track recovered in frame {}: {:.0} % of the visible vertices match, {:.1} mm from the surface",
            now.frame,
            100.0 * now.inliers,
            now.residual_mm
        )),
        _ => None,
    }
}

fn line(frame: usize, report: &FrameReport) -> Line {
    let last = report.iterations.last();
    let of = |name: &str| {
        last.and_then(|step| step.terms.iter().find(|term| term.name == name)).map_or(0.0, |term| term.energy)
    };
    Line {
        frame,
        status: Status::Tracked,
        matches: report.counts.matched,
        iterations: report.iterations.len(),
        energy: last.map_or(0.0, |step| step.after),
        nonrigid: of("nonrigid"),
        graph: of("graph"),
        binding: of("binding"),
        skeleton: report.skeleton_energy.unwrap_or_else(|| of("skeleton")),
        prior: of("prior"),
        joints: of("joints"),
        reason: String::new(),
        visible: report.quality.visible,
        inliers: report.quality.inliers,
        residual_mm: 1e3 * report.quality.residual,
        time_ms: 0.0,
    }
}
