//! Scenes and run folders of strangers: nothing outside the folder is written or shown, and nothing waits for ever.
#![cfg(target_os = "linux")]

use std::os::unix::fs::symlink;
use std::path::Path;
use std::process::{Command, Output};
use std::time::{Duration, Instant};

use cloth_core::run::Checkpoint;
use serde_json::json;
use tempfile::TempDir;

use crate::runs::with_scene;

pub(crate) const SCENE: &str = r#"dt = 0.01
duration = 0.2
frames_per_second = 50
integrator = "newton"

[[garment]]
name = "sheet"
mesh.sheet = { cells = [3, 3], size = [1.0, 1.0] }
[garment.fabric]
density = 0.2
material.stvk = { stretch_stiffness = 40.0, poisson_ratio = 0.3 }

[[pins]]
vertex = 0

[output]
picture = false
ledger = true
"#;

/// Runs the program with 4 GB of address space.
fn cloth(arguments: &[&str], folder: &Path) -> Output {
    let start = Instant::now();
    let command = format!("ulimit -v 4000000; exec {} \"$@\"", env!("CARGO_BIN_EXE_cloth"));
    let output = Command::new("sh").args(["-c", &command, "cloth"]).args(arguments).current_dir(folder).output();
    assert!(start.elapsed() < Duration::from_secs(60), "{arguments:?}: {:?}", start.elapsed());
    output.unwrap()
}

/// Returns the messages of a command that must succeed.
fn done(arguments: &[&str], folder: &Path) -> String {
    let output = cloth(arguments, folder);
    let message = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{arguments:?}: {message}");
    message
}

fn refused(arguments: &[&str], folder: &Path) -> String {
    let output = cloth(arguments, folder);
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{arguments:?}: {message}");
    message
}

const RUN: [&str; 6] = ["run", "scene.toml", "-o", "out", "--checkpoint", "4"];

#[test]
fn nothing_is_written_through_links_in_a_run_folder() {
    let folder = with_scene(SCENE);
    let path = folder.path();
    let precious = path.join("precious");
    let is_intact = || assert_eq!(std::fs::read_to_string(&precious).unwrap(), "precious");
    std::fs::write(&precious, "precious").unwrap();
    let names = ["checkpoint", "checkpoint.frames", "run.json", "summary.txt", "cloth.usda", "report.html"];
    let names = names.map(|name| [name.to_owned(), format!("{name}.part")]).concat();
    let plant = |names: &[String]| {
        for name in names {
            let file = path.join("out").join(name);
            let _ = std::fs::remove_file(&file);
            symlink(&precious, file).unwrap();
        }
    };
    std::fs::create_dir(path.join("out")).unwrap();
    plant(&names);
    assert!(refused(&RUN, path).contains("exists"));
    done(&[&RUN[..], &["--overwrite"]].concat(), path);
    is_intact();
    // Results as links, and the run resumed and reported.
    let results = ["run.json", "summary.txt", "cloth.usda", "report.html"].map(str::to_owned);
    plant(&results);
    done(&["resume", "out"], path);
    is_intact();
    plant(&results[3..]);
    done(&["report", "out"], path);
    is_intact();
    for name in ["cloth.lock", "checkpoint.frames"] {
        plant(&[name.to_owned()]);
        let message = refused(&["resume", "out"], path);
        assert!(message.contains("expected a regular file, got a symbolic link"), "{name}: {message}");
        std::fs::remove_file(path.join("out").join(name)).unwrap();
        is_intact();
    }
    let elsewhere = path.join("elsewhere");
    std::fs::create_dir(&elsewhere).unwrap();
    std::fs::write(elsewhere.join("cloth_0000.obj"), "precious").unwrap();
    std::fs::remove_dir_all(path.join("out/frames")).unwrap();
    symlink(&elsewhere, path.join("out/frames")).unwrap();
    let message = refused(&["run", "scene.toml", "-o", "out", "--overwrite"], path);
    assert!(message.contains("frames is not a folder"), "{message}");
    assert_eq!(std::fs::read_to_string(elsewhere.join("cloth_0000.obj")).unwrap(), "precious");
}

#[test]
fn states_that_are_no_regular_files_are_refused_at_once() {
    let folder = with_scene(SCENE);
    let path = folder.path();
    done(&RUN, path);
    assert!(Command::new("mkfifo").arg(path.join("pipe")).status().unwrap().success());
    for (name, command) in [("checkpoint", "resume"), ("checkpoint.frames", "resume"), ("run.json", "report")] {
        let file = path.join("out").join(name);
        let kept = std::fs::read(&file).unwrap();
        std::fs::remove_file(path.join("out/checkpoint.previous")).unwrap_or_default();
        for target in [Path::new("/dev/zero"), &path.join("pipe")] {
            std::fs::remove_file(&file).unwrap();
            symlink(target, &file).unwrap();
            let message = refused(&[command, "out"], path);
            assert!(message.contains("expected a regular file"), "{name}: {message}");
            std::fs::remove_file(&file).unwrap();
            assert!(Command::new("mkfifo").arg(&file).status().unwrap().success());
            assert!(refused(&[command, "out"], path).contains("expected a regular file, got a pipe"));
        }
        std::fs::remove_file(&file).unwrap();
        std::fs::write(&file, kept).unwrap();
    }
    std::fs::remove_file(path.join("out/ledger.svg")).unwrap();
    symlink(path.join("scene.toml"), path.join("out/ledger.svg")).unwrap();
    assert!(refused(&["report", "out"], path).contains("got a symbolic link"));
}

#[test]
fn a_run_continues_from_the_checkpoint_before_a_damaged_one() {
    let folder = with_scene(SCENE);
    let path = folder.path();
    done(&RUN, path);
    let results = ["cloth.usda", "ledger.csv", "frames/cloth_0010.obj"].map(|name| path.join("out").join(name));
    let expected = results.each_ref().map(|file| std::fs::read(file).unwrap());
    let checkpoint = path.join("out/checkpoint");
    let whole = std::fs::read(&checkpoint).unwrap();
    let [cut, empty, foreign] = [&whole[..whole.len() / 2], &[], b"{}"];
    for damaged in [Some(cut), Some(empty), Some(foreign), None] {
        match damaged {
            Some(contents) => std::fs::write(&checkpoint, contents).unwrap(),
            None => std::fs::remove_file(&checkpoint).unwrap(),
        }
        let message = done(&["resume", "out"], path);
        assert!(message.contains("the run continues from the checkpoint before it"), "{message}");
        assert_eq!(results.each_ref().map(|file| std::fs::read(file).unwrap()), expected);
    }
}

/// The checksum of a checkpoint finds damage, not forgery.
#[test]
fn forged_states_are_refused_or_continue_without_a_panic() {
    let forgeries = [
        ("newton", "/state/ledger/accounts/0/potential/0/0", json!(99), Some("ledger of the checkpoint does not fit")),
        ("newton", "/state/ledger/accounts", json!([]), Some("ledger of the checkpoint does not fit")),
        ("newton", "/state/ledger/entries/0/work", json!(vec![1.0; 20]), Some("ledger of the checkpoint does not fit")),
        ("newton", "/state/islands/0/integrator/adaptive", json!([64, u32::MAX]), None),
        ("newton", "/state/islands/0/bristles", json!([[[0, 0, 0]], []]), None),
        ("bdf2", "/state/islands/0/integrator/last_step/after/x", json!([]), None),
        ("bdf2", "/state/islands/0/integrator/last_step/before/v", json!([]), None),
    ];
    for integrator in ["newton", "bdf2"] {
        let folder =
            with_scene(&format!("adaptive = true\n{}", SCENE.replace("\"newton\"", &format!("\"{integrator}\""))));
        let path = folder.path();
        done(&RUN, path);
        let file = path.join("out/checkpoint");
        let whole = serde_json::to_value(Checkpoint::read(&file.with_extension("previous")).unwrap()).unwrap();
        for (_, place, value, expected) in forgeries.iter().filter(|(of, ..)| *of == integrator) {
            let mut forged = whole.clone();
            *forged.pointer_mut(place).unwrap_or_else(|| panic!("{place}: {whole}")) = value.clone();
            let forged: Checkpoint = serde_json::from_value(forged).unwrap();
            std::fs::write(&file, forged.to_bytes().unwrap()).unwrap();
            match expected {
                Some(words) => assert!(refused(&["resume", "out"], path).contains(words), "{place}"),
                None => drop(done(&["resume", "out"], path)),
            }
        }
    }
}

#[test]
fn a_checkpoint_with_an_impossible_number_of_frames_is_damaged() {
    let folder = with_scene(SCENE);
    let path = folder.path();
    done(&RUN, path);
    let file = path.join("out/checkpoint");
    std::fs::remove_file(path.join("out/checkpoint.previous")).unwrap();
    let checkpoint = Checkpoint::read(&file).unwrap();
    for frames in [usize::MAX, usize::MAX / 384, 1 << 40] {
        std::fs::write(&file, Checkpoint { frames, ..checkpoint.clone() }.to_bytes().unwrap()).unwrap();
        assert!(refused(&["resume", "out"], path).contains("it is cut short"));
    }
}

#[test]
fn a_report_runs_no_script_of_a_stranger() {
    let folder = with_scene(SCENE);
    let path = folder.path();
    done(&RUN, path);
    let svg = "<svg xmlns=\"http://www.w3.org/2000/svg\"><script>alert(1)</script></svg>";
    for name in ["ledger.svg", "contact.svg"] {
        std::fs::write(path.join("out").join(name), svg).unwrap();
    }
    let record = path.join("out/run.json");
    let text = std::fs::read_to_string(&record).unwrap();
    let script = "<script>alert('2')</script>";
    let changed = text.replace("scene.toml", script).replace("Newton", script).replace("newton", script);
    std::fs::write(&record, changed.replace("stvk", script)).unwrap();
    done(&["report", "out"], path);
    let page = std::fs::read_to_string(path.join("out/report.html")).unwrap();
    assert!(!page.contains("<script") && page.contains("&lt;script&gt;"), "{page}");
    assert!(page.contains("data:image/svg+xml;base64,") && page.contains("default-src 'none'"));
}

#[test]
fn names_reach_the_terminal_without_control_characters() {
    let named = |name: &str| SCENE.replace("\"sheet\"", &format!("\"{name}\""));
    let folder = with_scene(&named("\\u001b]0;owned\\u0007\\u202esleeve").replace("vertex = 0", "vertex = 99"));
    let mut seen = refused(&["run", "scene.toml", "-o", "out"], folder.path());
    std::fs::write(folder.path().join("scene.toml"), named("\\u001b[2Jsleeve")).unwrap();
    let output = cloth(&["run", "scene.toml", "-o", "out", "--stats"], folder.path());
    seen += &String::from_utf8(output.stderr).unwrap();
    seen += &String::from_utf8(output.stdout).unwrap();
    let evil = |c: char| c.is_control() && c != '\n' && c != '\t' || c == '\u{202e}';
    assert!(!seen.contains(evil), "{seen:?}");
}

const SECRET: &str = "v secret 0 0\n";

#[test]
fn scenes_read_their_own_folder_and_allowed_ones() {
    let outside = TempDir::new().unwrap();
    let secret = outside.path().join("secret.obj");
    std::fs::write(&secret, SECRET).unwrap();
    let mesh = |path: &str| SCENE.replace("mesh.sheet = { cells = [3, 3], size = [1.0, 1.0] }", path);
    let folder = with_scene("");
    let scene = folder.path().join("scene.toml");
    symlink(&secret, folder.path().join("link.obj")).unwrap();
    symlink(outside.path(), folder.path().join("linked")).unwrap();
    let up = "../".repeat(20);
    let paths = [
        secret.display().to_string(),
        format!("{up}{}", secret.display()),
        "link.obj".to_owned(),
        "linked/secret.obj".to_owned(),
    ];
    for path in &paths {
        let texts = [
            mesh(&format!("mesh.obj.path = \"{path}\"")),
            SCENE.replace("material.stvk", &format!("material.file.path = \"{path}\" #")),
            format!("{SCENE}[[obstacles]]\nmesh.path = \"{path}\"\n"),
            SCENE.replace("[garment.fabric]", &format!("rest.obj.path = \"{path}\"\n[garment.fabric]")),
            format!(
                "{SCENE}[[obstacles]]\nmesh = {{ path = \"{}\", frames_per_second = 25 }}\n",
                path.replace("secret.", "s*.")
            ),
        ];
        std::fs::copy(&secret, outside.path().join("s1.obj")).unwrap();
        for text in texts.iter().take(if path == "link.obj" { 4 } else { 5 }) {
            std::fs::write(&scene, text).unwrap();
            for arguments in [&["run", "scene.toml", "-o", "out"][..], &["run", "scene.toml", "--dry-run"]] {
                let message = refused(arguments, folder.path());
                assert!(
                    message.contains("is outside the scene's folder") && message.contains("--allow-path"),
                    "{message}"
                );
                assert!(!message.contains("v secret"), "{message}");
            }
            let allowed = outside.path().to_str().unwrap();
            let message = refused(&["run", "scene.toml", "-o", "out", "--allow-path", allowed], folder.path());
            assert!(!message.contains("outside"), "{message}");
        }
    }
    assert!(!folder.path().join("out").exists());
}

#[test]
fn a_sweep_of_a_billion_runs_is_refused() {
    let folder = with_scene(SCENE);
    let path = folder.path();
    let numbers = (1..=1000).map(|i| format!("{i}.0")).collect::<Vec<_>>().join(", ");
    let lists: String = ["dt", "duration", "drag"].map(|key| format!("{key} = [{numbers}]\n")).concat();
    std::fs::write(path.join("values.toml"), lists).unwrap();
    let sweep = |values: &str| refused(&["sweep", "scene.toml", values, "-o", "runs"], path);
    let message = sweep("values.toml");
    assert!(message.contains("at most 10000 runs, got all combinations of 1000 of "), "{message}");
    for values in ["/dev/zero", "/"] {
        assert!(sweep(values).contains("expected a regular file"));
    }
    assert!(!path.join("runs").exists());
    // A folder of a run that leads elsewhere.
    std::fs::write(path.join("values.toml"), "drag = [0.5]").unwrap();
    done(&["sweep", "scene.toml", "values.toml", "-o", "runs"], path);
    let run =
        path.join("runs").read_dir().unwrap().map(|entry| entry.unwrap().path()).find(|run| run.is_dir()).unwrap();
    std::fs::rename(&run, path.join("elsewhere")).unwrap();
    std::fs::remove_file(path.join("elsewhere/sweep.done")).unwrap();
    symlink(path.join("elsewhere"), &run).unwrap();
    refused(&["sweep", "scene.toml", "values.toml", "-o", "runs"], path);
    assert!(!path.join("elsewhere/sweep.done").exists());
}
