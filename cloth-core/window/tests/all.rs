//! `cloth-window` from outside, without a display.
#![cfg(target_os = "linux")]

use std::path::Path;
use std::process::Command;

const SCENE: &str = r#"dt = 0.01
duration = 0.2

[mesh.sheet]
cells = [6, 6]
size = [1.0, 1.0]

[fabric]
density = 0.15

[fabric.material.stvk]
stretch_stiffness = 50.0
poisson_ratio = 0.3
"#;

/// Runs the program with this display and returns its message.
fn refused(shown: &str, folder: &Path, display: Option<&str>) -> String {
    let mut command = Command::new(env!("CARGO_BIN_EXE_cloth-window"));
    command.arg(shown).current_dir(folder).env_remove("WAYLAND_DISPLAY").env_remove("DISPLAY");
    if let Some(display) = display {
        command.env("DISPLAY", display);
    }
    let output = command.output().unwrap();
    assert!(!output.status.success());
    String::from_utf8(output.stderr).unwrap()
}

#[test]
fn a_scene_that_is_missing_or_reads_elsewhere_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    assert!(refused("nothing.toml", folder.path(), None).contains("cannot read the scene nothing.toml"));
    let elsewhere = SCENE.replace("[mesh.sheet]\ncells = [6, 6]\nsize = [1.0, 1.0]", "[mesh]\nobj.path = \"/x/y.obj\"");
    std::fs::write(folder.path().join("scene.toml"), elsewhere).unwrap();
    let message = refused("scene.toml", folder.path(), None);
    assert!(message.contains("--allow-path"), "{message}");
}

#[test]
fn a_display_that_is_missing_or_unknown_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("scene.toml"), SCENE).unwrap();
    let message = refused("scene.toml", folder.path(), None);
    assert!(message.contains("no display"), "{message}");
    let message = refused("scene.toml", folder.path(), Some(":nobody"));
    assert!(message.contains("cannot open a window: ") && !message.contains("panicked"), "{message}");
}
