//! How runs end: by a failed step, by signals, while files are written.

use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use crate::runs::{cloth, with_scene};

/// A sheet that symplectic Euler cannot step stably.
const UNSTABLE: &str = r#"dt = 0.01
duration = 4.0
frames_per_second = 25
integrator = "symplectic-euler"

[mesh.sheet]
cells = [6, 6]
size = [1.0, 1.0]

[fabric]
density = 0.15
material.stvk = { stretch_stiffness = 500.0, poisson_ratio = 0.3 }

[[pins]]
nearest = [-0.5, 0.5, 0.0]
"#;

fn read(folder: &Path, name: &str) -> Vec<u8> {
    std::fs::read(folder.join(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
}

#[test]
fn a_run_that_blows_up_keeps_everything_up_to_its_last_good_step() {
    for ledger in [true, false] {
        let folder =
            with_scene(&format!("{UNSTABLE}[output]\npng = {ledger}\npicture = {ledger}\nledger = {ledger}\n"));
        let output = cloth(&["run", "scene.toml", "-o", "out"], folder.path());
        let message = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(1), "{message}");
        for part in
            ["error: step ", "triangle ", " of garment 0 (vertices [", "Try a smaller dt", "the files hold the "]
        {
            assert!(message.to_lowercase().contains(&part.to_lowercase()), "{part}: {message}");
        }
        let out = folder.path().join("out");
        let record: serde_json::Value = serde_json::from_slice(&read(&out, "run.json")).unwrap();
        let (steps, frames) = (record["summary"]["steps"].as_u64().unwrap(), record["frames"].as_u64().unwrap());
        assert!(record["finished"] == false && steps > 2 && frames == steps / 4 + 1, "{steps} {frames}");
        assert!(read(&out, "cloth.glb").starts_with(b"glTF"));
        let usd = String::from_utf8(read(&out, "cloth.usda")).unwrap().replace("info:id", "");
        assert!(
            usd.contains(&format!("endTimeCode = {}\n", frames - 1)) && !usd.contains("inf") && !usd.contains("nan")
        );
        assert!(String::from_utf8(read(&out, "summary.txt")).unwrap().contains("the run ended early: step "));
        if ledger {
            assert!(read(&out, "cloth.png").starts_with(b"\x89PNG"));
            assert!(out.join(format!("frames/cloth_{:04}.png", frames - 1)).exists());
            let lines = String::from_utf8(read(&out, "ledger.csv")).unwrap().lines().count() as u64;
            assert_eq!(lines, steps + 2);
            assert!(cloth(&["report", "out"], folder.path()).status.success());
        }
    }
}

fn started(arguments: &[&str], folder: &Path) -> Child {
    let mut command = Command::new(env!("CARGO_BIN_EXE_cloth"));
    command.args(arguments).current_dir(folder).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap()
}

/// A run that takes hours, with frames of few files.
fn endless() -> String {
    UNSTABLE.replace("symplectic-euler", "newton").replace("duration = 4.0", "duration = 10000.0")
}

fn wait_for(path: &Path) {
    let start = Instant::now();
    while !path.exists() {
        assert!(start.elapsed() < Duration::from_secs(120), "{} was not written", path.display());
        std::thread::sleep(Duration::from_millis(2));
    }
}

#[cfg(unix)]
fn send(signal: &str, child: &Child) {
    assert!(Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap().success());
}

/// Whether the test itself ignores Ctrl-C, as in the background of a shell; programs that it starts then do, too.
#[cfg(unix)]
fn ignores_interrupts() -> bool {
    ignores(2)
}

/// Whether the test itself ignores a signal, as below `nohup`.
#[cfg(unix)]
fn ignores(signal: u32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| u64::from_str_radix(line.strip_prefix("SigIgn:")?.trim(), 16).ok());
    mask.is_some_and(|mask| mask >> (signal - 1) & 1 == 1)
}

#[cfg(unix)]
#[test]
fn signals_set_the_exit_status_and_stay_ignored_if_they_were() {
    let folder = with_scene(&format!("{}[output]\npicture = false\n", endless()));
    let start = |program: &str, arguments: &[&str], out: &str| {
        let mut command = Command::new(program);
        command.args(arguments).args(["run", "scene.toml", "-o", out]).current_dir(folder.path());
        let child = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        wait_for(&folder.path().join(out).join("frames/cloth_0002.obj"));
        child
    };
    let all = [("-TERM", 143), ("-HUP", 129), ("-INT", 130)];
    for (signal, status) in all.into_iter().filter(|(_, status)| !ignores(status - 128)) {
        let mut child = start(env!("CARGO_BIN_EXE_cloth"), &[], signal.trim_start_matches('-'));
        send(signal, &child);
        assert_eq!(child.wait().unwrap().code(), Some(status as i32), "{signal}");
    }
    // `nohup` ignores the signal and becomes the program.
    let mut child = start("nohup", &[env!("CARGO_BIN_EXE_cloth")], "nohup");
    send("-HUP", &child);
    let frames = folder.path().join("nohup/frames");
    let count = std::fs::read_dir(&frames).unwrap().count();
    wait_for(&frames.join(format!("cloth_{:04}.obj", count + 3)));
    assert!(child.try_wait().unwrap().is_none(), "it still runs");
    send("-TERM", &child);
    assert_eq!(child.wait().unwrap().code(), Some(143));
}

/// `timeout` sends its signal to the program and then to its group.
#[cfg(unix)]
#[test]
fn a_signal_that_is_sent_twice_at_once_counts_once() {
    if ignores(15) {
        return;
    }
    let folder = with_scene(&endless());
    let mut child = started(&["run", "scene.toml", "-o", "out"], folder.path());
    let out = folder.path().join("out");
    wait_for(&out.join("frames/cloth_0002.obj"));
    send("-TERM", &child);
    send("-TERM", &child);
    assert_eq!(child.wait().unwrap().code(), Some(143));
    for name in ["run.json", "summary.txt", "cloth.glb", "cloth.png"] {
        assert!(out.join(name).exists(), "{name} was not written");
    }
}

#[test]
fn pictures_of_frames_are_drawn_while_the_run_continues() {
    if std::thread::available_parallelism().map_or(1, usize::from) == 1 {
        return; // a single thread draws after the last step
    }
    let folder = with_scene(&format!("{}[output]\npng = true\n", endless()));
    let mut child = started(&["run", "scene.toml", "-o", "out"], folder.path());
    wait_for(&folder.path().join("out/frames/cloth_0000.png"));
    assert!(!folder.path().join("out/run.json").exists() && child.try_wait().unwrap().is_none());
    child.kill().unwrap();
    child.wait().unwrap();
}

#[cfg(unix)]
#[test]
fn an_interrupt_while_files_are_written_leaves_what_a_report_needs() {
    if ignores_interrupts() {
        return;
    }
    // A thread alone draws after the record is written. It draws for much longer than the signal takes, on any machine:
    // 501 pictures with four times the usual pixels.
    let scene = endless().replace("duration = 10000.0", "duration = 5.0").replace("second = 25", "second = 100");
    let scene = scene.replace("cells = [6, 6]", "cells = [1, 1]");
    let folder = with_scene(&format!("{scene}[output]\npicture = false\npng = true\nsize = [2400, 2000]\n"));
    let child = started(&["run", "scene.toml", "-o", "out", "--threads", "1"], folder.path());
    let out = folder.path().join("out");
    wait_for(&out.join("run.json"));
    send("-INT", &child);
    let output = child.wait_with_output().unwrap();
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(130), "{message}");
    assert!(message.contains("stopped after step 500 of 500, before all files were written"), "{message}");
    assert!(out.join("frames/cloth_0500.obj").exists() && !out.join("frames/cloth_0500.png").exists());
    let record: serde_json::Value = serde_json::from_slice(&read(&out, "run.json")).unwrap();
    assert_eq!((&record["finished"], &record["frames"]), (&true.into(), &501.into()));
    assert!(cloth(&["report", "out"], folder.path()).status.success());
}

#[test]
fn pictures_of_all_frames_show_the_same_part_of_space() {
    // With one thread and with two, and thus in any order of drawing, the pictures are the same.
    let scene = endless().replace("duration = 10000.0", "duration = 0.04");
    let folder = with_scene(&format!("{scene}[output]\npng = true\npicture = false\n"));
    for (threads, out) in [("1", "one"), ("2", "two")] {
        let output = cloth(&["run", "scene.toml", "-o", out, "--threads", threads], folder.path());
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    }
    for frame in 0..2 {
        let [one, two] =
            ["one", "two"].map(|out| read(&folder.path().join(out), &format!("frames/cloth_{frame:04}.png")));
        assert!(one == two, "frame {frame}");
    }
}
