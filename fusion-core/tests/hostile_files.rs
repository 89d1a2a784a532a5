//! Files that were made to exhaust memory, to wait for ever, or to put rubbish into results.
#![cfg(target_os = "linux")]

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use fusion_core::body::{Mesh, SkinnedBody, figure, write_body};
use fusion_core::skeleton::Skeleton;
use nalgebra::Vector3;
use tempfile::TempDir;

/// Runs the program with 1 GB of address space; returns its exit status and its messages.
fn fusion(folder: &Path, arguments: &[&str]) -> (Option<i32>, String) {
    let start = Instant::now();
    let command = format!("ulimit -v 1000000; exec {} \"$@\"", env!("CARGO_BIN_EXE_fusion"));
    let output = Command::new("sh").args(["-c", &command, "fusion"]).args(arguments).current_dir(folder).output();
    let output = output.unwrap();
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(start.elapsed() < Duration::from_secs(20), "{arguments:?}: {:?}", start.elapsed());
    assert!(message.len() < 2000, "{arguments:?}: a message of {} bytes", message.len());
    (output.status.code(), message)
}

/// Asserts that a command fails with a message that has all these words.
fn refused(folder: &Path, arguments: &[&str], words: &[&str]) {
    let (code, message) = fusion(folder, arguments);
    assert_eq!(code, Some(1), "{arguments:?}: {message}");
    for word in words {
        assert!(message.contains(word), "{arguments:?}: `{word}` not in: {message}");
    }
}

fn recording() -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let (code, message) = fusion(folder.path(), &["render", "--to", "1", "-o", "recording"]);
    assert_eq!(code, Some(0), "{message}");
    let recording = folder.path().join("recording");
    (folder, recording)
}

const MOTION: &str = "HIERARCHY\nROOT Hips\n{\nOFFSET 0 0 0\nCHANNELS 3 Zrotation Xrotation Yrotation\nEnd Site\n{\n\
                      OFFSET 0 1 0\n}\n}\nMOTION\nFrames: 2\nFrame Time: 0.03\n0 0 0\n1 2 3\n";

#[test]
fn pipes_devices_and_folders_are_not_read() {
    let (folder, recording) = recording();
    let folder = folder.path();
    assert!(Command::new("mkfifo").arg(folder.join("pipe")).status().unwrap().success());
    let link = |target: &Path, name: &str| std::os::unix::fs::symlink(target, folder.join(name)).unwrap();
    for (kind, target) in [("pipe", folder.join("pipe")), ("zero", "/dev/zero".into()), ("folder", recording.clone())] {
        for extension in ["glb", "json", "obj", "bvh"] {
            link(&target, &format!("{kind}.{extension}"));
        }
        let expected = &["expected a regular file"];
        for extension in ["glb", "json", "obj"] {
            // A folder is a body in another format.
            if kind != "folder" {
                let body = format!("{kind}.{extension}");
                refused(folder, &["pose", "--body", &body, "--motion", "m.bvh", "-o", "out"], expected);
            }
        }
        let motion = format!("{kind}.bvh");
        refused(folder, &["pose", "--body", "recording/model.json", "--motion", &motion, "-o", "out"], expected);
        let json = format!("{kind}.json");
        for option in ["--skeleton", "--joints", "--options"] {
            refused(folder, &["track", "recording", option, &json, "-o", "out"], expected);
        }
        for name in ["intrinsics.json", "depth.txt", "depth/000000.png", "mask/000000.png", "model.json"] {
            let file = recording.join(name);
            let kept = std::fs::read(&file).ok();
            let _ = std::fs::remove_file(&file);
            std::fs::create_dir_all(file.parent().unwrap()).unwrap();
            std::os::unix::fs::symlink(&target, &file).unwrap();
            let (code, message) = fusion(folder, &["track", "recording", "-o", "out", "--overwrite"]);
            // A folder is a model in another format, and single images may be missing.
            let reason = if kind == "folder" && name == "model.json" { "no file base" } else { expected[0] };
            assert!(message.contains(reason), "{name}, {kind}: {message}");
            assert_eq!(code, Some(i32::from(!name.ends_with(".png"))), "{name}, {kind}: {message}");
            std::fs::remove_file(&file).unwrap();
            if let Some(contents) = kept {
                std::fs::write(&file, contents).unwrap();
            }
        }
    }
}

#[test]
fn large_images_are_refused_by_their_headers() {
    let (folder, recording) = recording();
    let mut encoder_output = Vec::new();
    let mut encoder = png::Encoder::new(&mut encoder_output, 20_000, 20_000);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::Sixteen);
    let mut writer = encoder.write_header().unwrap();
    let mut rows = writer.stream_writer().unwrap();
    for _ in 0..20_000 {
        std::io::Write::write_all(&mut rows, &[0; 40_000]).unwrap();
    }
    rows.finish().unwrap();
    drop(writer);
    std::fs::write(recording.join("depth/000000.png"), &encoder_output).unwrap();
    let (_, message) = fusion(folder.path(), &["track", "recording", "-o", "out"]);
    assert!(message.contains("expected [640, 480] pixels as in the camera, got [20000, 20000]"), "{message}");
    std::fs::remove_file(recording.join("intrinsics.json")).unwrap();
    std::fs::copy(recording.join("depth/000000.png"), recording.join("depth/000001.png")).unwrap();
    let camera = ["track", "recording", "--camera", "525,525,319.5,239.5", "-o", "other"];
    refused(folder.path(), &camera, &["at most 8388608 pixels, got [20000, 20000]"]);
}

#[test]
fn cameras_have_a_largest_image() {
    let (folder, recording) = recording();
    let path = recording.join("intrinsics.json");
    let text = std::fs::read_to_string(&path).unwrap();
    for size in ["100000", "1000000000", "18446744073709551615"] {
        let large = text.replace("640", size).replace("480", size);
        std::fs::write(&path, &large).unwrap();
        refused(folder.path(), &["track", "recording", "-o", "out"], &["intrinsics.json", "at most 8388608 pixels"]);
        let distorted = large.replacen('{', "{\"distortion\": {\"k1\": 0.1},", 1);
        std::fs::write(&path, distorted).unwrap();
        refused(folder.path(), &["track", "recording", "-o", "out"], &["intrinsics.json", "at most 8388608 pixels"]);
    }
}

#[test]
fn lists_name_files_in_their_folder_only() {
    let (folder, recording) = recording();
    for path in ["/etc/passwd", "../../secret.png", "depth/../../secret.png"] {
        std::fs::write(recording.join("depth.txt"), format!("0.0 depth/000000.png\n0.1 {path}\n")).unwrap();
        let words = ["depth.txt:2", "expected a path inside the folder", path];
        refused(folder.path(), &["track", "recording", "-o", "out"], &words);
    }
}

#[test]
fn more_frames_than_memory_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let (code, message) = fusion(folder.path(), &["demo", "--frames", "1000000000000", "-o", "out"]);
    assert!(code == Some(2) && message.contains("not in 1..=54000"), "{message}");
    for command in ["pose", "render"] {
        for last in ["1000000000000", "18446744073709551615"] {
            let arguments = [command, "--to", last, "-o", "out"];
            refused(folder.path(), &arguments, &["frames of 16 bones: expected at most 250000", "--step"]);
        }
    }
    let from = ["pose", "--from", "18446744073709551615", "-o", "out"];
    assert!(fusion(folder.path(), &from).0.is_some_and(|code| code < 100));
}

#[test]
fn a_face_of_a_million_corners_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let text = format!("v 0 0 0\nv 1 0 0\nv 0 1 0\nf {}\n", "1 2 3 ".repeat(3_000_000));
    std::fs::write(folder.path().join("face.obj"), text).unwrap();
    std::fs::write(folder.path().join("m.bvh"), MOTION).unwrap();
    let arguments = ["pose", "--body", "face.obj", "--motion", "m.bvh", "-o", "out"];
    refused(folder.path(), &arguments, &["face.obj:4: a face has at most 65536 corners"]);
}

#[test]
fn numbers_that_are_not_finite_are_refused_with_their_line() {
    let (folder, _) = recording();
    for (from, to, line) in [
        ("OFFSET 0 0 0", "OFFSET nan 0 0", 4),
        ("OFFSET 0 1 0", "OFFSET 0 inf 0", 8),
        ("OFFSET 0 0 0", "OFFSET 1e308 0 0", 4),
        ("1 2 3", "1e308 2 3", 15),
        ("1 2 3", "1 -inf 3", 15),
        ("1 2 3", "1 2 NaN", 15),
        ("0.03", "1e999", 13),
    ] {
        std::fs::write(folder.path().join("m.bvh"), MOTION.replacen(from, to, 1)).unwrap();
        for command in ["pose", "render"] {
            let arguments = [command, "--body", "recording/model.json", "--motion", "m.bvh", "-o", "out"];
            refused(folder.path(), &arguments, &[&format!("m.bvh:{line}: ")]);
        }
    }
    assert!(!folder.path().join("out").exists());
}

/// Results with a non-finite number are not written: in JSON it would be `null`.
#[test]
fn stored_results_have_no_null() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("skeleton.json");
    let frames = vec![vec![[1.0, 0.0, 0.0, 0.0, f64::NAN, 0.0, 0.0]]];
    let skeleton = Skeleton { bones: vec!["root".into()], frames, timestamps: None };
    assert!(skeleton.write(&path).unwrap_err().to_string().contains("frame 0: expected a finite"));
    let mut body = figure();
    body.mesh.vertices[7].x = f64::INFINITY;
    assert!(format!("{:?}", write_body(&path, &body).unwrap_err()).contains("NonFinite { vertex: 7 }"));
    assert!(!path.exists());
    let far = Mesh::new(vec![Vector3::zeros(), Vector3::x() * 1e300, Vector3::y()], vec![[0, 1, 2]]);
    assert!(SkinnedBody::without_bones(far).is_err());
}

#[test]
fn a_long_motion_takes_linear_time() {
    let (folder, _) = recording();
    let lines = "0 0 0\n".repeat(300_000);
    let text = MOTION.replace("Frames: 2", "Frames: 300002").replace("1 2 3\n", &format!("1 2 3\n{lines}"));
    std::fs::write(folder.path().join("m.bvh"), text).unwrap();
    let arguments = ["pose", "--body", "recording/model.json", "--motion", "m.bvh", "--to", "1", "-o", "out"];
    let (code, message) = fusion(folder.path(), &arguments);
    assert_eq!(code, Some(0), "{message}");
}
