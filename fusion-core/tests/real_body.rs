//! The protocol on a scanned body and captured motion, if the data is available: `base.obj`, `rig.cmu_mb.json`,
//! `weights.cmu_mb.json` and `01_01.bvh` in the folder `FUSION_BODY`, or in a folder `human` next to the workspace.
//!
//! Weights and limits were chosen on frames 420–660, 1000–1240 and 1800–2040 with seed 0 and the camera in front.

use std::path::{Path, PathBuf};

use fusion_core::body::{Mesh, SkinnedBody, read_makehuman};
use fusion_core::depth::{Camera, DepthImage, SensorNoise, render, visible_vertices};
use fusion_core::evaluation::{ErrorSummary, FrameErrors, SurfaceDistance, TrackErrors};
use fusion_core::model::{DeformationModel, ModelOptions};
use fusion_core::model_size::fit_size;
use fusion_core::protocol::{Recording, at_place_of, reported_bones, skeleton_alone};
use fusion_core::skeleton::{BoneNoise, Bvh, Retarget};
use fusion_core::tracker::{Tracker, TrackerOptions};
use nalgebra::{Isometry3, Vector3};

const WINDOWS: [usize; 9] = [20, 420, 700, 1000, 1300, 1540, 1800, 2100, 2400];
const TUNED: usize = 420;
const NOISY: BoneNoise = BoneNoise { turn: 5.0 * std::f64::consts::PI / 180.0, shift: 0.02 };

fn folder() -> Option<PathBuf> {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data/human");
    let folder = std::env::var_os("FUSION_BODY").map_or(beside, PathBuf::from);
    let exists = folder.join("base.obj").exists();
    if !exists {
        eprintln!("skipped: no data of a real body; name its folder in FUSION_BODY");
    }
    exists.then_some(folder)
}

/// The body and its captured motion.
struct Capture {
    body: SkinnedBody,
    motion: Bvh,
}

impl Capture {
    fn read(folder: &Path) -> Self {
        let file = |name: &str| folder.join(name);
        let body = read_makehuman(&file("base.obj"), &file("rig.cmu_mb.json"), &file("weights.cmu_mb.json")).unwrap();
        assert_eq!((body.mesh.vertices.len(), body.bones.len()), (13_380, 31));
        Self { body, motion: Bvh::read(&file("01_01.bvh")).unwrap() }
    }

    /// Records two seconds of the motion: 240 frames at 120 Hz, or every `step`-th of them.
    fn recording(&self, first: usize, step: usize, view: View) -> Recording {
        self.seen(&self.motions(first, step), view)
    }

    /// Records the same after a T pose at the place of its first frame, as `fusion render --t-pose` does.
    fn recording_after_t_pose(&self, first: usize, step: usize, view: View) -> Recording {
        let frames = self.motions(first, step);
        let t_pose = at_place_of(&self.body.bones, &self.motions(0, 240)[0], &frames[0]);
        self.seen(&[vec![t_pose], frames].concat(), view)
    }

    fn motions(&self, first: usize, step: usize) -> Vec<Vec<Isometry3<f64>>> {
        let retarget = Retarget::new(&self.body.bones, &self.motion).unwrap();
        (first..=first + 240).step_by(step).map(|frame| retarget.motions(frame).unwrap()).collect()
    }

    fn seen(&self, frames: &[Vec<Isometry3<f64>>], view: View) -> Recording {
        let azimuth = view.azimuth.to_radians();
        let mut recording = Recording::seen_from(&self.body, frames, Camera::VGA, view.distance, azimuth);
        recording.seed = view.seed;
        recording
    }
}

/// The camera's azimuth in degrees and distance in m, and the seed of the noise.
#[derive(Clone, Copy)]
struct View {
    azimuth: f64,
    distance: f64,
    seed: u64,
}

const FRONT: View = View { azimuth: 0.0, distance: 2.6, seed: 0 };

/// A run of the tracker on a recording.
struct Run<'a> {
    recording: &'a Recording,
    options: TrackerOptions,
    bones: Option<BoneNoise>,
    sensor: SensorNoise,
    /// Size of the model relative to the body.
    size: f64,
}

impl<'a> Run<'a> {
    fn exact(recording: &'a Recording) -> Self {
        let bones = Some(BoneNoise::default());
        Self { recording, options: TrackerOptions::default(), bones, sensor: SensorNoise::default(), size: 1.0 }
    }

    fn noisy(recording: &'a Recording) -> Self {
        let options = TrackerOptions::with_unknown_bones();
        Self { options, bones: Some(NOISY), ..Self::exact(recording) }
    }

    fn without_bones(recording: &'a Recording) -> Self {
        Self { options: TrackerOptions::without_bones(), bones: None, ..Self::exact(recording) }
    }

    /// Tracks the recording's images after `edit` changed them. Returns the errors and the number of lost frames.
    fn errors(&self, edit: impl Fn(usize, &mut DepthImage)) -> (TrackErrors, usize) {
        let Self { recording, .. } = self;
        let mut body = scaled(&recording.body, self.size);
        // `fusion track` does the same: the first image shows the model at rest.
        if let Some(fit) = fit_size(&body, &recording.camera, &recording.image(0, self.sensor)) {
            body = fit.applied(&body);
        }
        let model = DeformationModel::new(&body, ModelOptions::default()).unwrap();
        let mut tracker = Tracker::new(model, recording.camera, self.options).unwrap();
        let (mut errors, mut lost) = (TrackErrors::default(), 0);
        for frame in 1..recording.motions.len() {
            let mut image = recording.image(frame, self.sensor);
            edit(frame, &mut image);
            let bones = self.bones.map(|noise| reported_bones(recording, frame, noise));
            lost += usize::from(tracker.track(&image, bones.as_deref()).is_err());
            let truth = recording.truth(frame);
            let seen = visible_vertices(&truth, &recording.camera);
            errors.frames.push(FrameErrors::new(&tracker.vertices(), &truth.vertices, &seen));
        }
        (errors, lost)
    }
}

fn scaled(body: &SkinnedBody, size: f64) -> SkinnedBody {
    let mut body = body.clone();
    let centre = body.mesh.centroid();
    let grow = |point: nalgebra::Vector3<f64>| centre + size * (point - centre);
    body.mesh.vertices.iter_mut().for_each(|vertex| *vertex = grow(*vertex));
    for bone in &mut body.bones {
        (bone.head, bone.tail) = (grow(bone.head.into()).into(), grow(bone.tail.into()).into());
    }
    body
}

fn print(name: &str, errors: &TrackErrors, lost: usize) -> ErrorSummary {
    let (all, seen) = (errors.all(), errors.visible());
    println!(
        "{name:32} mean {:5.2} mm, median {:5.2} mm, 95 % {:5.1} mm, share < 25 mm {:.3}; visible mean {:5.2} mm; \
         {lost} frames lost",
        all.mean, all.median, all.p95, all.share_below_25, seen.mean
    );
    all
}

/// Removes pixels at random.
fn with_holes(share: f64) -> impl Fn(usize, &mut DepthImage) {
    move |frame, image| {
        let mut random = fastrand::Rng::with_seed(99 + frame as u64);
        image.depth.iter_mut().filter(|_| random.f64() < share).for_each(|depth| *depth = 0.0);
    }
}

/// Moves a pole of 10 cm through the image in two seconds at 30 Hz, 1.5 m away.
fn pole(frame: usize, image: &mut DepthImage) {
    let (centre, half) = (frame as f64 / 60.0 * 640.0, 0.05 * 525.0 / 1.5);
    for (at, depth) in image.depth.iter_mut().enumerate() {
        if ((at % 640) as f64 - centre).abs() < half {
            *depth = 1.5;
        }
    }
}

fn unchanged(_: usize, _: &mut DepthImage) {}

#[test]
fn a_real_body_is_tracked() {
    let Some(folder) = folder() else { return };
    let capture = Capture::read(&folder);
    // In the second window the first frame has the hands next to the thighs.
    for (first, step) in [(TUNED, 4), (1800, 8)] {
        let recording = capture.recording(first, step, FRONT);
        let (errors, lost) = Run::exact(&recording).errors(unchanged);
        let exact = print(&format!("{first}, exact bones"), &errors, lost);
        assert!(exact.median <= 3.0 && exact.mean <= 6.0 && lost == 0, "{exact:?}");
        let (errors, lost) = Run::noisy(&recording).errors(unchanged);
        let noisy = print(&format!("{first}, noisy bones"), &errors, lost);
        assert!(noisy.mean <= 12.0 && noisy.median <= 7.0 && noisy.p95 <= 35.0 && lost == 0, "{noisy:?}");
    }
}

#[test]
#[ignore = "takes minutes; run it in a release build"]
fn every_window_is_tracked() {
    let Some(folder) = folder() else { return };
    let capture = Capture::read(&folder);
    let mut all = TrackErrors::default();
    let views = [1, 2, 3].map(|seed| View { seed, ..FRONT }).into_iter().chain([View { azimuth: 60.0, ..FRONT }]);
    for view in views {
        println!("camera at {}°, seed {}", view.azimuth, view.seed);
        for first in WINDOWS {
            let recording = capture.recording(first, 4, view);
            let (mut errors, lost) = Run::noisy(&recording).errors(unchanged);
            let noisy = print(&format!("{first}–{}, noisy bones", first + 240), &errors, lost);
            let alone =
                print(&format!("{first}–{}, skeleton alone", first + 240), &skeleton_alone(&recording, NOISY), 0);
            assert!(noisy.mean <= 12.0 && noisy.p95 <= 35.0 && noisy.mean < alone.mean, "{first}: {noisy:?}");
            all.frames.append(&mut errors.frames);
        }
    }
    assert!(print("noisy bones, all windows", &all, 0).median <= 7.0);
    for first in WINDOWS {
        let recording = capture.recording(first, 4, FRONT);
        let (errors, lost) = Run::exact(&recording).errors(unchanged);
        let exact = print(&format!("{first}–{}, exact bones", first + 240), &errors, lost);
        assert!(exact.mean <= 5.0, "{first}: {exact:?}");
    }
}

#[test]
#[ignore = "takes minutes; run it in a release build"]
fn a_t_pose_as_rest_is_tracked() {
    let Some(folder) = folder() else { return };
    let capture = Capture::read(&folder);
    for seed in [0, 1] {
        for first in WINDOWS {
            let name = |kind: &str| format!("{first}–{}, T pose, seed {seed}, {kind}", first + 240);
            let recording = capture.recording_after_t_pose(first, 4, View { seed, ..FRONT });
            let (errors, lost) = Run::noisy(&recording).errors(unchanged);
            let noisy = print(&name("noisy bones"), &errors, lost);
            let alone = print(&name("skeleton alone"), &skeleton_alone(&recording, NOISY), 0);
            assert!(noisy.mean <= 12.0 && noisy.p95 <= 35.0 && noisy.mean < alone.mean, "{first}: {noisy:?}");
            let (errors, lost) = Run::exact(&recording).errors(unchanged);
            let exact = print(&name("exact bones"), &errors, lost);
            assert!(exact.mean <= 5.0, "{first}: {exact:?}");
        }
    }
}

#[test]
#[ignore = "takes minutes; run it in a release build"]
fn variations_of_the_data() {
    let Some(folder) = folder() else { return };
    let capture = Capture::read(&folder);
    let recording = capture.recording(TUNED, 4, FRONT);
    let alone = print("skeleton alone", &skeleton_alone(&recording, NOISY), 0).mean;
    let clean = Run::noisy(&recording);
    let clean_mean = print("clean", &clean.errors(unchanged).0, 0).mean;
    let show = |name: &str, run: &Run, edit: &dyn Fn(usize, &mut DepthImage), limit: f64| {
        let (errors, lost) = run.errors(edit);
        let mean = print(name, &errors, lost).mean;
        assert!(mean <= limit, "{name}: {mean} mm, limit {limit} mm");
    };
    let without = |frames: std::ops::Range<usize>| {
        move |frame: usize, image: &mut DepthImage| {
            if frames.contains(&frame) {
                image.depth.fill(0.0);
            }
        }
    };
    show("frames 20–30 blank", &clean, &without(20..30), alone);
    show("out of view from frame 20 on", &clean, &without(20..61), alone);
    show("50 % of the pixels missing", &clean, &with_holes(0.5), 1.5 * clean_mean);
    show("80 % of the pixels missing", &clean, &with_holes(0.8), 2.0 * clean_mean);
    show("a pole in front", &clean, &pole, 1.5 * clean_mean);
    let noise = SensorNoise { factor: 0.6, ..SensorNoise::default() };
    show("twice the sensor noise", &Run { sensor: noise, ..Run::noisy(&recording) }, &unchanged, 1.5 * clean_mean);
    show("model 3 % too large", &Run { size: 1.03, ..Run::noisy(&recording) }, &unchanged, 1.5 * clean_mean);
    show("model 3 % too small", &Run { size: 0.97, ..Run::noisy(&recording) }, &unchanged, 1.5 * clean_mean);
    let bones = BoneNoise { turn: 2.0 * NOISY.turn, shift: 2.0 * NOISY.shift };
    show(
        "bones at twice the error",
        &Run { bones: Some(bones), ..Run::noisy(&recording) },
        &unchanged,
        2.0 * clean_mean,
    );
    let side = capture.recording(TUNED, 4, View { azimuth: 90.0, ..FRONT });
    show("camera at 90°", &Run::noisy(&side), &unchanged, alone);
    let far = capture.recording(TUNED, 4, View { distance: 4.0, ..FRONT });
    show("camera at 4 m", &Run::noisy(&far), &unchanged, 1.5 * clean_mean);
    let fast = capture.recording(TUNED, 1, FRONT);
    show("no bones, 120 Hz", &Run::without_bones(&fast), &unchanged, f64::INFINITY);
    show("no bones, 30 Hz", &Run::without_bones(&recording), &unchanged, f64::INFINITY);
}

/// Bones whose skin ripples.
const TRUNK: [&str; 4] = ["Hips", "LowerBack", "Spine", "Spine1"];

/// Returns the weight of the trunk's bones at each vertex.
fn trunk_share(body: &SkinnedBody) -> Vec<f64> {
    let of_trunk = |bone: usize| TRUNK.contains(&body.bones[bone].name.as_str());
    body.weights.iter().map(|row| row.iter().filter(|(bone, _)| of_trunk(*bone)).map(|(_, w)| w).sum()).collect()
}

/// Returns the true mesh with waves that run up the trunk once a second: ± 40 mm along normals, from half a second on.
fn rippled(recording: &Recording, frame: usize, wavelength: f64, share: &[f64]) -> Mesh {
    let time = frame as f64 / 30.0;
    let amplitude = 0.04 * (time / 0.5).min(1.0);
    let mut body = recording.body.clone();
    for (vertex, place) in body.mesh.vertices.iter_mut().enumerate() {
        let phase = std::f64::consts::TAU * (place.y / wavelength - time);
        *place += amplitude * share[vertex] * phase.sin() * body.mesh.normals[vertex];
    }
    let posed = body.posed(&recording.motions[frame]);
    Mesh::new(posed.vertices, posed.triangles)
}

#[test]
#[ignore = "takes minutes; run it in a release build"]
fn waves_that_no_bone_explains_are_followed() {
    let Some(folder) = folder() else { return };
    let recording = Capture::read(&folder).recording(TUNED, 4, FRONT);
    let share = trunk_share(&recording.body);
    for wavelength in [0.4, 0.3] {
        let model = DeformationModel::new(&recording.body, ModelOptions::default()).unwrap();
        let mut tracker = Tracker::new(model, recording.camera, TrackerOptions::default()).unwrap();
        let (mut tracked, mut skinned) = (Vec::new(), Vec::new());
        for frame in 1..recording.motions.len() {
            let truth = rippled(&recording, frame, wavelength, &share);
            let mut image = render(&truth, &recording.camera);
            SensorNoise::default().add(&mut image, &mut fastrand::Rng::with_seed(frame as u64));
            tracker.track(&image, Some(&recording.motions[frame])).unwrap();
            let distance = SurfaceDistance::new(&truth);
            let seen = visible_vertices(&truth, &recording.camera);
            let on_trunk: Vec<usize> = (0..seen.len()).filter(|&at| seen[at] && share[at] > 0.5).collect();
            let (found, bones) = (tracker.vertices(), recording.truth(frame).vertices);
            tracked.extend(on_trunk.iter().map(|&at| 1e3 * distance.of(&found[at])));
            skinned.extend(on_trunk.iter().map(|&at| 1e3 * distance.of(&bones[at])));
        }
        let (tracked, skinned) = (ErrorSummary::of(tracked), ErrorSummary::of(skinned));
        println!(
            "waves of {wavelength} m: {:.2} mm from the surface, bones alone {:.1} mm",
            tracked.mean, skinned.mean
        );
        assert!(tracked.mean <= 4.0 && skinned.mean > 10.0, "{tracked:?}, {skinned:?}");
    }
}

/// A soft belly on a spring: it follows the hips with a lag, and swings after them.
struct Belly {
    /// Share of each vertex: 1 in the middle of the belly, 0 from a distance of [`Belly::RADIUS`] on.
    share: Vec<f64>,
    /// Displacement along the normals in each frame, in m.
    bulge: Vec<f64>,
}

impl Belly {
    /// Radius of the bump, in m.
    const RADIUS: f64 = 0.125;
    /// Largest displacement, in m.
    const LARGEST: f64 = 0.04;
    /// Frequency without damping, in Hz, and the damping ratio.
    const FREQUENCY: f64 = 1.5;
    const DAMPING: f64 = 0.05;

    fn new(recording: &Recording) -> Self {
        let body = &recording.body;
        let bone = |name: &str| body.bones.iter().position(|bone| bone.name == name).unwrap();
        let (hips, back) = (bone("Hips"), bone("LowerBack"));
        let height = body.bones[back].tail[1];
        let trunk = trunk_share(body);
        // The camera looks along z at the front of the body.
        let middle = (0..trunk.len())
            .filter(|&at| trunk[at] > 0.9 && (body.mesh.vertices[at].y - height).abs() < 0.03)
            .min_by(|&a, &b| body.mesh.vertices[a].z.total_cmp(&body.mesh.vertices[b].z))
            .unwrap();
        let middle = body.mesh.vertices[middle];
        let bump = |place: &Vector3<f64>| {
            let part = (place - middle).norm() / Self::RADIUS;
            (0.5 * std::f64::consts::PI * part.min(1.0)).cos().powi(2)
        };
        let share = body.mesh.vertices.iter().zip(&trunk).map(|(place, trunk)| trunk * bump(place)).collect();
        let head = body.bones[hips].head.into();
        let heights: Vec<f64> =
            recording.motions.iter().map(|motions| motions[hips].transform_point(&head).y).collect();
        Self { share, bulge: Self::bulge(&heights) }
    }

    /// Returns the distances between the hips and a mass on a spring that hangs from them, scaled to the largest
    /// displacement.
    fn bulge(heights: &[f64]) -> Vec<f64> {
        const STEPS: usize = 100;
        let rate = std::f64::consts::TAU * Self::FREQUENCY;
        let step = 1.0 / 30.0 / STEPS as f64;
        let (mut place, mut speed) = (heights[0], 0.0);
        let mut lag = vec![0.0];
        for pair in heights.windows(2) {
            let hips = (pair[1] - pair[0]) * 30.0;
            for at in 0..STEPS {
                let height = pair[0] + hips * at as f64 * step;
                speed += step * (rate * rate * (height - place) + 2.0 * Self::DAMPING * rate * (hips - speed));
                place += step * speed;
            }
            lag.push(place - pair[1]);
        }
        let largest = lag.iter().fold(0.0, |largest: f64, lag| largest.max(lag.abs()));
        lag.iter().map(|lag| lag * Self::LARGEST / largest).collect()
    }

    /// Returns the true mesh in a frame.
    fn truth(&self, recording: &Recording, frame: usize) -> Mesh {
        let mut body = recording.body.clone();
        for (at, vertex) in body.mesh.vertices.iter_mut().enumerate() {
            *vertex += self.bulge[frame] * self.share[at] * body.mesh.normals[at];
        }
        let posed = body.posed(&recording.motions[frame]);
        Mesh::new(posed.vertices, posed.triangles)
    }

    /// Tracks the body by noisy bones. Returns the distances of the visible belly from the true surface in mm, tracked
    /// and skinned by the true bones.
    fn distances(&self, recording: &Recording, options: TrackerOptions) -> [ErrorSummary; 2] {
        let model = DeformationModel::new(&recording.body, ModelOptions::default()).unwrap();
        let mut tracker = Tracker::new(model, recording.camera, options).unwrap();
        let (mut tracked, mut skinned) = (Vec::new(), Vec::new());
        for frame in 1..recording.motions.len() {
            let truth = self.truth(recording, frame);
            let mut image = render(&truth, &recording.camera);
            SensorNoise::default().add(&mut image, &mut fastrand::Rng::with_seed(frame as u64));
            tracker.track(&image, Some(&reported_bones(recording, frame, NOISY))).unwrap();
            let distance = SurfaceDistance::new(&truth);
            let seen = visible_vertices(&truth, &recording.camera);
            let of_belly: Vec<usize> = (0..seen.len()).filter(|&at| seen[at] && self.share[at] > 0.5).collect();
            let (found, bones) = (tracker.vertices(), recording.truth(frame).vertices);
            tracked.extend(of_belly.iter().map(|&at| 1e3 * distance.of(&found[at])));
            skinned.extend(of_belly.iter().map(|&at| 1e3 * distance.of(&bones[at])));
        }
        [tracked, skinned].map(ErrorSummary::of)
    }
}

#[test]
#[ignore = "takes minutes; run it in a release build"]
fn a_soft_belly_is_followed() {
    let Some(folder) = folder() else { return };
    let recording = Capture::read(&folder).recording(TUNED, 4, FRONT);
    let belly = Belly::new(&recording);
    let [tracked, skinned] = belly.distances(&recording, TrackerOptions::with_unknown_bones());
    let [stiff, _] = belly.distances(&recording, TrackerOptions::with_unknown_bones().stiffened());
    println!(
        "a soft belly: {:.2} mm from the surface (95 % {:.1}), with stiff nodes {:.2} mm, true bones alone {:.1} mm",
        tracked.mean, tracked.p95, stiff.mean, skinned.mean
    );
    assert!(tracked.mean <= 4.0 && skinned.mean > 10.0, "{tracked:?}, {skinned:?}");
    assert!(stiff.mean > 4.0, "the limit tells soft nodes from stiff ones: {stiff:?}");
}
