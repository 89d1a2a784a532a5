//! Errors of a track against the truth.

mod surface_distance;

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

pub use self::surface_distance::SurfaceDistance;

/// Statistics of end-point errors, in mm.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct ErrorSummary {
    /// Number of vertices.
    pub count: usize,
    /// Mean error.
    pub mean: f64,
    /// Median error.
    pub median: f64,
    /// 95th percentile.
    pub p95: f64,
    /// Fraction of errors below 25 mm.
    pub share_below_25: f64,
}

impl ErrorSummary {
    /// Summarises errors in mm, in any order.
    #[must_use]
    pub fn of(mut errors: Vec<f64>) -> Self {
        errors.sort_by(f64::total_cmp);
        let Some(&largest) = errors.last() else { return Self::default() };
        let count = errors.len();
        let quantile = |q: f64| errors[((q * (count - 1) as f64).round() as usize).min(count - 1)];
        let below = errors.partition_point(|&error| error < 25.0);
        let mean = if largest.is_finite() { errors.iter().sum::<f64>() / count as f64 } else { f64::NAN };
        Self { count, mean, median: quantile(0.5), p95: quantile(0.95), share_below_25: below as f64 / count as f64 }
    }
}

/// End-point errors of one frame, in mm.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FrameErrors {
    /// Errors of all vertices.
    pub all: Vec<f64>,
    /// Errors of the vertices that the camera sees.
    pub visible: Vec<f64>,
}

impl FrameErrors {
    /// Computes the distances of tracked vertices from the true ones.
    #[must_use]
    pub fn new(found: &[Vector3<f64>], truth: &[Vector3<f64>], visible: &[bool]) -> Self {
        let all: Vec<f64> = found.iter().zip(truth).map(|(a, b)| 1e3 * (a - b).norm()).collect();
        let visible = all.iter().zip(visible).filter(|(_, seen)| **seen).map(|(error, _)| *error).collect();
        Self { all, visible }
    }
}

/// The errors of a track.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TrackErrors {
    /// Errors by frame.
    pub frames: Vec<FrameErrors>,
}

impl TrackErrors {
    /// Summarises all vertices over all frames.
    #[must_use]
    pub fn all(&self) -> ErrorSummary {
        ErrorSummary::of(self.frames.iter().flat_map(|frame| frame.all.iter().copied()).collect())
    }

    /// Summarises the visible vertices over all frames.
    #[must_use]
    pub fn visible(&self) -> ErrorSummary {
        ErrorSummary::of(self.frames.iter().flat_map(|frame| frame.visible.iter().copied()).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn summaries_have_the_right_statistics() {
        let summary = ErrorSummary::of((0..=100).rev().map(f64::from).collect());
        assert_eq!((summary.count, summary.mean, summary.median, summary.p95), (101, 50.0, 50.0, 95.0));
        assert!((summary.share_below_25 - 25.0 / 101.0).abs() < 1e-15);
        assert_eq!(ErrorSummary::of(Vec::new()), ErrorSummary::default());
        assert!(ErrorSummary::of(vec![1.0, f64::NAN]).mean.is_nan());
    }
}
