//! Tracking from one depth image to the next.

mod bone_trust;
mod options;
mod prediction;
mod report;
mod state;

use std::sync::Arc;

use energy_solve::{GaussNewton, GaussNewtonOptions, NormalSolverKind, Outcome};
use nalgebra::{Isometry3, Vector3};

use self::bone_trust::BoneTrust;
pub use self::options::TrackerOptions;
use self::prediction::Prediction;
pub use self::report::{FrameError, FrameQuality, FrameReport, TrackerError};
pub use self::state::{TrackerState, TrackerStateError};
use crate::correspondence::{Gates, MatchCounts, correspondences};
use crate::depth::{Camera, DepthImage, NormalMap, PixelRays};
use crate::energy::{BoneMode, BoneTargets, FusionEnergy, Moved, skeleton_energy};
use crate::model::DeformationModel;
use crate::silhouette::BodyView;
use crate::twist::{Twist, blended};

/// Tracks a model through depth images.
#[derive(Debug)]
pub struct Tracker {
    model: DeformationModel,
    /// Behind a counted reference: frames borrow it while the twists change.
    rays: Arc<PixelRays>,
    options: TrackerOptions,
    energy: FusionEnergy,
    solver: GaussNewton<6>,
    /// Twists of the nodes, then of the bones if these are unknowns.
    twists: Vec<Twist>,
    /// Motion of each node relative to its bones: T_i = B_i L_i, with the blend B_i of its bones.
    offsets: Vec<Isometry3<f64>>,
    node_prediction: Prediction,
    bone_prediction: Prediction,
    bone_trust: BoneTrust,
}

/// Motions from which a frame starts.
struct Start {
    /// Bones reported for the frame, in the model's coordinates.
    reported: Option<Vec<Isometry3<f64>>>,
    /// Bones expected from the last frames.
    expected_bones: Vec<Isometry3<f64>>,
    /// Nodes expected from the last frames.
    expected_nodes: Vec<Isometry3<f64>>,
}

impl Tracker {
    /// Creates a tracker of a model at rest, in the camera's coordinates.
    ///
    /// # Errors
    /// If an option or the camera cannot be used, bones are unknowns and there are too few, or memory runs out.
    pub fn new(model: DeformationModel, camera: Camera, options: TrackerOptions) -> Result<Self, TrackerError> {
        options.validate()?;
        let rays = Arc::new(PixelRays::new(camera)?);
        let energy = FusionEnergy::new(&model, options.energy)?;
        let solver = match options.solver_tolerance {
            Some(relative_tolerance) => {
                NormalSolverKind::ConjugateGradients { relative_tolerance, iteration_limit: MOST_SOLVER_ITERATIONS }
            }
            None => NormalSolverKind::Cholesky,
        };
        let mut steps = GaussNewtonOptions::default();
        (steps.damping, steps.solver, steps.two_threads) = (options.damping, solver, true);
        let solver = GaussNewton::new(energy.pattern().clone(), steps)?;
        let twists = vec![[0.0; 6]; energy.pattern().rows()];
        let offsets = vec![Isometry3::identity(); model.nodes.len()];
        let node_prediction = Prediction::new(model.nodes.clone());
        let bone_prediction = Prediction::new(model.bones.iter().map(|bone| bone.head.into()).collect());
        let bone_trust = BoneTrust::default();
        Ok(Self { model, rays, options, energy, solver, twists, offsets, node_prediction, bone_prediction, bone_trust })
    }

    /// Returns the model.
    #[must_use]
    pub fn model(&self) -> &DeformationModel {
        &self.model
    }

    /// Returns the rays of the camera's pixels.
    #[must_use]
    pub fn rays(&self) -> &PixelRays {
        &self.rays
    }

    /// Returns the twists of the nodes, in the model's coordinates.
    #[must_use]
    pub fn twists(&self) -> &[Twist] {
        &self.twists[..self.model.nodes.len()]
    }

    /// Returns the tracked vertices, in the camera's coordinates.
    #[must_use]
    pub fn vertices(&self) -> Vec<Vector3<f64>> {
        self.vertices_at(self.twists())
    }

    /// Returns the vertices that [`Self::vertices`] returned when the nodes had these twists, in the camera's
    /// coordinates.
    ///
    /// # Panics
    /// If there are fewer twists than nodes.
    #[must_use]
    pub fn vertices_at(&self, twists: &[Twist]) -> Vec<Vector3<f64>> {
        let mut unknowns = self.twists.clone();
        unknowns[..self.model.nodes.len()].copy_from_slice(&twists[..self.model.nodes.len()]);
        self.energy.moved(&unknowns).vertices.iter().map(|vertex| vertex + self.model.origin).collect()
    }

    /// Returns the motion of each vertex from rest; see [`DeformationModel::vertex_motions`].
    #[must_use]
    pub fn vertex_motions(&self) -> Vec<Isometry3<f64>> {
        self.vertex_motions_at(self.twists())
    }

    /// Returns the motion of each vertex from rest when the nodes have these twists.
    ///
    /// # Panics
    /// If there are fewer twists than nodes.
    #[must_use]
    pub fn vertex_motions_at(&self, twists: &[Twist]) -> Vec<Isometry3<f64>> {
        self.model.vertex_motions(twists, self.options.energy.angle)
    }

    /// Returns the tracked vertices and normals, in the model's coordinates.
    #[must_use]
    pub fn moved(&self) -> Moved {
        self.energy.moved(&self.twists)
    }

    /// Tracks one image. `bones` are a body tracker's motions of the model's bones from rest, in the camera's
    /// coordinates. With them, nodes start at the blend of their bones and keep their offset from it; without, they
    /// continue their last motion.
    ///
    /// # Errors
    /// If the image or the matches cannot be used: the body then moves as by [`Self::predict`]. If the number of bones
    /// is wrong: the track is then unchanged.
    pub fn track(&mut self, image: &DepthImage, bones: Option<&[Isometry3<f64>]>) -> Result<FrameReport, FrameError> {
        self.check_bones(bones)?;
        let before = self.twists.clone();
        let start = self.start(bones);
        let result = self.check_image(image).and_then(|()| self.follow(image, &start));
        match &result {
            Ok(_) => self.finish(&start),
            Err(_) => {
                self.twists = before;
                self.move_without_data(&start);
            }
        }
        result
    }

    /// Moves the body in a frame without an image: by its bones, or else by its last motion, which slows down.
    ///
    /// # Errors
    /// If the number of bones is wrong, or no step can be computed. The track is then unchanged.
    pub fn predict(&mut self, bones: Option<&[Isometry3<f64>]>) -> Result<(), FrameError> {
        self.check_bones(bones)?;
        let start = self.start(bones);
        self.move_without_data(&start);
        Ok(())
    }

    fn check_bones(&self, bones: Option<&[Isometry3<f64>]>) -> Result<(), FrameError> {
        let expected = self.model.bones.len();
        match bones {
            Some(bones) if bones.len() != expected => Err(FrameError::BoneCount { expected, found: bones.len() }),
            _ => Ok(()),
        }
    }

    fn check_image(&self, image: &DepthImage) -> Result<(), FrameError> {
        let camera = self.rays.camera();
        let (expected, found) = ([camera.width, camera.height], [image.width, image.height]);
        if expected != found || image.depth.len() != found[0] * found[1] {
            return Err(FrameError::Size { expected, found });
        }
        if let Some(at) = image.depth.iter().position(|depth| !depth.is_finite()) {
            return Err(FrameError::NotANumber { u: at % image.width, v: at / image.width });
        }
        if image.valid() == 0 {
            return Err(FrameError::NothingMeasured);
        }
        Ok(())
    }

    /// Collects what is known before the image, and moves the unknowns there.
    fn start(&mut self, bones: Option<&[Isometry3<f64>]>) -> Start {
        let reported: Option<Vec<Isometry3<f64>>> = bones
            .filter(|bones| !bones.is_empty())
            .map(|bones| bones.iter().map(|motion| self.model.centred(motion)).collect());
        Start { reported, expected_bones: self.bone_prediction.next(), expected_nodes: self.node_prediction.next() }
    }

    /// Sets the targets of bones and nodes, and moves the unknowns to the start.
    fn place(&mut self, start: &Start) {
        let trust = if self.options.adapt_prior { self.bone_trust.factor() } else { 1.0 };
        let targets = BoneTargets { reported: start.reported.as_deref(), expected: &start.expected_bones, trust };
        self.energy.set_bones(&self.model, &targets);
        let (angle, nodes) = (self.options.energy.angle, self.model.nodes.len());
        let bones = match (self.options.energy.bones, &start.reported) {
            (BoneMode::Unknown, _) => Some(self.energy.bone_start(&targets)),
            (BoneMode::Known, reported) => reported.clone(),
        };
        let Some(bones) = bones else {
            for (twist, motion) in self.twists.iter_mut().zip(&start.expected_nodes) {
                *twist = angle.twist(motion);
            }
            return;
        };
        for (i, row) in self.model.attachments.rows.iter().enumerate() {
            let blend = blended(row.iter().copied().zip(&bones));
            self.twists[i] = angle.twist(&(blend * self.offsets[i]));
        }
        for (twist, motion) in self.twists[nodes..].iter_mut().zip(&bones) {
            *twist = angle.twist(motion);
        }
    }

    fn follow(&mut self, image: &DepthImage, start: &Start) -> Result<FrameReport, FrameError> {
        self.place(start);
        let mut report = FrameReport {
            counts: MatchCounts::default(),
            iterations: Vec::new(),
            skeleton_energy: None,
            quality: FrameQuality::default(),
        };
        let rays = Arc::clone(&self.rays);
        let mut normals = NormalMap::new(image, &rays, self.options.gates.normal_reach);
        let mut hidden = None;
        for iteration in 0..self.options.iterations {
            let moved = self.energy.moved(&self.twists);
            let mesh = self.model.seen(moved.vertices.iter().copied());
            let view = (self.options.silhouette || hidden.is_none()).then(|| BodyView::new(&mesh, rays.camera()));
            if let (None, Some(view)) = (&hidden, &view) {
                hidden = Some(view.hidden(&mesh.vertices, HIDDEN));
            }
            let gates = Gates { distance: self.distance(iteration), ..self.options.gates };
            let origin = &self.model.origin;
            let hidden = hidden.as_deref().unwrap_or_default();
            let (mut pairs, counts) = correspondences(&moved, origin, &mut normals, &gates, hidden);
            if let Some(view) = view.filter(|_| self.options.silhouette) {
                pairs.extend(view.uncovered(&mesh, image, &rays, origin, gates.distance));
            }
            report.counts = counts;
            if counts.matched < self.options.least_matches {
                return Err(FrameError::TooFewMatches { counts, least: self.options.least_matches });
            }
            self.energy.set_pairs(&self.model, &pairs, &moved);
            if let (BoneMode::Known, Some(reported)) = (self.options.energy.bones, &start.reported) {
                self.energy.bind(&self.model, reported, Some(&self.twists));
            }
            let step = self.solver.iterate(&self.energy.terms(), &mut self.twists)?;
            let done = step.outcome != Outcome::Decreased;
            report.iterations.push(step);
            self.wrap();
            if let (Some(motions), BoneMode::Known) = (&start.reported, self.options.energy.bones) {
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
        report.quality = self.quality(&mut normals);
        Ok(report)
    }

    fn wrap(&mut self) {
        for twist in &mut self.twists {
            *twist = self.options.energy.angle.wrapped(twist);
        }
    }

    /// Compares the tracked body with the image.
    fn quality(&self, normals: &mut NormalMap<'_>) -> FrameQuality {
        let moved = self.energy.moved(&self.twists);
        let mesh = self.model.seen(moved.vertices.iter().copied());
        let hidden = BodyView::new(&mesh, self.rays.camera()).hidden(&mesh.vertices, HIDDEN);
        let (pairs, counts) = correspondences(&moved, &self.model.origin, normals, &self.options.gates, &hidden);
        FrameQuality::new(&moved, &pairs, &counts)
    }

    /// Moves nodes and bones to the minimum of the energy without data; without bones, by the last motion.
    fn move_without_data(&mut self, start: &Start) {
        self.place(start);
        let has_bones = start.reported.is_some() || self.options.energy.bones == BoneMode::Unknown;
        if has_bones {
            self.energy.set_pairs(&self.model, &[], &Moved::default());
            let placed = self.twists.clone();
            for _ in 0..WITHOUT_DATA {
                if self.solver.iterate(&self.energy.terms(), &mut self.twists).is_err() {
                    self.twists.clone_from(&placed);
                    break;
                }
                self.wrap();
            }
        }
        self.finish(start);
        self.node_prediction.slow_down();
        self.bone_prediction.slow_down();
    }

    /// Remembers the frame for the next start.
    fn finish(&mut self, start: &Start) {
        let (angle, count) = (self.options.energy.angle, self.model.nodes.len());
        let motions: Vec<Isometry3<f64>> = self.twists.iter().map(|twist| angle.motion(twist)).collect();
        let (nodes, bones) = motions.split_at(count);
        self.node_prediction.update(&start.expected_nodes, nodes);
        let bones = match (self.options.energy.bones, &start.reported) {
            (BoneMode::Unknown, _) => bones,
            (BoneMode::Known, Some(reported)) => reported,
            (BoneMode::Known, None) => return,
        };
        if let (BoneMode::Unknown, Some(reported)) = (self.options.energy.bones, &start.reported) {
            self.bone_trust.update(self.energy.bone_difference(&self.model.bones, bones, reported));
        }
        self.bone_prediction.update(&start.expected_bones, bones);
        for (i, row) in self.model.attachments.rows.iter().enumerate() {
            self.offsets[i] = blended(row.iter().copied().zip(bones)).inverse() * nodes[i];
        }
    }

    /// Returns the largest distance of a match in a search: a geometric sequence from the first to the last.
    fn distance(&self, iteration: usize) -> f64 {
        let (first, last) = (self.options.first_distance, self.options.gates.distance);
        let part = iteration as f64 / (self.options.iterations.max(2) - 1) as f64;
        first * (last / first).powf(part)
    }
}

/// Steps in a frame without data, whose energy is nearly quadratic.
const WITHOUT_DATA: usize = 3;

/// Distance in m behind the visible surface from which a vertex counts as hidden.
const HIDDEN: f64 = 0.03;

/// Iterations of conjugate gradients after which the damping grows.
const MOST_SOLVER_ITERATIONS: usize = 1000;
