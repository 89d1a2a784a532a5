//! End-to-end tests of the binary `fusion`.

use std::path::Path;
use std::process::{Command, Output};

fn fusion(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_fusion")).args(arguments).output().unwrap()
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

fn error_of(output: &Output) -> String {
    assert!(!output.status.success());
    String::from_utf8_lossy(&output.stderr).into_owned()
}

#[test]
fn a_recording_is_rendered_tracked_and_evaluated() {
    let folder = tempfile::tempdir().unwrap();
    let (recording, track) = (folder.path().join("recording"), folder.path().join("track"));
    let (recording, track) = (text(&recording), text(&track));
    assert!(fusion(&["render", "--to", "4", "-o", recording]).status.success());
    let again = error_of(&fusion(&["render", "--to", "4", "-o", recording]));
    assert!(again.contains("--overwrite"), "{again}");

    // A damaged and a missing image are skipped with a reason; the others are tracked.
    std::fs::write(Path::new(recording).join("depth/000002.png"), b"no image").unwrap();
    std::fs::remove_file(Path::new(recording).join("depth/000003.png")).unwrap();
    let output = fusion(&["track", recording, "--stats", "--pictures", "--usd", "--gltf", "--surface", "-o", track]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let printed = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(printed.contains("time per frame: mean") && printed.contains("Hz"), "{printed}");
    let table = std::fs::read_to_string(Path::new(track).join("frames.csv")).unwrap();
    let status: Vec<&str> = table.lines().skip(1).map(|line| line.split(',').nth(1).unwrap()).collect();
    assert_eq!(status, ["tracked", "tracked", "skipped", "skipped", "tracked"], "{table}");
    assert!(table.contains("000002.png"), "{table}");
    let warnings = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(
        warnings.contains("track lost in frame 2") && warnings.contains("track recovered in frame 4"),
        "{warnings}"
    );
    assert!(!warnings.contains("frame 3"), "lost frames in a row have one warning: {warnings}");

    let output = fusion(&["evaluate", recording, track]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let printed = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(printed.contains("median, mm") && printed.contains("skeleton alone"), "{printed}");
    let plot = std::fs::read_to_string(Path::new(track).join("errors.svg")).unwrap();
    assert!(plot.starts_with("<svg") && plot.contains("median"));
    pictures_and_points_are_complete(Path::new(track));
    assert!(Path::new(track).join("surface/rest.obj").exists());
    let surface = std::fs::read_to_string(Path::new(track).join("surface/000004.obj")).unwrap();
    assert!(surface.lines().filter(|line| line.starts_with("v ")).count() > 10_000);
}

/// Checks the outputs on request of a track of five frames.
fn pictures_and_points_are_complete(track: &Path) {
    for frame in 0..5 {
        let picture = std::fs::File::open(track.join(format!("pictures/{frame:06}.png"))).unwrap();
        let reader = png::Decoder::new(std::io::BufReader::new(picture)).read_info().unwrap();
        assert_eq!((reader.info().width, reader.info().height), (3 * 640, 480), "frame {frame}");
    }
    let film = std::fs::read(track.join("track.apng")).unwrap();
    let reader = png::Decoder::new(std::io::Cursor::new(&film)).read_info().unwrap();
    assert_eq!(reader.info().animation_control.unwrap().num_frames, 5);
    let usd = std::fs::read_to_string(track.join("track.usda")).unwrap();
    let samples: Vec<&str> = usd.lines().filter(|line| line.ends_with(")],")).collect();
    assert!(samples.len() == 5 && samples[4].trim_start().starts_with("4: [("), "{}", samples.len());
    assert!(samples.iter().all(|points| points.matches('(').count() == 3638));
    animation_is_complete(track);
    assert!(!track.join("track.glb.part").exists() && !track.join("track.usda.part").exists());
    let page = std::fs::read_to_string(track.join("errors.html")).unwrap();
    assert_eq!(page.matches("src=\"data:image/png;base64,").count(), 3, "two frames and the film");
    assert!(page.contains("<svg") && page.contains("skeleton alone"));
    let links = page.matches("http").count() - page.matches("http://www.w3.org/2000/svg").count();
    assert_eq!(links, 0, "the page needs no other file");
}

/// Checks the binary glTF of a track of five frames at 30 Hz: its times, vertices and moves.
fn animation_is_complete(track: &Path) {
    let mut file = gltf::Gltf::open(track.join("track.glb")).unwrap();
    let data = file.blob.take().unwrap();
    let primitive = file.meshes().next().unwrap().primitives().next().unwrap();
    let reader = primitive.reader(|_| Some(&data));
    let first: Vec<[f32; 3]> = reader.read_positions().unwrap().collect();
    assert_eq!(first.len(), 3638);
    assert_eq!(reader.read_normals().unwrap().len(), 3638);
    let moves: Vec<Vec<[f32; 3]>> = reader.read_morph_targets().map(|target| target.0.unwrap().collect()).collect();
    assert_eq!(moves.iter().map(Vec::len).collect::<Vec<_>>(), [3638; 4]);
    let animation = file.animations().next().unwrap();
    let channel = animation.channels().next().unwrap();
    let times: Vec<f32> = channel.reader(|_| Some(&data)).read_inputs().unwrap().collect();
    assert_eq!(times.len(), 5);
    assert!((0..5).all(|frame| (times[frame] - frame as f32 / 30.0).abs() < 1e-4), "{times:?}");
    // The last frame is the last mesh, with y up.
    let mesh = std::fs::read_to_string(track.join("meshes/000004.obj")).unwrap();
    let vertices = mesh.lines().filter_map(|line| line.strip_prefix("v "));
    for (at, line) in vertices.enumerate() {
        let [x, y, z] = [0, 1, 2].map(|axis| line.split(' ').nth(axis).unwrap().parse::<f32>().unwrap());
        let found: [f32; 3] = std::array::from_fn(|axis| first[at][axis] + moves[3][at][axis]);
        let errors = [found[0] - x, found[1] + y, found[2] + z];
        assert!(errors.iter().all(|error| error.abs() < 2e-6), "vertex {at}: {found:?}, {line}");
    }
}

#[test]
fn the_demonstration_explains_its_rows_and_leaves_little() {
    let folder = tempfile::tempdir().unwrap();
    let output = fusion(&["demo", "--frames", "2", "-o", text(folder.path())]);
    let printed = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success() && printed.contains("exact bones, skeleton alone"), "{printed}");
    assert!(printed.contains("The truth is the model skinned by the true bones."), "{printed}");
    for run in ["exact-bones", "noisy-bones"] {
        let run = folder.path().join(run);
        assert!(run.join("track/errors.html").exists() && run.join("track/frames.csv").exists());
        assert!(!run.join("track/meshes").exists() && !run.join("recording/truth").exists());
    }
}

#[test]
fn a_recording_may_begin_with_a_t_pose() {
    let folder = tempfile::tempdir().unwrap();
    let here = text(folder.path());
    let output = fusion(&["render", "--from", "30", "--to", "31", "--t-pose", "-o", here]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(String::from_utf8_lossy(&output.stdout).contains("wrote 3 frames"));
    // Outstretched arms span 1.4 m; in the next frame they are lower.
    let span = |frame: usize| {
        let mesh = std::fs::read_to_string(folder.path().join(format!("truth/{frame:06}.obj"))).unwrap();
        let across = mesh.lines().filter_map(|line| line.strip_prefix("v ")?.split(' ').next()?.parse::<f64>().ok());
        let (least, most) = across.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)));
        most - least
    };
    assert!(span(0) > 1.4 && span(1) < span(0) - 0.05, "{} m, {} m", span(0), span(1));
}

#[test]
fn a_body_is_posed_with_the_same_faces_in_every_frame() {
    let folder = tempfile::tempdir().unwrap();
    let here = text(folder.path());
    let output = fusion(&["pose", "--to", "30", "--step", "10", "-o", here]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(String::from_utf8_lossy(&output.stdout).contains("wrote 4 meshes of 3638 vertices"));
    let read = |frame: usize| std::fs::read_to_string(folder.path().join(format!("body/{frame:06}.obj"))).unwrap();
    let lines = |text: &str, kind: &str| text.lines().filter(|line| line.starts_with(kind)).count();
    let faces = |text: &str| text.lines().filter(|line| line.starts_with("f ")).map(str::to_owned).collect::<Vec<_>>();
    let (first, last) = (read(0), read(3));
    assert!(lines(&first, "v ") == 3638 && faces(&first) == faces(&last) && first != last);
    // z is up: the figure is 1.74 m tall.
    let heights = first.lines().filter_map(|line| line.strip_prefix("v ")?.split(' ').nth(2)?.parse::<f64>().ok());
    let highest = heights.fold(0.0, f64::max);
    assert!((highest - 1.74).abs() < 0.01, "{highest}");
    let again = error_of(&fusion(&["pose", "--to", "30", "-o", here]));
    assert!(again.contains("--overwrite"), "{again}");
}

#[test]
fn unusable_input_is_rejected_with_a_reason() {
    let folder = tempfile::tempdir().unwrap();
    let here = text(folder.path());
    let missing = error_of(&fusion(&["track", here, "-o", &format!("{here}/t")]));
    assert!(missing.contains("intrinsics.json"), "{missing}");
    let recording = folder.path().join("recording");
    let recording = text(&recording);
    assert!(fusion(&["render", "--to", "1", "-o", recording]).status.success());
    let skeleton = Path::new(recording).join("skeleton.json");
    let renamed = std::fs::read_to_string(&skeleton).unwrap().replace("\"Head\"", "\"Tail\"");
    std::fs::write(&skeleton, renamed).unwrap();
    let track = format!("{here}/track");
    let bone = error_of(&fusion(&["track", recording, "-o", &track]));
    assert!(bone.contains("no bone `Head`"), "{bone}");
    assert!(!Path::new(&track).exists(), "refused before anything is written");
    assert!(fusion(&["track", recording, "--no-bones", "-o", &track]).status.success());
    let options = Path::new(here).join("options.json");
    std::fs::write(&options, r#"{"model": {"nodes_per_vertex": 8, "node_radius": 2.0}}"#).unwrap();
    let few = error_of(&fusion(&[
        "track",
        recording,
        "--no-bones",
        "--options",
        text(&options),
        "-o",
        &track,
        "--overwrite",
    ]));
    assert!(few.contains("nodes, but 8 are needed"), "{few}");
    let body = error_of(&fusion(&["render", "--body", here, "-o", recording, "--overwrite"]));
    assert!(body.contains("no file base"), "{body}");
}

#[test]
fn a_track_without_any_usable_image_fails() {
    let folder = tempfile::tempdir().unwrap();
    let (recording, track) = (folder.path().join("recording"), folder.path().join("track"));
    assert!(fusion(&["render", "--to", "2", "-o", text(&recording)]).status.success());
    for frame in 0..3 {
        std::fs::write(recording.join(format!("depth/{frame:06}.png")), b"no image").unwrap();
    }
    let output = fusion(&["track", text(&recording), "-o", text(&track)]);
    assert_eq!(output.status.code(), Some(1));
    let error = error_of(&output);
    assert!(error.contains("none of 3 frames could be tracked") && error.contains("000000.png"), "{error}");
    let table = std::fs::read_to_string(track.join("frames.csv")).unwrap();
    assert_eq!(table.lines().filter(|line| line.contains("skipped")).count(), 3, "{table}");
}

#[test]
fn a_mesh_without_bones_is_tracked() {
    let folder = tempfile::tempdir().unwrap();
    let (recording, track) = (folder.path().join("recording"), folder.path().join("track"));
    assert!(fusion(&["render", "--to", "3", "-o", text(&recording)]).status.success());
    // The true mesh of the first frame is the model.
    let model = recording.join("truth/000000.obj");
    let output = fusion(&["track", text(&recording), "--model", text(&model), "-o", text(&track)]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let output = fusion(&["evaluate", text(&recording), text(&track)]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let table = std::fs::read_to_string(track.join("errors.csv")).unwrap();
    let medians: Vec<f64> =
        table.lines().skip(1).map(|line| line.split(',').nth(3).unwrap().parse().unwrap()).collect();
    assert!(medians.len() == 6 && medians.iter().all(|&median| median < 8.0), "{table}");
}
