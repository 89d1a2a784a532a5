//! Runs that would not fit into memory, and input files that do not end.
#![cfg(target_os = "linux")]

use std::process::Command;

use tempfile::TempDir;

fn scene(mesh: &str) -> String {
    format!(
        "dt = 0.01\nduration = 0.02\n{mesh}\n[fabric]\ndensity = 0.2\n\
         material.stvk = {{ stretch_stiffness = 40.0, poisson_ratio = 0.3 }}\n\
         [output]\npicture = false\nusd = false\ngltf = false\n"
    )
}

/// Runs a scene in an address space of 4 GB; returns whether it succeeded, and its messages.
fn run(scene: &str, flags: &str) -> (bool, String) {
    let folder = TempDir::new().unwrap();
    std::fs::write(folder.path().join("scene.toml"), scene).unwrap();
    assert!(Command::new("mkfifo").arg(folder.path().join("pipe.obj")).status().unwrap().success());
    let command = format!("ulimit -v 4000000; exec {} run scene.toml -o out {flags}", env!("CARGO_BIN_EXE_cloth"));
    let output = Command::new("sh").args(["-c", &command]).current_dir(folder.path()).output().unwrap();
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(folder.path().join("out").exists(), output.status.success(), "{message}");
    (output.status.success(), message)
}

#[test]
fn a_run_that_does_not_fit_into_memory_is_refused_before_it_starts() {
    let (succeeded, message) = run(&scene("mesh.sheet = { cells = [2000, 2000], size = [1.0, 1.0] }"), "");
    assert!(!succeeded && message.contains("for 4004001 vertices"), "{message}");
    assert!(message.contains("of memory are available") && message.contains("--ignore-memory"), "{message}");
    assert!(run(&scene("mesh.sheet = { cells = [10, 10], size = [1.0, 1.0] }"), "").0);
    assert!(run(&scene("mesh.sheet = { cells = [10, 10], size = [1.0, 1.0] }"), "--ignore-memory").0);
}

#[test]
fn meshes_are_read_from_regular_files_only() {
    for path in ["/dev/zero", "pipe.obj", "/"] {
        let (succeeded, message) = run(&scene(&format!("mesh.obj.path = \"{path}\"")), "--allow-path /");
        assert!(!succeeded && message.contains("expected a regular file, got "), "{path}: {message}");
    }
    let zero = Command::new(env!("CARGO_BIN_EXE_cloth")).args(["run", "/dev/zero", "-o", "out"]).output().unwrap();
    let message = String::from_utf8(zero.stderr).unwrap();
    let expected = "cannot read the scene /dev/zero: expected a regular file, got a pipe, socket or device";
    assert!(message.contains(expected), "{message}");
}
