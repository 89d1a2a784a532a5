use energy_solve::{GaussNewtonError, IterationReport, SolverError};

use crate::correspondence::MatchCounts;
use crate::depth::LensError;
use crate::energy::{EnergyError, Moved, Pair};
use crate::option_error::OptionError;

/// A tracker that cannot be created.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TrackerError {
    /// An option cannot be used.
    #[error(transparent)]
    Option(#[from] OptionError),
    /// The camera cannot be used.
    #[error("the camera")]
    Camera(#[from] LensError),
    /// The energy cannot be created.
    #[error(transparent)]
    Energy(#[from] EnergyError),
    /// The solver cannot be created.
    #[error(transparent)]
    Solver(#[from] SolverError),
}

/// The reason why a frame's image was not used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FrameError {
    /// The image and the camera have different sizes.
    #[error("expected an image of {expected:?} pixels, got {found:?}")]
    Size {
        /// Size of the camera.
        expected: [usize; 2],
        /// Size of the image.
        found: [usize; 2],
    },
    /// A pixel is infinite or NaN.
    #[error("pixel ({u}, {v}) is NaN or infinite; mark missing measurements by 0")]
    NotANumber {
        /// Column of the pixel.
        u: usize,
        /// Row of the pixel.
        v: usize,
    },
    /// The image has no depth.
    #[error("no pixel has a depth")]
    NothingMeasured,
    /// Too few vertices have a match.
    #[error(
        "expected at least {least} matches, got {}: {} vertices without depth, {} too far, {} turned away, \
         {} outside the image",
        .counts.matched, .counts.no_depth, .counts.far, .counts.turned, .counts.outside
    )]
    TooFewMatches {
        /// Results of the search.
        counts: MatchCounts,
        /// Required number of matches.
        least: usize,
    },
    /// The numbers of bones differ.
    #[error("expected {expected} bones, got {found}")]
    BoneCount {
        /// Bones of the model.
        expected: usize,
        /// Bones given.
        found: usize,
    },
    /// No step could be computed.
    #[error(transparent)]
    Step(#[from] GaussNewtonError),
}

/// Statistics of one frame.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct FrameReport {
    /// Results of the last search for correspondences.
    pub counts: MatchCounts,
    /// Report of each step.
    pub iterations: Vec<IterationReport>,
    /// λ_s E_skeleton of known bones with the last data, which does not depend on the unknowns.
    pub skeleton_energy: Option<f64>,
    /// Agreement of the tracked body with the image.
    pub quality: FrameQuality,
}

/// Agreement of a tracked body with an image.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FrameQuality {
    /// Visible share: the fraction of the vertices that face the camera, and are not behind another part of the body,
    /// that project into the image. 0 if the body is out of view.
    pub visible: f64,
    /// Fraction of the visible vertices that match a measured point within the gates.
    pub inliers: f64,
    /// Root mean square of the matches' distances along normals, n̂·(v̂ − u), in m. 0 without matches.
    pub residual: f64,
}

impl FrameQuality {
    /// Computes the quality of a search with the last gates.
    #[must_use]
    pub fn new(moved: &Moved, pairs: &[Pair], counts: &MatchCounts) -> Self {
        let inside = counts.matched + counts.no_depth + counts.far + counts.turned;
        let fraction = |part: usize, whole: usize| if whole > 0 { part as f64 / whole as f64 } else { 0.0 };
        let square = |pair: &Pair| {
            let vertex = pair.vertex as usize;
            moved.normals[vertex].dot(&(moved.vertices[vertex] - pair.point)).powi(2)
        };
        let sum: f64 = pairs.iter().map(square).sum();
        Self {
            visible: fraction(inside, inside + counts.outside),
            inliers: fraction(counts.matched, inside),
            residual: (sum / pairs.len().max(1) as f64).sqrt(),
        }
    }
}
