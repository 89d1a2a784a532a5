//! Tracking from one depth image to the next.

use energy_solve::{GaussNewton, GaussNewtonError, GaussNewtonOptions, IterationReport, Outcome, SolverError};
use nalgebra::{Isometry3, Vector3};
use serde::{Deserialize, Serialize};

use crate::correspondence::{Gates, MatchCounts, correspondences};
use crate::depth::{Camera, DepthImage};
use crate::energy::{BoneMode, EnergyError, EnergyOptions, FusionEnergy, Moved, skeleton_energy};
use crate::model::DeformationModel;
use crate::twist::{Twist, blended};

/// Options of a [`Tracker`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TrackerOptions {
    /// Options of the energy.
    pub energy: EnergyOptions,
    /// Searches for correspondences per frame, each followed by one Gauss–Newton step.
    pub iterations: usize,
    /// Criteria of the last search.
    pub gates: Gates,
    /// Largest distance of a match in the first search, in m; it shrinks to that of the last.
    pub first_distance: f64,
    /// Levenberg's damping μ.
    pub damping: f64,
    /// Frames with fewer matches are skipped.
    pub least_matches: usize,
}

impl Default for TrackerOptions {
    fn default() -> Self {
        Self {
            energy: EnergyOptions { data_tukey: Some(0.05), ..EnergyOptions::default() },
            iterations: 6,
            gates: Gates::default(),
            first_distance: 0.06,
            damping: 1e-3,
            least_matches: 50,
        }
    }
}

impl TrackerOptions {
    /// Options for a body tracker with errors of a few degrees and centimetres: bones are unknowns, and searches reach
    /// further and are repeated more often.
    #[must_use]
    pub fn with_unknown_bones() -> Self {
        let mut options = Self { iterations: 12, first_distance: 0.1, ..Self::default() };
        options.energy.bones = BoneMode::Unknown;
        options
    }
}

/// A tracker that cannot be created.
#[derive(Debug, thiserror::Error)]
pub enum TrackerError {
    /// The energy cannot be created.
    #[error(transparent)]
    Energy(#[from] EnergyError),
    /// The solver cannot be created.
    #[error(transparent)]
    Solver(#[from] SolverError),
}

/// The reason why a frame was skipped. The track is as before the frame.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
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
pub struct FrameReport {
    /// Results of the last search for correspondences.
    pub counts: MatchCounts,
    /// Report of each step.
    pub iterations: Vec<IterationReport>,
    /// λ_s E_skeleton of known bones with the last data, which does not depend on the unknowns.
    pub skeleton_energy: Option<f64>,
}

/// Tracks a model through depth images.
#[derive(Debug)]
pub struct Tracker {
    model: DeformationModel,
    camera: Camera,
    options: TrackerOptions,
    energy: FusionEnergy,
    solver: GaussNewton<6>,
    /// Twists of the nodes, then of the bones if these are unknowns.
    twists: Vec<Twist>,
}

impl Tracker {
    /// Creates a tracker of a model at rest, in the camera's coordinates.
    ///
    /// # Errors
    /// If bones are unknowns and there are too few, or memory runs out.
    pub fn new(model: DeformationModel, camera: Camera, options: TrackerOptions) -> Result<Self, TrackerError> {
        let energy = FusionEnergy::new(&model, options.energy)?;
        let steps = GaussNewtonOptions { damping: options.damping, ..GaussNewtonOptions::default() };
        let solver = GaussNewton::new(energy.pattern().clone(), steps)?;
        let twists = vec![[0.0; 6]; energy.pattern().blocks()];
        Ok(Self { model, camera, options, energy, solver, twists })
    }

    /// Returns the model.
    #[must_use]
    pub fn model(&self) -> &DeformationModel {
        &self.model
    }

    /// Returns the twists of the nodes, in the model's coordinates.
    #[must_use]
    pub fn twists(&self) -> &[Twist] {
        &self.twists[..self.model.nodes.len()]
    }

    /// Returns the tracked vertices, in the camera's coordinates.
    #[must_use]
    pub fn vertices(&self) -> Vec<Vector3<f64>> {
        self.energy.moved(&self.twists).vertices.iter().map(|vertex| vertex + self.model.origin).collect()
    }

    /// Tracks one image. `bones` are a body tracker's motions of the model's bones from rest, in the camera's
    /// coordinates. With them, nodes start at the blend of their bones; without, where they were.
    ///
    /// # Errors
    /// If the image, the bones or the matches cannot be used. The track is then unchanged.
    pub fn track(&mut self, image: &DepthImage, bones: Option<&[Isometry3<f64>]>) -> Result<FrameReport, FrameError> {
        let before = self.twists.clone();
        let result = self.check(image, bones).and_then(|()| self.follow(image, bones));
        if result.is_err() {
            self.twists = before;
        }
        result
    }

    fn check(&self, image: &DepthImage, bones: Option<&[Isometry3<f64>]>) -> Result<(), FrameError> {
        let (expected, found) = ([self.camera.width, self.camera.height], [image.width, image.height]);
        if expected != found || image.depth.len() != found[0] * found[1] {
            return Err(FrameError::Size { expected, found });
        }
        if let Some(at) = image.depth.iter().position(|depth| !depth.is_finite()) {
            return Err(FrameError::NotANumber { u: at % image.width, v: at / image.width });
        }
        if image.valid() == 0 {
            return Err(FrameError::NothingMeasured);
        }
        let expected = self.model.bones.len();
        match bones {
            Some(bones) if bones.len() != expected => Err(FrameError::BoneCount { expected, found: bones.len() }),
            _ => Ok(()),
        }
    }

    fn follow(&mut self, image: &DepthImage, bones: Option<&[Isometry3<f64>]>) -> Result<FrameReport, FrameError> {
        let centred: Option<Vec<Isometry3<f64>>> =
            bones.map(|bones| bones.iter().map(|motion| self.model.centred(motion)).collect());
        self.energy.set_bones(&self.model, centred.as_deref());
        if let Some(motions) = &centred {
            self.start_from(motions);
        }
        let mut report = FrameReport { counts: MatchCounts::default(), iterations: Vec::new(), skeleton_energy: None };
        for iteration in 0..self.options.iterations {
            let moved = self.energy.moved(&self.twists);
            let gates = Gates { distance: self.distance(iteration), ..self.options.gates };
            let (pairs, counts) = correspondences(&moved, &self.model.origin, image, &self.camera, &gates);
            report.counts = counts;
            if counts.matched < self.options.least_matches {
                return Err(FrameError::TooFewMatches { counts, least: self.options.least_matches });
            }
            self.energy.set_pairs(&self.model, &pairs, &moved);
            let step = self.solver.iterate(&self.energy.terms(), &mut self.twists)?;
            let done = step.outcome != Outcome::Decreased;
            report.iterations.push(step);
            for twist in &mut self.twists {
                *twist = self.options.energy.angle.wrapped(twist);
            }
            if let (Some(motions), BoneMode::Known) = (&centred, self.options.energy.bones) {
                let lambda = self.options.energy.weights.skeleton;
                report.skeleton_energy = Some(skeleton_energy(&self.model, lambda, motions, &pairs));
            }
            if done
                && iteration + 1 < self.options.iterations
                && self.distance(iteration) <= self.options.gates.distance
            {
                break;
            }
        }
        Ok(report)
    }

    /// Returns the largest distance of a match in a search: a geometric sequence from the first to the last.
    fn distance(&self, iteration: usize) -> f64 {
        let (first, last) = (self.options.first_distance, self.options.gates.distance);
        let part = iteration as f64 / (self.options.iterations.max(2) - 1) as f64;
        first * (last / first).powf(part)
    }

    /// Moves nodes by the blend of their bones, and bones to the reported motions.
    fn start_from(&mut self, motions: &[Isometry3<f64>]) {
        let angle = self.options.energy.angle;
        let nodes = self.model.nodes.len();
        for (twist, row) in self.twists[..nodes].iter_mut().zip(&self.model.attachments.rows) {
            *twist = angle.twist(&blended(row.iter().copied().zip(motions)));
        }
        for (twist, motion) in self.twists[nodes..].iter_mut().zip(motions) {
            *twist = angle.twist(motion);
        }
    }

    /// Returns the tracked vertices and normals, in the model's coordinates.
    #[must_use]
    pub fn moved(&self) -> Moved {
        self.energy.moved(&self.twists)
    }
}
