//! Tracking of the figure of tubes, also with bad input.

use fusion_core::body::{figure, figure_motion};
use fusion_core::depth::{Camera, DepthImage, SensorNoise};
use fusion_core::energy::{BoneMode, EnergyOptions, FusionEnergy, NormalDerivative};
use fusion_core::evaluation::{ErrorSummary, FrameErrors};
use fusion_core::model::{DeformationModel, ModelError, ModelOptions};
use fusion_core::protocol::{Recording, reported_bones, skeleton_alone, track_recording};
use fusion_core::skeleton::{BoneNoise, Skeleton, SkeletonError};
use fusion_core::tracker::{FrameError, Tracker, TrackerOptions};
use fusion_core::twist::AngleConvention;

fn recording(frames: usize) -> Recording {
    let motions: Vec<_> = (0..=frames).map(|frame| figure_motion(frame as f64 / 30.0)).collect();
    Recording::new(&figure(), &motions, Camera::VGA, 2.6)
}

fn tracker(recording: &Recording, model: ModelOptions, options: TrackerOptions) -> Tracker {
    Tracker::new(DeformationModel::new(&recording.body, model).unwrap(), recording.camera, options).unwrap()
}

#[test]
fn noisy_bones_are_improved_upon() {
    let recording = recording(8);
    let noise = BoneNoise { turn: 0.0873, shift: 0.02 };
    let mut tracker = tracker(&recording, ModelOptions::default(), TrackerOptions::with_unknown_bones());
    let errors = track_recording(&recording, &mut tracker, SensorNoise::default(), Some(noise), |frame, result| {
        let report = result.as_ref().unwrap_or_else(|error| panic!("frame {frame}: {error}"));
        assert!(report.iterations.iter().all(|step| step.after <= step.before));
    });
    let (tracked, alone) = (errors.all(), skeleton_alone(&recording, noise).all());
    assert!(tracked.median < 12.0 && tracked.median < 0.5 * alone.median, "{tracked:?}, alone {alone:?}");
}

#[test]
fn every_choice_of_energy_tracks_the_figure() {
    let recording = recording(2);
    for k in [1, 4, 8] {
        for angle in [AngleConvention::HalfAngle, AngleConvention::RotationVector] {
            for normal in [NormalDerivative::Full, NormalDerivative::Frozen] {
                let mut options = TrackerOptions::default();
                (options.energy.angle, options.energy.normal) = (angle, normal);
                // Bones at rest, so that only the data moves the body.
                options.energy.weights.binding = 0.1;
                let model = ModelOptions { nodes_per_vertex: k, ..ModelOptions::default() };
                let mut tracker = tracker(&recording, model, options);
                for frame in 1..=2 {
                    tracker.track(&recording.image(frame, SensorNoise::default()), None).unwrap();
                }
                let truth = recording.truth(2).vertices;
                let errors = FrameErrors::new(&tracker.vertices(), &truth, &vec![true; truth.len()]);
                let median = ErrorSummary::of(errors.all).median;
                assert!(median < 6.0, "K = {k}, {angle:?}, {normal:?}: median {median} mm");
            }
        }
    }
}

#[test]
fn bad_frames_are_rejected_with_their_reason() {
    let recording = recording(2);
    let mut tracker = tracker(&recording, ModelOptions::default(), TrackerOptions::default());
    let good = recording.image(1, SensorNoise::default());
    tracker.track(&good, Some(&recording.motions[1])).unwrap();

    let empty = DepthImage::empty(640, 480);
    assert_eq!(tracker.track(&empty, None).unwrap_err(), FrameError::NothingMeasured);
    let mut nan = good.clone();
    nan.depth[640 * 7 + 5] = f32::NAN;
    assert_eq!(tracker.track(&nan, None).unwrap_err(), FrameError::NotANumber { u: 5, v: 7 });
    let small = DepthImage::empty(10, 10);
    assert!(matches!(tracker.track(&small, None).unwrap_err(), FrameError::Size { found: [10, 10], .. }));
    let mut wall = DepthImage::empty(640, 480);
    wall.depth.fill(5.0);
    assert!(matches!(tracker.track(&wall, None).unwrap_err(), FrameError::TooFewMatches { .. }));

    let (before, few) = (tracker.twists().to_vec(), &recording.motions[1][..3]);
    assert_eq!(tracker.track(&good, Some(few)).unwrap_err(), FrameError::BoneCount { expected: 16, found: 3 });
    assert_eq!(tracker.predict(Some(few)).unwrap_err(), FrameError::BoneCount { expected: 16, found: 3 });
    assert_eq!(tracker.twists(), before, "bit by bit");
    tracker.track(&recording.image(2, SensorNoise::default()), Some(&recording.motions[2])).unwrap();
}

/// Median distance in mm from the truth.
fn median_error(tracker: &Tracker, recording: &Recording, frame: usize) -> f64 {
    let truth = recording.truth(frame).vertices;
    ErrorSummary::of(FrameErrors::new(&tracker.vertices(), &truth, &vec![true; truth.len()]).all).median
}

#[test]
fn blank_frames_follow_the_bones() {
    let recording = recording(20);
    let blank = DepthImage::empty(640, 480);
    let noise = BoneNoise { turn: 0.0873, shift: 0.02 };
    let alone = skeleton_alone(&recording, noise).all().median;
    let runs = [(TrackerOptions::default(), BoneNoise::default()), (TrackerOptions::with_unknown_bones(), noise)];
    for (options, noise) in runs {
        let mut tracker = tracker(&recording, ModelOptions::default(), options);
        for frame in 1..=20 {
            let bones = reported_bones(&recording, frame, noise);
            let lost = (8..18).contains(&frame);
            let image = if lost { blank.clone() } else { recording.image(frame, SensorNoise::default()) };
            assert_eq!(tracker.track(&image, Some(&bones)).is_err(), lost, "frame {frame}");
            let median = median_error(&tracker, &recording, frame);
            let limit = if noise.shift > 0.0 { alone } else { 5.0 };
            assert!(median < limit, "frame {frame}: median {median} mm, limit {limit} mm");
        }
    }
}

#[test]
fn blank_frames_without_bones_continue_the_last_motion() {
    let recording = recording(12);
    let mut tracker = tracker(&recording, ModelOptions::default(), TrackerOptions::default());
    for frame in 1..=10 {
        tracker.track(&recording.image(frame, SensorNoise::default()), None).unwrap();
    }
    let frozen = median_error(&tracker, &recording, 12);
    tracker.track(&DepthImage::empty(640, 480), None).unwrap_err();
    tracker.predict(None).unwrap();
    let moved = median_error(&tracker, &recording, 12);
    assert!(moved < 0.9 * frozen, "median {moved} mm, frozen {frozen} mm");
    // The motion ends, so that a body that is lost for long stays near.
    let at = |tracker: &Tracker| tracker.vertices()[0];
    (0..100).for_each(|_| tracker.predict(None).unwrap());
    let rest = at(&tracker);
    tracker.predict(None).unwrap();
    assert!((at(&tracker) - rest).norm() < 1e-6);
}

#[test]
fn the_quality_of_a_frame_shows_its_agreement_with_the_image() {
    let recording = recording(2);
    let quality = |camera: Camera, image: &DepthImage| {
        let model = DeformationModel::new(&recording.body, ModelOptions::default()).unwrap();
        let mut tracker = Tracker::new(model, camera, TrackerOptions::default()).unwrap();
        tracker.track(image, Some(&recording.motions[1])).unwrap().quality
    };
    let image = recording.image(1, SensorNoise::default());
    let good = quality(recording.camera, &image);
    assert!(good.visible == 1.0 && good.inliers > 0.85 && good.residual < 0.003, "{good:?}");
    let mut half = image.clone();
    half.depth[..640 * 240].fill(0.0);
    let upper_half_missing = quality(recording.camera, &half);
    assert!(upper_half_missing.inliers < 0.7 * good.inliers, "{upper_half_missing:?}");
    // The camera shows the lower half only.
    let cropped = Camera { cy: recording.camera.cy - 240.0, height: 240, ..recording.camera };
    let lower = DepthImage { width: 640, height: 240, depth: image.depth[640 * 240..].to_vec() };
    let cropped = quality(cropped, &lower);
    assert!((0.2..0.8).contains(&cropped.visible) && cropped.inliers > 0.8, "{cropped:?}");
    let long = Camera { fx: 1.1 * recording.camera.fx, fy: 1.1 * recording.camera.fy, ..recording.camera };
    let wrong = quality(long, &image);
    assert!(wrong.residual > 1.5 * good.residual && wrong.inliers < 0.7 * good.inliers, "{wrong:?}, right {good:?}");
}

#[test]
fn invalid_models_are_rejected() {
    let body = figure();
    let refuse = |options| DeformationModel::new(&body, options).unwrap_err();
    let with = ModelOptions::default();
    assert_eq!(refuse(ModelOptions { nodes_per_vertex: 3, ..with }), ModelError::NodesPerVertex(3));
    let sparse = refuse(ModelOptions { node_radius: 1.0, nodes_per_vertex: 8, ..with });
    assert!(matches!(sparse, ModelError::TooFewNodes { needed: 8, radius_mm: 1000, .. }), "{sparse}");
    let nan = refuse(ModelOptions { node_radius: f64::NAN, ..with });
    assert!(matches!(&nan, ModelError::Option(option) if option.name == "model.node_radius"), "{nan}");
}

#[test]
fn a_missing_bone_is_named() {
    let body = figure();
    let mut skeleton = Skeleton::of(&body.bones);
    skeleton.push(&figure_motion(0.5));
    assert_eq!(skeleton.motions(0, &body.bones).unwrap().unwrap().len(), 16);
    assert!(skeleton.motions(1, &body.bones).unwrap().is_none());
    skeleton.bones[3] = "Tail".into();
    let error = skeleton.motions(0, &body.bones).unwrap_err();
    assert!(matches!(&error, SkeletonError::MissingBone { bone, .. } if bone == "Head"), "{error}");
}

#[test]
fn nodes_attached_to_the_nearest_bones_are_all_reached() {
    let options = ModelOptions { attachment_reach: Some(0.07), ..ModelOptions::default() };
    let model = DeformationModel::new(&figure(), options).unwrap();
    assert!(model.fill.left.is_empty() && model.fill.passes > 0, "{:?}", model.fill);
    for row in &model.attachments.rows {
        assert!((row.iter().sum::<f64>() - 1.0).abs() < 1e-12 && row.iter().all(|&share| share >= 0.0));
    }
}

#[test]
fn bones_as_unknowns_add_their_blocks() {
    let model = DeformationModel::new(&figure(), ModelOptions::default()).unwrap();
    let known = FusionEnergy::new(&model, EnergyOptions::default()).unwrap();
    let mut options = EnergyOptions::default();
    options.bones = BoneMode::Unknown;
    let unknown = FusionEnergy::new(&model, options).unwrap();
    assert_eq!(unknown.pattern().rows(), known.pattern().rows() + 16);
    let names: Vec<&str> = unknown.terms().iter().map(|term| term.name()).collect();
    assert_eq!(names, ["nonrigid", "graph", "skeleton", "binding", "prior", "joints"]);
}
