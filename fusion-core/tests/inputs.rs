//! Recordings as cameras and body trackers write them: timestamps, the TUM's layout, distorted lenses.

use std::fmt::Write as _;
use std::path::Path;
use std::process::Command;

use fusion_core::body::{figure, figure_motion};
use fusion_core::depth::{Camera, DepthImage, GivenCamera, SensorNoise, read_depth, write_depth};
use fusion_core::evaluation::{ErrorSummary, FrameErrors};
use fusion_core::model::{DeformationModel, ModelOptions};
use fusion_core::protocol::Recording;
use fusion_core::skeleton::Skeleton;
use fusion_core::tracker::{Tracker, TrackerOptions};
use tempfile::TempDir;

/// Runs `fusion` and returns its messages; it must succeed.
fn fusion(arguments: &[&str]) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_fusion")).args(arguments).output().unwrap();
    let messages = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{arguments:?}: {messages}");
    messages
}

/// Renders the figure; the folder is removed at the end.
fn rendered(last: usize) -> (TempDir, String, String) {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (recording, track) = (path("recording"), path("track"));
    fusion(&["render", "--to", &last.to_string(), "-o", &recording]);
    (folder, recording, track)
}

/// Returns a column of the table of frames.
fn column(track: &str, name: &str) -> Vec<String> {
    let mut table = csv::Reader::from_path(Path::new(track).join("frames.csv")).unwrap();
    let at = table.headers().unwrap().iter().position(|heading| heading == name).unwrap();
    table.records().map(|row| row.unwrap()[at].to_owned()).collect()
}

#[test]
fn bones_are_matched_to_images_by_time() {
    let (_folder, recording, track) = rendered(4);
    let times = [100.0, 100.033, 100.071, 100.1, 100.2];
    let mut list = String::from("# irregular\n");
    for (frame, time) in times.iter().enumerate() {
        writeln!(list, "{time} depth/{frame:06}.png").unwrap();
    }
    std::fs::write(Path::new(&recording).join("depth.txt"), list).unwrap();
    let path = Path::new(&recording).join("skeleton.json");
    let mut skeleton = Skeleton::read(&path).unwrap();
    // The body tracker began earlier, runs 5 ms late, and lost the body in the third image.
    let lost = skeleton.frames.remove(2);
    skeleton.frames.insert(0, lost);
    skeleton.timestamps = Some(vec![99.9, 100.005, 100.038, 100.105, 100.205]);
    skeleton.write(&path).unwrap();

    let expected = skeleton.clone();
    let matched = skeleton.for_images(&path, 5, Some(&times)).unwrap();
    assert!(matched.frames[2].is_empty());
    for (image, entry) in [(0, 1), (1, 2), (3, 3), (4, 4)] {
        assert_eq!(matched.frames[image], expected.frames[entry], "image {image}");
    }
    let messages = fusion(&["track", &recording, "-o", &track]);
    assert!(messages.contains("no bones for frames 2 (timestamps match within 19.0 ms)"), "{messages}");
    assert_eq!(column(&track, "status"), ["tracked"; 5]);
    let skeleton: Vec<bool> = column(&track, "skeleton").iter().map(|energy| energy != "0.0").collect();
    assert_eq!(skeleton, [true, true, false, true, true], "the energy of reported bones");
    fusion(&["evaluate", &recording, &track]);
}

#[test]
fn a_sequence_of_the_tum_needs_a_camera_only() {
    let (_folder, recording, track) = rendered(2);
    let folder = Path::new(&recording);
    std::fs::remove_file(folder.join("intrinsics.json")).unwrap();
    let mut list = String::from("# depth maps\n# file: 'figure.bag'\n# timestamp filename\n");
    for frame in 0..3 {
        let time = format!("{:.6}", 1_305_031_102.160_407 + f64::from(frame) / 30.0);
        let old = folder.join(format!("depth/{frame:06}.png"));
        let image = read_depth(&old, 1000.0, None).unwrap();
        write_depth(&folder.join(format!("depth/{time}.png")), &image, GivenCamera::TUM_SCALE).unwrap();
        std::fs::remove_file(old).unwrap();
        writeln!(list, "{time} depth/{time}.png").unwrap();
    }
    std::fs::write(folder.join("depth.txt"), list).unwrap();
    fusion(&["track", &recording, "--camera", "525,525,319.5,239.5", "-o", &track]);
    let residuals = column(&track, "residual_mm");
    assert!(residuals.len() == 3 && residuals.iter().all(|mm| mm.parse::<f64>().unwrap() < 3.0), "{residuals:?}");
}

#[test]
fn a_distorted_lens_is_tracked_through() {
    let given: GivenCamera = "freiburg1".parse().unwrap();
    let camera = given.with_size(640, 480).camera;
    let motions: Vec<_> = (0..3).map(|frame| figure_motion(f64::from(frame) / 30.0)).collect();
    // Near enough to reach the border of the image, where the lens bends most.
    let recording = Recording::new(&figure(), &motions, camera, 1.9);
    let median = |camera: Camera| {
        let model = DeformationModel::new(&recording.body, ModelOptions::default()).unwrap();
        let mut tracker = Tracker::new(model, camera, TrackerOptions::without_bones()).unwrap();
        let images: Vec<DepthImage> = (1..3).map(|frame| recording.image(frame, SensorNoise::default())).collect();
        images.iter().for_each(|image| drop(tracker.track(image, None).unwrap()));
        let truth = recording.truth(2).vertices;
        ErrorSummary::of(FrameErrors::new(&tracker.vertices(), &truth, &vec![true; truth.len()]).all).median
    };
    let (lens, pinhole) = (median(camera), median(Camera { distortion: None, ..camera }));
    assert!(lens < 4.0 && pinhole > 2.0 * lens, "median {lens} mm, without the lens {pinhole} mm");
}

#[test]
fn a_wrong_focal_length_is_reported() {
    let (_folder, recording, track) = rendered(1);
    let messages = fusion(&["track", &recording, "-o", &track]);
    assert!(!messages.contains("focal"), "{messages}");
    let path = Path::new(&recording).join("intrinsics.json");
    let text = std::fs::read_to_string(&path).unwrap().replace("525.0", "577.5");
    std::fs::write(&path, text).unwrap();
    let messages = fusion(&["track", &recording, "--overwrite", "-o", &track]);
    let suggestion = messages.split("with fx = ").nth(1).and_then(|rest| rest.split(' ').next());
    let suggested: f64 = suggestion.unwrap_or_else(|| panic!("{messages}")).parse().unwrap();
    assert!((suggested - 525.0).abs() < 10.0 && messages.contains("in place of 578"), "{messages}");
}

/// Multiplies the positions in a stored model by a factor, about a point on the camera's axis.
fn scale_model(path: &Path, factor: f64) {
    let mut model: serde_json::Value = serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap();
    let scale = |point: &mut serde_json::Value| {
        for (axis, centre) in [0.0, 0.0, 2.6].into_iter().enumerate() {
            let x = point[axis].as_f64().unwrap();
            point[axis] = (centre + factor * (x - centre)).into();
        }
    };
    model["vertices"].as_array_mut().unwrap().iter_mut().for_each(scale);
    for bone in model["bones"].as_array_mut().unwrap() {
        ["head", "tail"].iter().for_each(|end| scale(&mut bone[end]));
    }
    std::fs::write(path, serde_json::to_vec(&model).unwrap()).unwrap();
}

#[test]
fn a_model_of_the_wrong_size_is_scaled() {
    let (_folder, recording, track) = rendered(1);
    let messages = fusion(&["track", &recording, "-o", &track]);
    assert!(!messages.contains("size"), "{messages}");
    scale_model(&Path::new(&recording).join("model.json"), 1.06);
    let messages = fusion(&["track", &recording, "--overwrite", "-o", &track]);
    assert!(messages.contains("size seems wrong") && messages.contains("--keep-size keeps it"), "{messages}");
    assert!(!messages.contains("focal"), "{messages}");
    let residual = |track: &str| column(track, "residual_mm")[1].parse::<f64>().unwrap();
    let scaled = residual(&track);
    let messages = fusion(&["track", &recording, "--keep-size", "--overwrite", "-o", &track]);
    assert!(messages.contains("omit --keep-size"), "{messages}");
    assert!(scaled < 0.7 * residual(&track), "{scaled} mm, {} mm with the wrong size", residual(&track));
}
