//! Scenes of strangers: numbers, names and limits of the process that end in an error, or in no trouble at all.
#![cfg(target_os = "linux")]

use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

use crate::hostile_folders::SCENE;
use crate::runs::with_scene;

/// Runs the program with 300 MB of address space; returns its exit status and its messages.
fn cloth(folder: &Path, limit: &str, arguments: &[&str]) -> (Option<i32>, String) {
    let start = Instant::now();
    let command = format!("ulimit {limit}; exec {} \"$@\"", env!("CARGO_BIN_EXE_cloth"));
    let output = Command::new("sh").args(["-c", &command, "cloth"]).args(arguments).current_dir(folder).output();
    let output = output.unwrap();
    assert!(start.elapsed() < Duration::from_secs(20), "{arguments:?}: {:?}", start.elapsed());
    (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
}

/// 300 MB, also of address space that is not used.
const MEMORY: &str = "-v 300000";

#[test]
fn many_gusts_are_refused_with_their_line() {
    let gusts = "[[wind.gusts]]\namplitude = [0, 0, 1]\nperiod = 1\n".repeat(50_000);
    let folder = with_scene(&format!("{SCENE}[wind]\nvelocity = [0, 0, 1]\n{gusts}"));
    for command in [&["run", "scene.toml", "--dry-run"][..], &["run", "scene.toml", "-o", "out"]] {
        let (code, message) = cloth(folder.path(), MEMORY, command);
        assert_eq!(code, Some(1), "{message}");
        assert!(message.contains("scene.toml:21:1: expected at most 64 gusts, got 50000"), "{message}");
    }
    assert!(!folder.path().join("out").exists());
}

/// A TOML file of two bytes for each number takes 75 times its size while it is parsed.
#[test]
fn a_scene_of_numbers_takes_no_more_memory_than_its_size_allows() {
    let folder = with_scene(&format!("{SCENE}x = [{}]\n", "0,".repeat(2_000_000)));
    let (code, message) = cloth(folder.path(), "-v 500000", &["run", "scene.toml", "-o", "out"]);
    assert!(code == Some(1) && message.contains("unknown field `x`") && message.len() < 1000, "{message}");
    let folder = with_scene(&format!("{SCENE}x = [{}]\n", "0,".repeat(2_200_000)));
    let (code, message) = cloth(folder.path(), MEMORY, &["run", "scene.toml", "-o", "out"]);
    let expected = "cannot read the scene scene.toml: it is larger than 4 MiB";
    assert!(code == Some(1) && message.contains(expected), "{message}");
}

/// File systems have names of at most 255 bytes.
#[test]
fn a_garment_may_have_a_long_name() {
    let folder = with_scene(&SCENE.replace("\"sheet\"", &format!("\"{}\"", "n".repeat(300))));
    let (code, message) = cloth(folder.path(), MEMORY, &["run", "scene.toml", "-o", "out"]);
    assert_eq!(code, Some(0), "{message}");
    for name in ["cloth.usda", "cloth.glb", "ledger.csv", "frames/cloth_0010.obj"] {
        assert!(folder.path().join("out").join(name).exists(), "{name}: {message}");
    }
}

/// The system sends a signal at a file that is too large. It ends programs that do not listen.
#[test]
fn a_limit_of_the_size_of_files_is_an_error_of_the_file() {
    let folder = with_scene(SCENE);
    let (code, message) = cloth(folder.path(), "-f 8", &["run", "scene.toml", "-o", "out"]);
    assert_eq!(code, Some(1), "{message}");
    assert!(message.contains("cannot write out/") && message.contains("File too large"), "{message}");
    let unfinished = std::fs::read_dir(folder.path().join("out")).unwrap().filter_map(Result::ok);
    let unfinished: Vec<_> = unfinished.filter(|file| file.file_name().to_string_lossy().contains(".part")).collect();
    assert!(unfinished.is_empty(), "{unfinished:?}");
}

#[test]
fn messages_about_numbers_are_short() {
    for (from, to, expected) in [
        (
            "density = 0.2",
            "density = 1e308",
            "10:11: expected a finite number greater than 0 and up to 1e12, got 1e308",
        ),
        ("= 40.0", "= -1e308", "11:39: expected a finite number of at least 0 and up to 1e12, got -1e308"),
        ("ratio = 0.3", "ratio = 1e308", "expected a number strictly between −1 and 1, got 1e308"),
        ("dt = 0.01", "dt = 1e-308", "`duration` takes 2.0e307 steps of `dt`"),
    ] {
        let folder = with_scene(&SCENE.replace(from, to));
        let (code, message) = cloth(folder.path(), MEMORY, &["run", "scene.toml", "-o", "out"]);
        assert_eq!(code, Some(1), "{message}");
        assert!(message.contains(expected) && message.len() < 300, "{} bytes: {message:.2000}", message.len());
    }
}

#[test]
fn messages_about_a_mesh_are_short() {
    let fan = (0..60_000).map(|i| format!("v {i} 1 0\nf 1 2 {}\n", i + 3)).collect::<String>();
    let fan = format!("v 0 0 0\nv 1 0 0\n{fan}");
    let far = format!("v 1 0 0\nv 0 1{} 0\nv 0 0 0\nf 1 2 3\n", "0".repeat(308));
    for (mesh, expected) in [(fan, "shared by 60000 triangles [0, 1, 2, 3, 4] and more"), (far, "mesh.obj")] {
        let sheet = "mesh.sheet = { cells = [3, 3], size = [1.0, 1.0] }";
        let folder = with_scene(&SCENE.replace(sheet, "mesh.obj.path = \"mesh.obj\""));
        std::fs::write(folder.path().join("mesh.obj"), mesh).unwrap();
        let (code, message) = cloth(folder.path(), MEMORY, &["run", "scene.toml", "-o", "out"]);
        assert_eq!(code, Some(1), "{message}");
        assert!(message.contains(expected) && message.len() < 1000, "{} bytes: {message:.2000}", message.len());
    }
}
