//! Tracks that are stopped or killed, and continue bit by bit.
#![cfg(unix)]

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use tempfile::TempDir;

const FRAMES: usize = 14;

fn fusion(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_fusion")).args(arguments).current_dir(folder).output().unwrap()
}

fn done(folder: &Path, arguments: &[&str]) -> String {
    let output = fusion(folder, arguments);
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{arguments:?}: {message}");
    message
}

fn refused(folder: &Path, arguments: &[&str]) -> String {
    let output = fusion(folder, arguments);
    assert_eq!(output.status.code(), Some(1), "{arguments:?}");
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// A recording whose third image is damaged, and its track with all outputs.
fn tracked(track: &[&str]) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let last = (FRAMES - 1).to_string();
    let render = ["render", "--to", &last, "--bone-turn", "5", "--bone-shift", "20", "-o", "recording"];
    done(folder.path(), &render);
    std::fs::write(folder.path().join("recording/depth/000002.png"), b"no image").unwrap();
    done(folder.path(), &[track, &["-o", "whole"]].concat());
    let path = folder.path().to_owned();
    (folder, path)
}

const TRACK: [&str; 6] = ["track", "recording", "--unknown-bones", "--usd", "--gltf", "--pictures"];

fn started(folder: &Path, arguments: &[&str]) -> Child {
    let mut command = Command::new(env!("CARGO_BIN_EXE_fusion"));
    command.args(arguments).current_dir(folder).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap()
}

fn wait_for(path: &Path) {
    let start = Instant::now();
    while !path.exists() {
        assert!(start.elapsed() < Duration::from_secs(60), "{} was not written", path.display());
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// Returns all files below a folder with their contents. Times of frames are cut off.
fn contents(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut files = Vec::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(next) = folders.pop() {
        for entry in next.read_dir().unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
                continue;
            }
            let mut bytes = std::fs::read(&path).unwrap();
            if path.ends_with("frames.csv") {
                let text = String::from_utf8(bytes).unwrap();
                bytes = text.lines().map(|line| line.rsplit_once(',').unwrap().0).collect::<Vec<_>>().join("\n").into();
            }
            files.push((path.strip_prefix(folder).unwrap().to_owned(), bytes));
        }
    }
    files.sort();
    files
}

fn assert_same(folder: &Path, one: &str, other: &str) {
    let [one, other] = [one, other].map(|name| contents(&folder.join(name)));
    let names = |files: &[(PathBuf, Vec<u8>)]| files.iter().map(|(path, _)| path.clone()).collect::<Vec<_>>();
    assert_eq!(names(&one), names(&other));
    for ((path, one), (_, other)) in one.iter().zip(&other) {
        assert!(one == other, "{} differs", path.display());
    }
}

#[test]
fn a_stopped_track_has_results_and_continues_bit_by_bit() {
    let track = ["track", "recording", "--unknown-bones", "--usd", "--surface"];
    let (_folder, path) = tracked(&track);
    for (signal, code) in [("-TERM", 143), ("-HUP", 129)] {
        let mut child = started(&path, &[&track[..], &["-o", "part", "--overwrite"]].concat());
        wait_for(&path.join("part/meshes/000004.obj"));
        let second = refused(&path, &["track", "recording", "-o", "part", "--overwrite"]);
        assert!(second.contains(&format!("part is in use by process {}", child.id())), "{second}");
        assert!(refused(&path, &["resume", "part"]).contains("in use by process"));
        assert!(Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap().success());
        let ended = child.wait().unwrap();
        if ended.code() == Some(0) {
            // It was faster than the signal.
            continue;
        }
        assert_eq!(ended.code(), Some(code));
        let table = std::fs::read_to_string(path.join("part/frames.csv")).unwrap();
        let rows = table.lines().count() - 1;
        assert!((5..FRAMES).contains(&rows), "{rows} of {FRAMES} frames");
        let nodes: serde_json::Value =
            serde_json::from_slice(&std::fs::read(path.join("part/nodes.json")).unwrap()).unwrap();
        assert_eq!(nodes["frames"].as_array().unwrap().len(), rows);
        done(&path, &["resume", "part"]);
        assert_same(&path, "whole", "part");
        std::fs::remove_dir_all(path.join("part")).unwrap();
    }
}

#[test]
fn a_killed_track_continues_from_its_last_checkpoint() {
    let (_folder, path) = tracked(&TRACK);
    for kill_at in [0, 6] {
        let mut child = started(&path, &[&TRACK[..], &["-o", "part"]].concat());
        wait_for(&path.join(format!("part/meshes/{kill_at:06}.obj")));
        child.kill().unwrap();
        child.wait().unwrap();
        // Frames after the checkpoint are tracked again; a truncated mesh of an earlier frame is written again.
        std::fs::write(path.join("part/meshes/000000.obj"), "v 0 0").unwrap();
        done(&path, &["resume", "part"]);
        assert_same(&path, "whole", "part");
        std::fs::remove_dir_all(path.join("part")).unwrap();
    }
}

/// Stops a track after some frames.
fn stopped(path: &Path) {
    let mut child = started(path, &["track", "recording", "--unknown-bones", "-o", "part"]);
    wait_for(&path.join("part/meshes/000003.obj"));
    assert!(Command::new("kill").args(["-TERM", &child.id().to_string()]).status().unwrap().success());
    assert_eq!(child.wait().unwrap().code(), Some(143));
}

#[test]
fn damaged_checkpoints_are_refused_or_the_one_before_is_used() {
    let (_folder, path) = tracked(&["track", "recording", "--unknown-bones"]);
    stopped(&path);
    let [last, previous] = ["checkpoint", "checkpoint.previous"].map(|name| path.join("part").join(name));
    let whole = std::fs::read(&last).unwrap();
    let journal = path.join("part/checkpoint.frames");
    let frames = std::fs::read(&journal).unwrap();
    std::fs::write(&last, &whole[..whole.len() - 1]).unwrap();
    let before = std::fs::read(&previous).unwrap();
    std::fs::remove_file(&previous).unwrap();
    for at in [0, 10, whole.len() / 2, whole.len() - 1] {
        let mut changed = whole.clone();
        changed[at] ^= 1;
        std::fs::write(&last, changed).unwrap();
        assert!(refused(&path, &["resume", "part"]).contains("checkpoint"));
    }
    std::fs::write(&last, &whole).unwrap();
    std::fs::write(&journal, &frames[..frames.len() / 2]).unwrap();
    assert!(refused(&path, &["resume", "part"]).contains("it is cut short"));
    std::fs::write(&journal, &frames).unwrap();
    let model = path.join("recording/model.json");
    let text = std::fs::read_to_string(&model).unwrap();
    std::fs::write(&model, text.replacen("0.", "0.1", 1)).unwrap();
    let message = refused(&path, &["resume", "part"]);
    assert!(message.contains("model.json was edited since the track began"), "{message}");
    std::fs::write(&model, text).unwrap();
    std::fs::write(&last, b"damaged").unwrap();
    std::fs::write(&previous, before).unwrap();
    let message = done(&path, &["resume", "part"]);
    assert!(message.contains("the track continues from the checkpoint before it"), "{message}");
    assert_same(&path, "whole", "part");
    assert!(refused(&path, &["resume", "part"]).contains("is the track complete?"));
    assert!(refused(&path, &["resume", "missing"]).contains("is not a folder of a track"));
}

#[test]
fn nothing_is_written_through_links_in_a_track() {
    let (_folder, path) = tracked(&["track", "recording", "--no-bones"]);
    let precious = path.join("precious");
    std::fs::write(&precious, "precious").unwrap();
    let plant = |name: &str| std::os::unix::fs::symlink(&precious, path.join("part").join(name)).unwrap();
    std::fs::create_dir_all(path.join("part/meshes")).unwrap();
    for name in ["frames.csv", "frames.csv.part", "track.usda.part", "meshes/000001.obj", "checkpoint.frames"] {
        plant(name);
    }
    let track = ["track", "recording", "--no-bones", "--usd", "-o", "part"];
    assert!(refused(&path, &track).contains("exists"));
    done(&path, &[&track[..], &["--overwrite"]].concat());
    plant("fusion.lock");
    assert!(refused(&path, &[&track[..], &["--overwrite"]].concat()).contains("got a symbolic link"));
    std::fs::remove_file(path.join("part/fusion.lock")).unwrap();
    for name in ["checkpoint", "checkpoint.previous", "checkpoint.frames"] {
        plant(name);
        assert!(refused(&path, &["resume", "part"]).contains("cannot read the checkpoint"));
    }
    std::fs::remove_dir_all(path.join("part/meshes")).unwrap();
    std::os::unix::fs::symlink(path.join("whole/meshes"), path.join("part/meshes")).unwrap();
    assert!(refused(&path, &[&track[..], &["--overwrite"]].concat()).contains("meshes is not a folder"));
    assert!(path.join("whole/meshes/000000.obj").exists());
    assert_eq!(std::fs::read_to_string(&precious).unwrap(), "precious");
}
