//! Options and files that cannot be used are refused before anything is tracked, with the reason.

use std::path::{Path, PathBuf};
use std::process::Command;

use tempfile::TempDir;

fn fusion(arguments: &[&str]) -> (Option<i32>, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_fusion")).args(arguments).output().unwrap();
    (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
}

/// A recording of the figure with two frames, in a folder that is removed at the end.
fn recording() -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let recording = folder.path().join("recording");
    let (code, error) = fusion(&["render", "--to", "1", "-o", recording.to_str().unwrap()]);
    assert_eq!(code, Some(0), "{error}");
    (folder, recording)
}

/// Tracks a recording and asserts that it fails, with messages that contain all `parts`. Returns the messages.
fn refused(recording: &Path, more: &[&str], parts: &[&str]) -> String {
    let track = recording.with_file_name("track");
    let arguments = [&["track", recording.to_str().unwrap(), "-o", track.to_str().unwrap()], more].concat();
    let (code, error) = fusion(&arguments);
    assert_eq!(code, Some(1), "{error}");
    assert!(parts.iter().all(|part| error.contains(part)), "{parts:?} not in: {error}");
    assert!(!track.exists(), "refused before anything is written");
    error
}

/// Tracks with options as JSON and asserts that they are refused.
fn option_refused(options: &str, parts: &[&str]) {
    let (_folder, recording) = recording();
    let file = recording.join("options.json");
    std::fs::write(&file, options).unwrap();
    // Messages name the file that is at fault, and no other.
    let parts = [parts, &["options.json"]].concat();
    let error = refused(&recording, &["--options", file.to_str().unwrap()], &parts);
    assert!(!error.contains("intrinsics.json"), "{error}");
}

#[test]
fn negative_damping() {
    option_refused(r#"{"tracker": {"damping": -1}}"#, &["`tracker.damping`", "at least 0, got -1"]);
}

#[test]
fn zero_iterations() {
    option_refused(r#"{"tracker": {"iterations": 0}}"#, &["`tracker.iterations`", "from 1 to 1000, got 0"]);
}

#[test]
fn endless_iterations() {
    option_refused(r#"{"tracker": {"iterations": 1000000000}}"#, &["`tracker.iterations`", "got 1000000000"]);
}

#[test]
fn negative_gate() {
    let options = r#"{"tracker": {"gates": {"distance": -1}}}"#;
    option_refused(options, &["`tracker.gates.distance`", "greater than 0, got -1"]);
}

#[test]
fn obtuse_gate() {
    option_refused(r#"{"tracker": {"gates": {"angle": 45}}}"#, &["`tracker.gates.angle`", "rad", "got 45"]);
}

#[test]
fn window_without_pixels() {
    option_refused(r#"{"tracker": {"gates": {"normal_reach": 0}}}"#, &["`tracker.gates.normal_reach`", "got 0"]);
}

#[test]
fn zero_first_distance() {
    option_refused(r#"{"tracker": {"first_distance": 0}}"#, &["`tracker.first_distance`", "got 0"]);
}

#[test]
fn no_matches_needed() {
    option_refused(r#"{"tracker": {"least_matches": 0}}"#, &["`tracker.least_matches`", "got 0"]);
}

#[test]
fn zero_weights() {
    for name in ["nonrigid", "graph", "binding"] {
        let options = format!(r#"{{"tracker": {{"energy": {{"weights": {{"{name}": 0}}}}}}}}"#);
        option_refused(&options, &[&format!("`tracker.energy.weights.{name}`"), "greater than 0, got 0"]);
    }
}

#[test]
fn negative_weights() {
    for name in ["skeleton", "prior", "motion", "joints"] {
        let options = format!(r#"{{"tracker": {{"energy": {{"weights": {{"{name}": -2}}}}}}}}"#);
        option_refused(&options, &[&format!("`tracker.energy.weights.{name}`"), "at least 0, got -2"]);
    }
}

#[test]
fn unknown_bones_without_prior() {
    let options = r#"{"tracker": {"energy": {"bones": "unknown", "weights": {"prior": 0}}}}"#;
    option_refused(options, &["`tracker.energy.weights.prior`", "greater than 0, got 0"]);
}

#[test]
fn zero_limits_of_robust_losses() {
    for name in ["data_tukey", "graph_huber"] {
        let options = format!(r#"{{"tracker": {{"energy": {{"{name}": 0}}}}}}"#);
        option_refused(&options, &[&format!("`tracker.energy.{name}`"), "greater than 0, got 0"]);
    }
}

#[test]
fn nodes_without_ties_along_normals() {
    let options = r#"{"tracker": {"energy": {"normal_slack": 1}}}"#;
    option_refused(options, &["`tracker.energy.normal_slack`", "less than 1, got 1"]);
}

#[test]
fn surfaces_without_voxels() {
    option_refused(r#"{"surface": {"voxel": 0}}"#, &["`surface.voxel`", "greater than 0, got 0"]);
    option_refused(r#"{"surface": {"truncation": -1}}"#, &["`surface.truncation`", "got -1"]);
    option_refused(r#"{"surface": {"reach": 0.001}}"#, &["`surface.reach`", "got 0.001"]);
}

#[test]
fn endless_relaxations() {
    option_refused(r#"{"model": {"relaxations": 1000000000}}"#, &["`model.relaxations`", "at most 100"]);
}

#[test]
fn lengths_that_are_not_positive() {
    option_refused(r#"{"model": {"node_radius": 0}}"#, &["`model.node_radius`", "got 0"]);
    option_refused(r#"{"model": {"attachment_reach": -0.1}}"#, &["`model.attachment_reach`", "got -0.1"]);
    option_refused(r#"{"model": {"attachment_length": -1}}"#, &["`model.attachment_length`", "got -1"]);
}

#[test]
fn tolerance_of_one() {
    option_refused(r#"{"tracker": {"solver_tolerance": 1}}"#, &["`tracker.solver_tolerance`", "got 1"]);
}

#[test]
fn prior_without_reach() {
    option_refused(r#"{"tracker": {"energy": {"prior_reach": 0}}}"#, &["`tracker.energy.prior_reach`", "got 0"]);
}

#[test]
fn three_nodes_per_vertex() {
    option_refused(r#"{"model": {"nodes_per_vertex": 3}}"#, &["1, 4 or 8 nodes per vertex, got 3"]);
}

#[test]
fn unknown_word() {
    option_refused(r#"{"model": {"distance": "straight"}}"#, &["unknown variant `straight`", "`surface`"]);
}

#[test]
fn no_graph() {
    option_refused(r#"{"model": {"graph_neighbours": 0}}"#, &["`model.graph_neighbours`", "got 0"]);
}

#[test]
fn unknown_option() {
    option_refused(r#"{"tracker": {"iteration": 4}}"#, &["unknown field `iteration`", "`iterations`", "line 1"]);
}

#[test]
fn unknown_key_of_the_camera() {
    let (_folder, recording) = recording();
    let path = recording.join("intrinsics.json");
    let text = std::fs::read_to_string(&path).unwrap().replace("\"fx\"", "\"fxx\"");
    std::fs::write(&path, text).unwrap();
    refused(&recording, &[], &["intrinsics.json", "unknown field `fxx`"]);
}

#[test]
fn negative_focal_length() {
    let (_folder, recording) = recording();
    let path = recording.join("intrinsics.json");
    let text = std::fs::read_to_string(&path).unwrap().replace("525.0", "-525.0");
    std::fs::write(&path, text).unwrap();
    refused(&recording, &[], &["intrinsics.json", "focal lengths greater than 0"]);
}

#[test]
fn unknown_key_of_the_skeleton() {
    let (_folder, recording) = recording();
    let path = recording.join("skeleton.json");
    let text = std::fs::read_to_string(&path).unwrap().replace("\"frames\"", "\"poses\"");
    std::fs::write(&path, text).unwrap();
    refused(&recording, &[], &["skeleton.json", "unknown field `poses`"]);
}

#[test]
fn short_skeleton() {
    let (_folder, recording) = recording();
    let path = recording.join("skeleton.json");
    let mut skeleton = fusion_core::skeleton::Skeleton::read(&path).unwrap();
    skeleton.frames.pop();
    skeleton.write(&path).unwrap();
    refused(&recording, &[], &["skeleton.json", "each of 2 images, got 1"]);
}

#[test]
fn missing_skeleton() {
    let (_folder, recording) = recording();
    std::fs::remove_file(recording.join("skeleton.json")).unwrap();
    refused(&recording, &["--unknown-bones"], &["--unknown-bones needs", "skeleton.json", "--skeleton"]);
    let named = recording.join("other.json");
    refused(&recording, &["--skeleton", named.to_str().unwrap()], &["other.json"]);
    // Without a request for bones, the body is tracked with a warning.
    let track = recording.with_file_name("free");
    let (code, error) = fusion(&["track", recording.to_str().unwrap(), "-o", track.to_str().unwrap()]);
    assert_eq!(code, Some(0), "{error}");
    assert!(error.contains("tracking without bones"), "{error}");
}

#[test]
fn missing_image() {
    let (_folder, recording) = recording();
    std::fs::remove_file(recording.join("depth/000001.png")).unwrap();
    let track = recording.with_file_name("track");
    let (code, error) = fusion(&["track", recording.to_str().unwrap(), "-o", track.to_str().unwrap()]);
    assert_eq!(code, Some(0), "{error}");
    assert!(error.contains("track lost in frame 1") && error.contains("000001.png"), "{error}");
    let table = std::fs::read_to_string(track.join("frames.csv")).unwrap();
    assert!(table.lines().nth(2).unwrap().starts_with("1,skipped"), "{table}");
}

#[test]
fn malformed_list_of_images() {
    let (_folder, recording) = recording();
    std::fs::write(recording.join("depth.txt"), "# timestamp filename\ndepth/000000.png\n").unwrap();
    refused(&recording, &[], &["depth.txt:2", "expected a timestamp", "depth/000000.png"]);
}

#[test]
fn images_out_of_order() {
    let (_folder, recording) = recording();
    std::fs::write(recording.join("depth.txt"), "0.1 depth/000000.png\n0.1 depth/000001.png\n").unwrap();
    refused(&recording, &[], &["depth.txt:2", "expected a timestamp after 0.1 s, got 0.1 s"]);
}

/// Writes `intrinsics.json` with a distortion, and asserts that it is refused.
fn distortion_refused(distortion: &str, parts: &[&str]) {
    let (_folder, recording) = recording();
    let path = recording.join("intrinsics.json");
    let text = std::fs::read_to_string(&path).unwrap();
    let end = text.rfind('}').unwrap();
    std::fs::write(&path, format!("{}, \"distortion\": {distortion}}}", &text[..end])).unwrap();
    refused(&recording, &[], parts);
}

#[test]
fn lens_that_folds_the_image() {
    distortion_refused(r#"{"k1": -1}"#, &["intrinsics.json", "cannot be inverted at pixel (0, 0)"]);
}

#[test]
fn unknown_coefficient() {
    distortion_refused(r#"{"k7": 0.1}"#, &["intrinsics.json", "unknown field `k7`", "`k6`"]);
}

#[test]
fn no_camera_or_two() {
    let (_folder, recording) = recording();
    refused(&recording, &["--camera", "freiburg1"], &["intrinsics.json exists, and a camera is given"]);
    std::fs::remove_file(recording.join("intrinsics.json")).unwrap();
    refused(&recording, &[], &["intrinsics.json does not exist", "fx,fy,cx,cy", "freiburg1"]);
    refused(&recording, &["--camera", "0,525,319.5,239.5"], &["focal lengths greater than 0"]);
    let scale = ["--camera", "525,525,319.5,239.5", "--depth-scale", "0"];
    refused(&recording, &scale, &["`depth_scale` greater than 0"]);
    let (code, error) = fusion(&["track", recording.to_str().unwrap(), "-o", "x", "--camera", "kinect"]);
    assert!(code == Some(2) && error.contains("expected `fx,fy,cx,cy`"), "{error}");
}

/// Writes timestamps into the skeleton, and asserts that they are refused.
fn timestamps_refused(timestamps: &[f64], parts: &[&str]) {
    let (_folder, recording) = recording();
    let path = recording.join("skeleton.json");
    let mut skeleton = fusion_core::skeleton::Skeleton::read(&path).unwrap();
    skeleton.timestamps = Some(timestamps.to_vec());
    skeleton.write(&path).unwrap();
    refused(&recording, &[], parts);
}

#[test]
fn timestamps_that_fit_no_image() {
    timestamps_refused(&[0.0], &["skeleton.json", "expected 2 timestamps", "got 1"]);
    timestamps_refused(&[7.0, 7.1], &["skeleton.json", "no timestamp is within half a frame", "from 7 s to 7.1 s"]);
}

#[test]
fn timestamps_without_a_list_of_images() {
    let (_folder, recording) = recording();
    std::fs::remove_file(recording.join("depth.txt")).unwrap();
    let path = recording.join("skeleton.json");
    let mut skeleton = fusion_core::skeleton::Skeleton::read(&path).unwrap();
    skeleton.timestamps = Some(vec![0.0, 0.1]);
    skeleton.write(&path).unwrap();
    refused(&recording, &[], &["skeleton.json", "add depth.txt"]);
}
