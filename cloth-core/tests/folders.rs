//! Output folders: locks, and the checks and repairs of a resumed run.

use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use tempfile::TempDir;

const SCENE: &str = r#"dt = 0.01
duration = 0.1
frames_per_second = 50
integrator = "newton"
mesh.obj.path = "square.obj"

[fabric]
density = 0.2
material.stvk = { stretch_stiffness = 40.0, poisson_ratio = 0.3 }

[[pins]]
vertex = 0

[output]
picture = false
ply = true
"#;
const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 1 3 4\n";

fn with_scene(text: &str) -> TempDir {
    let folder = TempDir::new().unwrap();
    std::fs::write(folder.path().join("scene.toml"), text).unwrap();
    std::fs::write(folder.path().join("square.obj"), SQUARE).unwrap();
    folder
}

fn cloth(arguments: &[&str], folder: &Path) -> Output {
    Command::new(env!("CARGO_BIN_EXE_cloth")).args(arguments).current_dir(folder).output().unwrap()
}

/// Returns what a command that must succeed writes to standard error.
fn notes(arguments: &[&str], folder: &Path) -> String {
    let output = cloth(arguments, folder);
    let message = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{arguments:?}: {message}");
    message
}

fn refused(arguments: &[&str], folder: &Path) -> String {
    let output = cloth(arguments, folder);
    assert_eq!(output.status.code(), Some(1), "{arguments:?}");
    String::from_utf8(output.stderr).unwrap()
}

#[test]
fn a_folder_that_a_run_writes_to_is_locked_until_it_ends_or_is_killed() {
    let folder = with_scene(&SCENE.replace("duration = 0.1", "duration = 10000.0"));
    let mut command = Command::new(env!("CARGO_BIN_EXE_cloth"));
    let arguments = ["run", "scene.toml", "-o", "out", "--checkpoint", "5"];
    let mut first =
        command.args(arguments).current_dir(folder.path()).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let start = Instant::now();
    while !folder.path().join("out/checkpoint").exists() {
        assert!(start.elapsed() < Duration::from_secs(60), "no checkpoint was written");
        std::thread::sleep(Duration::from_millis(2));
    }
    let message = refused(&["run", "scene.toml", "-o", "out", "--overwrite"], folder.path());
    assert!(message.contains(&format!("out is in use by process {}; wait", first.id())), "{message}");
    assert!(refused(&["resume", "out"], folder.path()).contains("in use by process"));
    assert!(folder.path().join("out/frames/cloth_0000.obj").exists(), "nothing was removed");
    first.kill().unwrap();
    first.wait().unwrap();
    assert!(folder.path().join("out/cloth.lock").exists());
    std::fs::write(folder.path().join("scene.toml"), SCENE).unwrap();
    notes(&["run", "scene.toml", "-o", "out", "--overwrite"], folder.path());
    assert!(!folder.path().join("out/cloth.lock").exists());
}

#[test]
fn a_resumed_run_repairs_frames_and_tells_of_an_edited_scene() {
    let folder = with_scene(SCENE);
    let path = folder.path();
    notes(&["run", "scene.toml", "-o", "out", "--checkpoint", "4"], path);
    let frame = |name: &str| path.join("out/frames").join(name);
    let [obj, other, ply] = ["cloth_0001.obj", "cloth_0003.obj", "cloth_0002.ply"].map(frame);
    let whole = [&obj, &other, &ply].map(|file| std::fs::read(file).unwrap());
    std::fs::remove_file(&obj).unwrap();
    std::fs::write(&other, &whole[1][..whole[1].len() - 7]).unwrap();
    std::fs::write(&ply, &whole[2][..50]).unwrap();
    std::fs::write(path.join("scene.toml"), SCENE.replace("density = 0.2", "density = 0.4")).unwrap();
    let message = notes(&["resume", "out"], path);
    assert!(
        message.contains("scene.toml was edited since the run began; the run continues with the scene"),
        "{message}"
    );
    assert!(message.contains("3 files of frames were missing or truncated"), "{message}");
    assert_eq!([&obj, &other, &ply].map(|file| std::fs::read(file).unwrap()), whole);
    std::fs::write(path.join("scene.toml"), SCENE).unwrap();
    assert_eq!(notes(&["resume", "out"], path), "");
}

#[test]
fn an_edited_mesh_is_refused_unless_it_is_accepted() {
    let folder = with_scene(SCENE);
    notes(&["run", "scene.toml", "-o", "out", "--checkpoint", "4"], folder.path());
    // Turned over: the masses are those of before.
    std::fs::write(folder.path().join("square.obj"), SQUARE.replace("f 1 3 4", "f 3 4 1")).unwrap();
    let message = refused(&["resume", "out"], folder.path());
    assert!(message.contains("square.obj was edited since the run began") && message.contains("--accept-edited"));
    notes(&["resume", "out", "--accept-edited"], folder.path());
}

/// A sheet that lies on a floor.
const LYING: &str = r#"dt = 0.01
duration = 0.2
frames_per_second = 25
integrator = "newton"
[[garment]]
placement.translate = [0.0, 0.0, 0.0044]
mesh.sheet = { cells = [4, 4], size = [0.2, 0.2] }
[garment.fabric]
density = 0.2
material.stvk = { stretch_stiffness = 40.0, poisson_ratio = 0.3 }
[[obstacles]]
plane = {}
[output]
picture = false
ply = true
velocities = true
contact_forces = true
"#;

#[test]
fn files_hold_forces_of_contact_also_after_a_repair() {
    let folder = with_scene(LYING);
    let path = folder.path();
    notes(&["run", "scene.toml", "-o", "out", "--checkpoint", "8"], path);
    let last = path.join("out/frames/cloth_0005.ply");
    let ply = std::fs::read(&last).unwrap();
    let end = ply.windows(11).position(|window| window == b"end_header\n").unwrap() + 11;
    assert!(String::from_utf8_lossy(&ply[..end]).contains("property float fz\n"));
    let number = |at: usize| f64::from(f32::from_le_bytes(ply[end + at..end + at + 4].try_into().unwrap()));
    // Three vectors of 12 bytes for each vertex, and the third component of the last.
    let carried: f64 = (0..25).map(|vertex| number(36 * vertex + 32)).sum();
    assert!((carried / (9.81 * 0.2 * 0.04) - 1.0).abs() < 0.1, "{carried} N");
    let usd = std::fs::read_to_string(path.join("out/cloth.usda")).unwrap();
    assert!(usd.contains("vector3f[] primvars:contactForce.timeSamples = {") && usd.contains("velocities.timeSamples"));
    assert!(path.join("out/contact.svg").exists());
    std::fs::write(&last, &ply[..50]).unwrap();
    std::fs::remove_file(path.join("out/cloth.usda")).unwrap();
    notes(&["resume", "out"], path);
    assert_eq!(std::fs::read(&last).unwrap(), ply);
    assert_eq!(std::fs::read_to_string(path.join("out/cloth.usda")).unwrap(), usd);
    notes(&["report", "out"], path);
    assert!(std::fs::read_to_string(path.join("out/report.html")).unwrap().contains("<h2>Contact</h2>"));
}
