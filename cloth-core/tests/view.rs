//! `cloth view` from outside: pictures without a display, and errors.

use std::path::Path;
use std::process::{Command, Output};

use tempfile::TempDir;

const SCENE: &str = r#"dt = 0.01
duration = 0.2
frames_per_second = 50

[mesh.sheet]
cells = [6, 6]
size = [1.0, 1.0]

[fabric]
density = 0.15

[fabric.material.stvk]
stretch_stiffness = 50.0
poisson_ratio = 0.3

[[pins]]
nearest = [-0.5, 0.5, 0.0]

[[obstacles]]
sphere = { radius = 0.2, centre = [0.0, 0.0, -0.3] }
"#;

/// Runs the binary without a display.
fn cloth(arguments: &[&str], folder: &Path) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_cloth"));
    command.args(arguments).current_dir(folder).env_remove("DISPLAY").env_remove("WAYLAND_DISPLAY");
    command.output().unwrap()
}

fn succeeds(arguments: &[&str], folder: &Path) -> String {
    let output = cloth(arguments, folder);
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

fn refused(arguments: &[&str], folder: &Path) -> String {
    let output = cloth(arguments, folder);
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert!(!message.contains("panicked"), "{message}");
    message
}

fn with_scene() -> TempDir {
    let folder = TempDir::new().unwrap();
    std::fs::write(folder.path().join("scene.toml"), SCENE).unwrap();
    folder
}

#[test]
fn a_screenshot_of_a_scene_equals_that_of_its_run() {
    let folder = with_scene();
    let path = folder.path();
    succeeds(&["run", "scene.toml", "-o", "out"], path);
    let text = succeeds(&["view", "scene.toml", "--screenshot", "end.png"], path);
    assert!(text.starts_with("wrote end.png: t = 0.2000 s, plain"), "{text}");
    let read = |name: &str| std::fs::read(path.join(name)).unwrap();
    assert!(read("end.png").starts_with(b"\x89PNG"));
    assert!(read("end.png") == read("out/cloth.png"), "as the run drew it");

    // The same moments, from the scene and from its run: frame files have fewer digits, so pictures may differ
    // slightly.
    let told =
        succeeds(&["view", "scene.toml", "--screenshot", "scene.png", "--frame", "4", "--colours", "strain"], path);
    assert!(told.starts_with("wrote scene.png: t = 0.0800 s, strain from 0 to "), "{told}");
    let of_run = succeeds(&["view", "out", "--screenshot", "run.png", "--time", "0.085", "--colours", "strain"], path);
    assert_eq!(told.split("wrote scene.png").last(), of_run.split("wrote run.png").last());
    succeeds(&["view", "out", "--screenshot", "plain.png", "--frame", "4"], path);
    succeeds(&["view", "out", "--screenshot", "edges.png", "--frame", "4", "--wireframe"], path);
    let pictures = ["run.png", "plain.png", "edges.png", "end.png"].map(read);
    assert!((0..4).all(|a| (0..a).all(|b| pictures[a] != pictures[b])), "each is another picture");
    for (colours, unit) in [("energy", "J/kg"), ("speed", "m/s")] {
        let told = succeeds(&["view", "out", "--screenshot", "other.png", "--colours", colours], path);
        assert!(told.trim_end().ends_with(unit), "{told}");
    }
    assert!(std::fs::read_dir(path).unwrap().all(|e| e.unwrap().path().extension().is_none_or(|end| end != "part")));
}

#[test]
fn invalid_requests_are_clear_errors() {
    let folder = with_scene();
    let path = folder.path();
    assert!(refused(&["view", "scene.toml"], path).contains("cloth-core/window/Cargo.toml -- scene.toml"));
    let shot = |shown: &str, more: &[&str]| refused(&[&["view", shown, "--screenshot", "x.png"], more].concat(), path);
    assert!(shot("nothing.toml", &[]).contains("cannot read the scene nothing.toml"));
    std::fs::create_dir(path.join("empty")).unwrap();
    assert!(shot("empty", &[]).contains("is this the folder of a finished run?"));
    succeeds(&["run", "scene.toml", "-o", "out"], path);
    assert!(shot("out", &["--frame", "99"]).contains("frames 0 to 10, up to 0.2000 s; frame 99 is not among them"));
    assert!(shot("out", &["--time", "3"]).contains("3 s is not among them"));
    std::fs::create_dir(path.join("x.png")).unwrap();
    assert!(shot("out", &[]).contains("cannot write x.png"));
    let record = std::fs::read_to_string(path.join("out/run.json")).unwrap();
    std::fs::write(path.join("out/run.json"), record.replace("\"version\": 1,", "\"version\": 7,")).unwrap();
    assert!(shot("out", &[]).contains("has version 7, but this program reads version 1"));
    std::fs::write(path.join("out/run.json"), &record[..record.len() / 2]).unwrap();
    assert!(shot("out", &[]).contains("run.json is damaged"));
    let both = cloth(&["view", "out", "--screenshot", "y.png", "--frame", "1", "--time", "0.1"], path);
    assert_eq!(both.status.code(), Some(2));
    assert_eq!(cloth(&["view", "out", "--frame", "1"], path).status.code(), Some(2), "only with --screenshot");
}

#[test]
fn only_png_pictures_are_promised() {
    let folder = TempDir::new().unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_cloth"))
        .args(["view", "scene.toml", "--screenshot", "x.jpg"])
        .current_dir(folder.path())
        .output()
        .unwrap();
    let message = String::from_utf8(output.stderr).unwrap();
    assert!(!output.status.success() && message.contains("expected a name that ends with .png"), "{message}");
}
