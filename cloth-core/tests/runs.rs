//! Runs of the binary: interruption, checkpoints, output formats, reports.

use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use tempfile::TempDir;

use super::other_programs::ask;

pub(crate) const SCENE: &str = r#"dt = 0.01
duration = 0.3
frames_per_second = 50
integrator = "newton"
drag = 0.5

[[garment]]
name = "cloth"
placement = { translate = [0.0, 0.0, 0.12] }
[garment.mesh.sheet]
cells = [8, 8]
size = [0.5, 0.5]
[garment.fabric]
density = 0.2
[garment.fabric.material.stvk]
stretch_stiffness = 40.0
poisson_ratio = 0.3
bending.flat.stiffness = 1e-5

[[hair]]
name = "fringe"
count = 2
segments = 5
length = 0.1
root = [0.0, -0.2, 0.0]
last_root = [0.02, -0.2, 0.0]
density = 1e-4
stretch_stiffness = 5.0
bend_stiffness = 1e-7

[[pins]]
nearest = [0.25, 0.25, 0.12]
motion = { keys = [{ time = 0.0 }, { time = 0.2, translate = [0.0, 0.0, 0.1] }] }

[[obstacles]]
sphere = { radius = 0.1 }
friction = 0.3

[wind]
velocity = [1.0, 0.5, 0.0]
"#;

/// Runs the program in a folder.
pub(crate) fn cloth(arguments: &[&str], folder: &Path) -> Output {
    Command::new(env!("CARGO_BIN_EXE_cloth")).args(arguments).current_dir(folder).output().unwrap()
}

/// Creates a folder with a scene.
pub(crate) fn with_scene(text: &str) -> TempDir {
    let folder = TempDir::new().unwrap();
    std::fs::write(folder.path().join("scene.toml"), text).unwrap();
    folder
}

pub(crate) fn succeeds(arguments: &[&str], folder: &Path) -> String {
    let output = cloth(arguments, folder);
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

pub(crate) fn refused(arguments: &[&str], folder: &Path) -> String {
    let output = cloth(arguments, folder);
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert!(!message.contains("panicked"), "{message}");
    message
}

pub(crate) fn read(folder: &Path, name: &str) -> Vec<u8> {
    std::fs::read(folder.join(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
}

/// The files of a run that have the same bytes each time.
pub(crate) const REPEATABLE: [&str; 9] = [
    "cloth.png",
    "cloth.glb",
    "cloth.usda",
    "ledger.csv",
    "measurements.csv",
    "ledger.svg",
    "frames/cloth_0000.obj",
    "frames/cloth_0007.obj",
    "frames/cloth_0015.obj",
];

/// Begins the run `half` of the scene in a folder, and kills it without notice once there is a checkpoint.
pub(crate) fn kill_after_first_checkpoint(folder: &Path) {
    let mut child = started(&["run", "scene.toml", "-o", "half", "--checkpoint", "4"], folder);
    let (start, checkpoint) = (Instant::now(), folder.join("half/checkpoint"));
    while !checkpoint.exists() {
        assert!(start.elapsed() < Duration::from_secs(120), "no checkpoint was written");
        std::thread::sleep(Duration::from_millis(1));
    }
    child.kill().unwrap();
    child.wait().unwrap();
}

/// A run that was killed after its first checkpoint.
fn killed_after_first_checkpoint(scene: &str) -> TempDir {
    let folder = with_scene(scene);
    kill_after_first_checkpoint(folder.path());
    folder
}

fn started(arguments: &[&str], folder: &Path) -> Child {
    Command::new(env!("CARGO_BIN_EXE_cloth"))
        .args(arguments)
        .current_dir(folder)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
}

#[test]
fn a_resumed_run_is_bit_identical() {
    for (integrator, adaptive) in
        [("newton", true), ("bdf2", false), ("implicit-euler", false), ("implicit-midpoint", true)]
    {
        let scene =
            SCENE.replace("integrator = \"newton\"", &format!("integrator = \"{integrator}\"\nadaptive = {adaptive}"));
        let folder = killed_after_first_checkpoint(&scene);
        succeeds(&["run", "scene.toml", "-o", "whole"], folder.path());
        let text = succeeds(&["resume", "half"], folder.path());
        assert!(text.contains("30 steps"), "{text}");
        for name in REPEATABLE {
            let [whole, half] = ["whole", "half"].map(|run| read(&folder.path().join(run), name));
            assert!(whole == half, "{integrator}: {name} differs");
        }
    }
}

#[test]
fn damaged_newer_and_foreign_checkpoints_are_rejected() {
    let folder = with_scene(&SCENE.replace("duration = 0.3", "duration = 0.1"));
    let path = folder.path();
    succeeds(&["run", "scene.toml", "-o", "out", "--checkpoint", "5"], path);
    let checkpoint = path.join("out/checkpoint");
    let good = std::fs::read(&checkpoint).unwrap();
    std::fs::remove_file(path.join("out/checkpoint.previous")).unwrap();
    let with = |bytes: &[u8]| {
        std::fs::write(&checkpoint, bytes).unwrap();
        refused(&["resume", "out"], path)
    };
    let mut flipped = good.clone();
    *flipped.last_mut().unwrap() ^= 1;
    assert!(with(&flipped).contains("is damaged: its checksum does not match"));
    assert!(with(&good[..good.len() / 2]).contains("is damaged: it is cut short"));
    let of_version = |version: &str| {
        String::from_utf8(good.clone()).unwrap().replacen(
            "cloth-checkpoint 5 ",
            &format!("cloth-checkpoint {version} "),
            1,
        )
    };
    assert!(
        with(of_version("6").as_bytes()).contains("has version 6, but this program reads version 5; use the newer")
    );
    assert!(
        with(of_version("4").as_bytes()).contains("has version 4, but this program reads version 5; start the run")
    );
    assert!(with(b"something else\n").contains("is not a checkpoint"));
    std::fs::write(&checkpoint, &good).unwrap();
    let frames = path.join("out/checkpoint.frames");
    let bytes = std::fs::read(&frames).unwrap();
    std::fs::write(&frames, &bytes[..bytes.len() - 30]).unwrap();
    assert!(refused(&["resume", "out"], path).contains("checkpoint.frames is damaged: it is cut short"));
    std::fs::write(&frames, &bytes).unwrap();
    succeeds(&["resume", "out"], path);
    // A mesh that has changed since.
    let square = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 1 3 4\n";
    std::fs::write(path.join("shape.obj"), square).unwrap();
    let sheet = "[garment.mesh.sheet]\ncells = [8, 8]\nsize = [0.5, 0.5]\n";
    let text = SCENE.replace("duration = 0.3", "duration = 0.05").replace(sheet, "mesh.obj.path = \"shape.obj\"\n");
    std::fs::write(path.join("obj.toml"), text).unwrap();
    succeeds(&["run", "obj.toml", "-o", "obj", "--checkpoint", "2"], path);
    std::fs::write(path.join("shape.obj"), square.replace("1 1 0", "1 2 0")).unwrap();
    assert!(refused(&["resume", "obj"], path).contains("shape.obj was edited since the run began"));
    let accepted = refused(&["resume", "obj", "--accept-edited"], path);
    assert!(accepted.contains("Did a mesh or material file change?"), "{accepted}");
    assert!(refused(&["resume", "elsewhere"], path).contains("was the run started with --checkpoint?"));
}

/// Whether the test itself ignores Ctrl-C, as in the background of a shell; programs that it starts then do, too.
#[cfg(unix)]
fn ignores_interrupts() -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| u64::from_str_radix(line.strip_prefix("SigIgn:")?.trim(), 16).ok());
    mask.is_some_and(|mask| mask >> 1 & 1 == 1)
}

#[cfg(unix)]
#[test]
fn an_interrupted_run_leaves_all_files_and_can_be_resumed() {
    if ignores_interrupts() {
        return;
    }
    let folder = with_scene(
        &SCENE
            .replace("duration = 0.3", "duration = 1000.0")
            .replace("frames_per_second = 50", "frames_per_second = 4"),
    );
    let child = started(&["run", "scene.toml", "-o", "out", "--checkpoint", "3"], folder.path());
    let start = Instant::now();
    while !folder.path().join("out/checkpoint").exists() {
        assert!(start.elapsed() < Duration::from_secs(120), "no checkpoint was written");
        std::thread::sleep(Duration::from_millis(5));
    }
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    let output = child.wait_with_output().unwrap();
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(130), "{message}");
    assert!(message.contains("of 100000; resume with `cloth resume out`"), "{message}");
    let out = folder.path().join("out");
    assert!(read(&out, "cloth.png").starts_with(b"\x89PNG") && read(&out, "cloth.glb").starts_with(b"glTF"));
    let record: serde_json::Value = serde_json::from_slice(&read(&out, "run.json")).unwrap();
    assert_eq!(record["finished"], false);
    assert!(std::fs::read_dir(&out).unwrap().all(|e| e.unwrap().path().extension().is_none_or(|end| end != "part")));
}

#[test]
fn a_folder_that_disappears_is_a_clear_error() {
    let folder = with_scene(&SCENE.replace("duration = 0.3", "duration = 100.0"));
    let child = started(&["run", "scene.toml", "-o", "out"], folder.path());
    let start = Instant::now();
    while !folder.path().join("out/frames/cloth_0003.obj").exists() {
        assert!(start.elapsed() < Duration::from_secs(120), "no frame was written");
        std::thread::sleep(Duration::from_millis(5));
    }
    std::fs::rename(folder.path().join("out"), folder.path().join("moved")).unwrap();
    let output = child.wait_with_output().unwrap();
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert!(message.contains("cannot write out/frames/cloth_") && message.contains("No such file"), "{message}");
    let frame = String::from_utf8(read(&folder.path().join("moved"), "frames/cloth_0003.obj")).unwrap();
    assert_eq!(frame.lines().filter(|line| line.starts_with("v ")).count(), 81 + 12);
}

#[cfg(target_os = "linux")]
#[test]
fn a_file_that_cannot_be_written_is_a_clear_error_and_leaves_no_partial_file() {
    let folder = with_scene(SCENE);
    // Files of at most 1 kB: writing more fails like on a full disk. By default, it would end the program.
    let command = format!("ulimit -f 1; exec {} run scene.toml -o out", env!("CARGO_BIN_EXE_cloth"));
    let output = Command::new("bash").args(["-c", &command]).current_dir(folder.path()).output().unwrap();
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert!(message.contains("cannot write out/frames/cloth_0000.obj: File too large"), "{message}");
    let names = std::fs::read_dir(folder.path().join("out/frames")).unwrap().count();
    assert_eq!(names, 0, "no partial file");
}

#[test]
fn usd_ply_and_obj_hold_the_same_frames() {
    let folder = with_scene(&format!("{SCENE}[output]\nply = true\n"));
    succeeds(&["run", "scene.toml", "-o", "out"], folder.path());
    let out = folder.path().join("out");
    let usd = String::from_utf8(read(&out, "cloth.usda")).unwrap();
    for part in [
        "#usda 1.0\n",
        "metersPerUnit = 1\n",
        "upAxis = \"Z\"\n",
        "timeCodesPerSecond = 50\n",
        "endTimeCode = 15\n",
        "def Mesh \"cloth\"",
        "def BasisCurves \"fringe\"",
        "def Mesh \"sphere_0\"",
    ] {
        assert!(usd.contains(part), "{part}");
    }
    // The points of the cloth in frame 15, in all three formats.
    let mesh = usd.split("def Mesh \"cloth\"").nth(1).unwrap();
    let samples = mesh.split("points.timeSamples = {").nth(1).unwrap().split('}').next().unwrap();
    let line = samples.lines().find(|line| line.trim_start().starts_with("15: [")).unwrap();
    let numbers = |text: &str| -> Vec<f64> {
        let words = text.split(|c: char| "[](), ".contains(c)).filter(|word| !word.is_empty());
        words.map(|word| word.parse().unwrap_or_else(|_| panic!("{word}"))).collect()
    };
    let from_usd = numbers(line.split_once(':').unwrap().1);
    let obj = String::from_utf8(read(&out, "frames/cloth_0015.obj")).unwrap();
    let from_obj: Vec<f64> = obj.lines().filter_map(|line| line.strip_prefix("v ")).flat_map(&numbers).collect();
    let ply = read(&out, "frames/cloth_0015.ply");
    let end = ply.windows(11).position(|window| window == b"end_header\n").unwrap() + 11;
    let single = |at: usize| f64::from(f32::from_le_bytes(ply[end + at..end + at + 4].try_into().unwrap()));
    assert_eq!((from_usd.len(), from_obj.len()), (3 * 81, 3 * 93));
    for (place, coordinate) in from_usd.iter().enumerate() {
        let from_ply = single(24 * (place / 3) + 4 * (place % 3));
        assert!((coordinate - from_obj[place]).abs() < 1e-6 && (coordinate - from_ply).abs() < 1e-6);
    }
    assert!(obj.lines().filter(|line| line.starts_with("l ")).count() == 2);
    let triangles = mesh.split("faceVertexIndices = [").nth(1).unwrap().split(']').next().unwrap();
    assert_eq!(numbers(triangles).len(), 3 * 128);
}

/// Needs `pip install usd-core pygltflib trimesh`; skipped without them.
#[test]
fn other_libraries_read_the_same_from_all_files() {
    let folder = with_scene(&format!("{SCENE}[output]\nply = true\n"));
    succeeds(&["run", "scene.toml", "-o", "out"], folder.path());
    let Some(said) = ask("python3", "read_back.py", &[&folder.path().join("out"), "cloth".as_ref()]) else { return };
    assert_eq!(said, "16 frames of 81 vertices, alike in USD, glTF, OBJ and PLY\n");
}

/// Needs node and its package gltf-validator, found through `NODE_PATH`; skipped without them.
#[test]
fn the_gltf_validator_finds_nothing() {
    let folder = with_scene(SCENE);
    succeeds(&["run", "scene.toml", "-o", "out"], folder.path());
    let Some(said) = ask("node", "validate_gltf.cjs", &[&folder.path().join("out/cloth.glb")]) else { return };
    assert_eq!(said, "0 errors, 0 warnings, 0 hints\n");
}

/// Skipped without the program ffmpeg.
#[test]
fn ffmpeg_makes_a_film() {
    let folder = with_scene(&format!("{SCENE}[output]\nmp4 = true\nsize = [64, 48]\n"));
    let told = succeeds(&["run", "scene.toml", "-o", "out"], folder.path());
    let film = folder.path().join("out/cloth.mp4");
    if !film.exists() {
        eprintln!("skipped: no ffmpeg");
        return;
    }
    assert!(told.contains("wrote out/cloth.mp4"), "{told}");
    assert_eq!(&std::fs::read(film).unwrap()[4..8], b"ftyp");
}

#[test]
fn only_the_requested_files_are_written() {
    let none = "[output]\npng = true\npicture = false\ngltf = false\nusd = false\nobj = false\nledger = false\n\
                measurements = false\n";
    let folder = with_scene(&format!("{}{none}", SCENE.replace("duration = 0.3", "duration = 0.02")));
    succeeds(&["run", "scene.toml", "-o", "out"], folder.path());
    let mut names: Vec<String> = std::fs::read_dir(folder.path().join("out"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    assert_eq!(names, ["frames", "run.json", "summary.txt"]);
    assert!(read(&folder.path().join("out"), "frames/cloth_0001.png").starts_with(b"\x89PNG"));
    assert_eq!(std::fs::read_dir(folder.path().join("out/frames")).unwrap().count(), 2);
}

#[test]
fn a_report_is_one_self_contained_page() {
    let folder = with_scene(SCENE);
    succeeds(&["run", "scene.toml", "-o", "out"], folder.path());
    let text = succeeds(&["report", "out"], folder.path());
    assert!(text.contains("wrote out/report.html"), "{text}");
    let page = String::from_utf8(read(&folder.path().join("out"), "report.html")).unwrap();
    for part in [
        "data:image/png;base64,",
        "data:image/svg+xml;base64,",
        "WindDrag",
        "SlidingFriction",
        "line search",
        "cloth: membrane",
        "passed",
    ] {
        assert!(page.contains(part), "{part}");
    }
    assert!(!page.contains("<script") && !page.contains("src=\"http") && !page.contains("href="), "it loads something");
    assert!(!page.contains(">failed<"), "an element failed its audit");
    assert!(refused(&["report", "nowhere"], folder.path()).contains("is this the folder of a finished run?"));
}

#[test]
fn stats_list_evaluations_per_term_also_in_the_summary() {
    let folder = with_scene(&SCENE.replace("duration = 0.3", "duration = 0.05"));
    let plain = succeeds(&["run", "scene.toml", "-o", "plain"], folder.path());
    assert!(!plain.contains("reused"), "{plain}");
    let text = succeeds(&["run", "scene.toml", "-o", "out", "--stats"], folder.path());
    let summary = String::from_utf8(read(&folder.path().join("out"), "summary.txt")).unwrap();
    for text in [text, summary] {
        let row = |name: &str| -> Vec<u64> {
            let row = text.lines().rfind(|line| line.trim_start().starts_with(name));
            let row = row.unwrap_or_else(|| panic!("{name}: {text}"));
            row.split_whitespace().filter_map(|word| word.parse().ok()).collect()
        };
        // Elements; then evaluated and skipped values, gradients and Hessians; flagged, projected, reused.
        let (membrane, bending) = (row("cloth: membrane"), row("cloth: bending"));
        assert_eq!((membrane.len(), membrane[0], membrane[9], bending[0]), (10, 128, 0, 176));
        assert!(membrane[5] > 5 * 128 && bending[5] < 2 * 176 && bending[9] > 5 * 176, "{membrane:?} {bending:?}");
        assert!(text.contains("\n1 island\n") && text.contains("assembly"), "{text}");
        let contact = text.lines().rfind(|line| line.trim_start().starts_with("friction of contact")).unwrap();
        assert_eq!(contact.matches('–').count(), 10, "nothing counts the elements of contact: {contact}");
    }
}

#[test]
fn the_schema_documents_keys_with_units() {
    let schema: serde_json::Value = serde_json::from_str(&succeeds(&["schema"], Path::new("."))).unwrap();
    let properties = schema["properties"].as_object().unwrap();
    for key in
        ["version", "garment", "hair", "seams", "pins", "obstacles", "wind", "output", "sleep", "dt", "mesh", "fabric"]
    {
        assert!(properties.contains_key(key), "{key}");
    }
    assert!(properties["dt"]["description"].as_str().unwrap().ends_with("in s."));
    assert_eq!(schema["additionalProperties"], false);
}

#[test]
fn a_sweep_runs_all_combinations_and_continues_where_it_was_killed() {
    let folder = with_scene(&SCENE.replace("duration = 0.3", "duration = 0.1"));
    let parameters = "obstacles.0.friction = [0.1, 0.3]\ngarment.0.fabric.density = [0.2, -1.0]\n";
    std::fs::write(folder.path().join("values.toml"), parameters).unwrap();
    let sweep = |output: &str| {
        let arguments = ["sweep", "scene.toml", "values.toml", "-o", output, "--jobs", "2", "--checkpoint", "2"];
        cloth(&arguments, folder.path())
    };
    let told = sweep("whole");
    assert!(!told.status.success(), "two of the runs have a negative density");
    assert!(String::from_utf8_lossy(&told.stdout).contains("4 runs, 2 failed"), "{told:?}");
    let index = String::from_utf8(read(&folder.path().join("whole"), "index.csv")).unwrap();
    let rows: Vec<Vec<&str>> = index.lines().map(|line| line.split(',').collect()).collect();
    assert_eq!(
        rows[0][..6],
        ["garment.0.fabric.density", "obstacles.0.friction", "folder", "status", "steps", "frames"]
    );
    let measured = rows[0].iter().position(|name| *name == "cloth warp mean").unwrap();
    assert!(rows[1][measured].parse::<f64>().unwrap().abs() > 1e-6, "{index}");
    assert_eq!((rows[0].len(), rows[3].last()), (rows[1].len(), Some(&"")), "a failed run has no measurements");
    let found: Vec<_> = rows[1..].iter().map(|row| (row[0], row[1], row[3], row[4])).collect();
    let done = [("0.2", "0.1", "done", "10"), ("0.2", "0.3", "done", "10")];
    assert_eq!(found, [&done[..], &[("-1.0", "0.1", "failed", ""), ("-1.0", "0.3", "failed", "")]].concat());
    assert!(index.contains("expected a finite number greater than 0, got -1: density = -1.0"), "{index}");

    // One run that was killed after its first checkpoint, one that never began.
    let name = rows[1][2];
    let run = folder.path().join("again").join(name);
    let text = read(&folder.path().join("whole").join(name), "run.json");
    let record: serde_json::Value = serde_json::from_slice(&text).unwrap();
    std::fs::write(folder.path().join("one.toml"), record["scene"].as_str().unwrap()).unwrap();
    std::fs::create_dir(folder.path().join("again")).unwrap();
    let arguments = ["run", "one.toml", "-o", run.to_str().unwrap(), "--checkpoint", "2"];
    let mut process = started(&arguments, folder.path());
    while !run.join("checkpoint").exists() && process.try_wait().unwrap().is_none() {
        std::thread::sleep(Duration::from_millis(1));
    }
    let _ = process.kill();
    process.wait().unwrap();
    assert!(!sweep("again").status.success());
    assert_eq!(read(&folder.path().join("again"), "index.csv"), index.as_bytes());
    for row in &rows[1..3] {
        let of = |output: &str| read(&folder.path().join(output).join(row[2]), "cloth.usda");
        assert_eq!(of("again"), of("whole"));
    }

    std::fs::write(folder.path().join("values.toml"), "obstacles.1.friction = [0.1]").unwrap();
    let message = refused(&["sweep", "scene.toml", "values.toml", "-o", "wrong"], folder.path());
    assert!(message.contains("obstacles.1.friction: expected one of the 1 places of `obstacles`"), "{message}");
    std::fs::write(folder.path().join("values.toml"), "dt = 0.1").unwrap();
    let message = refused(&["sweep", "scene.toml", "values.toml", "-o", "wrong"], folder.path());
    assert!(message.contains("dt: expected a list of values"), "{message}");
}

#[test]
fn a_sweep_after_an_edit_of_a_mesh_does_not_return_earlier_results() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    let scene = "dt = 0.01\nduration = 0.05\nmesh.obj.path = \"tent.obj\"\npins = [{ vertex = 0 }]\n\
                 output = { picture = false, gltf = false }\n\
                 fabric = { density = 0.15, material.stvk = { stretch_stiffness = 50.0, poisson_ratio = 0.3 } }\n";
    write("scene.toml", scene);
    write("values.toml", "fabric.density = [0.1]");
    let index = |height: f64, output: &str| {
        write("tent.obj", &format!("v 0 0 {height}\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\nf 2 4 3\n"));
        succeeds(&["sweep", "scene.toml", "values.toml", "-o", output], folder.path());
        read(&folder.path().join(output), "index.csv")
    };
    let first = index(0.3, "runs");
    let second = index(0.6, "runs");
    assert_ne!(first, second);
    assert_eq!(second, index(0.6, "fresh"));
    assert_eq!(first, index(0.3, "runs"), "the first mesh has its results still");
}
