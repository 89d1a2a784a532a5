//! The binary from outside: output files and errors.

use std::path::Path;
use std::process::{Command, Output};

use tempfile::TempDir;

const SCENE: &str = r#"dt = 0.01
duration = 0.1
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
"#;

fn cloth(arguments: &[&str], folder: &Path) -> Output {
    Command::new(env!("CARGO_BIN_EXE_cloth")).args(arguments).current_dir(folder).output().unwrap()
}

/// Runs a scene that must be rejected, and returns the message.
fn refused(text: &str, files: &[(&str, &str)]) -> String {
    let folder = TempDir::new().unwrap();
    std::fs::write(folder.path().join("scene.toml"), text).unwrap();
    for (name, contents) in files {
        std::fs::write(folder.path().join(name), contents).unwrap();
    }
    let output = cloth(&["run", "scene.toml", "-o", "out"], folder.path());
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert!(!message.contains("panicked"), "{message}");
    assert!(!folder.path().join("out/cloth.png").exists());
    message
}

fn refused_obj(obj: &str) -> String {
    let sheet = "[mesh.sheet]\ncells = [6, 6]\nsize = [1.0, 1.0]\n";
    refused(&SCENE.replace(sheet, "[mesh.obj]\npath = \"shape.obj\"\n"), &[("shape.obj", obj)])
}

#[test]
fn a_run_writes_a_picture_animations_and_frames() {
    let folder = TempDir::new().unwrap();
    std::fs::write(folder.path().join("scene.toml"), SCENE).unwrap();
    let output = cloth(&["run", "scene.toml", "-o", "out"], folder.path());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout).unwrap();
    for part in ["10 steps", "membrane", "StVK", "left out: bending: zero", "kinetic energy", "wrote 6 frames"] {
        assert!(text.contains(part), "{part}: {text}");
    }
    let read = |name: &str| std::fs::read(folder.path().join("out").join(name)).unwrap();
    assert!(read("cloth.png").starts_with(b"\x89PNG"));
    assert!(String::from_utf8(read("summary.txt")).unwrap().contains("10 steps"));
    let last = String::from_utf8(read("frames/cloth_0005.obj")).unwrap();
    assert_eq!(last.lines().filter(|line| line.starts_with("v ")).count(), 49);
    assert_eq!(last.lines().filter(|line| line.starts_with("f ")).count(), 72);
    assert_ne!(read("frames/cloth_0000.obj"), read("frames/cloth_0005.obj"));
    let names: Vec<_> = std::fs::read_dir(folder.path().join("out")).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(names.len(), 9, "nothing temporary is left: {names:?}");

    // A second run is rejected without --overwrite; with it, no frame of the first remains.
    let again = cloth(&["run", "scene.toml", "-o", "out"], folder.path());
    assert_eq!(again.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&again.stderr).contains("pass --overwrite"));
    std::fs::write(folder.path().join("scene.toml"), SCENE.replace("duration = 0.1", "duration = 0.02")).unwrap();
    assert!(cloth(&["run", "scene.toml", "-o", "out", "--overwrite"], folder.path()).status.success());
    assert_eq!(std::fs::read_dir(folder.path().join("out/frames")).unwrap().count(), 2);
}

#[test]
fn the_demonstration_audits_simulates_and_repeats() {
    let folder = TempDir::new().unwrap();
    for _ in 0..2 {
        let output = cloth(&["demo"], folder.path());
        let text = String::from_utf8(output.stdout).unwrap();
        assert!(output.status.success(), "{text}{}", String::from_utf8_lossy(&output.stderr));
        assert!(text.starts_with("audit of 5 elements") && text.contains("150 steps"), "{text}");
    }
    // 1.5 s at 25 frames per second, and the initial frame.
    assert_eq!(std::fs::read_dir(folder.path().join("out/frames")).unwrap().count(), 38);
}

#[test]
fn the_animation_is_a_valid_glb_file() {
    let folder = TempDir::new().unwrap();
    std::fs::write(folder.path().join("scene.toml"), SCENE).unwrap();
    assert!(cloth(&["run", "scene.toml", "-o", "out"], folder.path()).status.success());
    let file = std::fs::read(folder.path().join("out/cloth.glb")).unwrap();
    let word = |at: usize| u32::from_le_bytes(file[at..at + 4].try_into().unwrap()) as usize;
    assert_eq!((&file[..4], word(4), word(8)), (&b"glTF"[..], 2, file.len()));
    let json_length = word(12);
    let data = 20 + json_length + 8;
    assert_eq!((word(20 + json_length), file.len()), (file.len() - data, data + word(20 + json_length)));
    let root = gltf_json::Root::from_slice(&file[20..20 + json_length]).unwrap();
    let mut problems = Vec::new();
    use gltf_json::validation::Validate;
    root.validate(&root, gltf_json::Path::new, &mut |path, error| problems.push(format!("{} {error}", path())));
    assert!(problems.is_empty(), "{problems:?}");
    let primitive = &root.meshes[0].primitives[0];
    assert_eq!(primitive.targets.as_ref().unwrap().len(), 5);
    // The last morph target moves the free corner (vertex 6 of 49) down, which is −y in glTF.
    let accessor = primitive.targets.as_ref().unwrap()[4].positions.unwrap();
    let view = &root.buffer_views[root.accessors[accessor.value()].buffer_view.unwrap().value()];
    let y = data + view.byte_offset.unwrap().0 as usize + 12 * 6 + 4;
    assert!(f32::from_le_bytes(file[y..y + 4].try_into().unwrap()) < -0.02);
}

#[test]
fn invalid_scenes_are_rejected_with_place_and_reason() {
    let expect = |from: &str, to: &str, parts: &[&str]| {
        assert!(SCENE.contains(from));
        let message = refused(&SCENE.replace(from, to), &[]);
        assert!(parts.iter().all(|part| message.contains(part)), "{message}");
    };
    expect("density", "densty", &["scene.toml:10:1", "unknown field `densty`", "did you mean `density`?"]);
    expect("dt = 0.01", "dt = nan", &["scene.toml:1:6", "expected a finite number greater than 0, got NaN"]);
    expect("50.0", "-50.0", &["scene.toml:13:21", "expected a finite number of at least 0, got -50"]);
    expect("nearest = [-0.5, 0.5, 0.0]", "vertex = 99", &["pins[0]: there is no vertex 99"]);
    expect("duration = 0.1", "duration = 0.1\nduration = 0.2", &["scene.toml:3:1", "duplicate"]);
    let obj = "[mesh.obj]\npath = \"missing.obj\"";
    expect("[mesh.sheet]\ncells = [6, 6]\nsize = [1.0, 1.0]", obj, &["cannot read missing.obj", "No such file"]);
}

#[test]
fn invalid_meshes_are_rejected_with_line_and_reason() {
    let square = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";
    let expect = |obj: &str, part: &str| {
        let message = refused_obj(obj);
        assert!(message.contains(part), "{message}");
    };
    expect("", "shape.obj: the mesh has 0 vertices and 0 triangles");
    expect(&format!("{square}f 1 2 3\nf 1 3 7\n"), "shape.obj:6: the face refers to a vertex");
    expect(&format!("{square}f 1 2 3\nf 1 3 4\nf 3 1 2\n"), "shape.obj:7: edge 0–2 is shared by 3 triangles");
    expect(&square.replace("1 1 0", "1 nan 0"), "shape.obj");
    expect(&format!("{}f 1 2 3\nf 1 3 4\n", square.replace("1 1 0", "1 nan 0")), "shape.obj:3: vertex 2 is not finite");
    expect(&format!("{square}f 1 2 3\nf 1 3 3\n"), "shape.obj:6: triangle 1 (vertices [0, 2, 2]) has no area");
    expect(&format!("{square}f 1 2\n"), "shape.obj:5: a face needs at least three corners, got 2: `f 1 2`");
}

#[test]
fn missing_scenes_and_unwritable_folders_are_rejected() {
    let folder = TempDir::new().unwrap();
    let message = |arguments: &[&str]| {
        let output = cloth(arguments, folder.path());
        assert_eq!(output.status.code(), Some(1));
        String::from_utf8(output.stderr).unwrap()
    };
    let missing = message(&["run", "nothing.toml", "-o", "out"]);
    assert!(missing.contains("cannot read the scene nothing.toml") && missing.contains("No such file"), "{missing}");
    assert!(!folder.path().join("out").exists(), "nothing is made for a scene that does not exist");

    // A file in place of the folder: not even root can write into it.
    std::fs::write(folder.path().join("taken"), "").unwrap();
    std::fs::write(folder.path().join("scene.toml"), SCENE).unwrap();
    let taken = message(&["run", "scene.toml", "-o", "taken"]);
    assert!(taken.contains("cannot write to the folder taken; choose another with -o"), "{taken}");
}

#[cfg(unix)]
#[test]
fn read_only_folders_are_rejected() {
    use std::os::unix::fs::PermissionsExt;
    let folder = TempDir::new().unwrap();
    std::fs::write(folder.path().join("scene.toml"), SCENE).unwrap();
    let locked = folder.path().join("locked");
    std::fs::create_dir(&locked).unwrap();
    std::fs::set_permissions(&locked, std::fs::Permissions::from_mode(0o555)).unwrap();
    if std::fs::write(locked.join("probe"), "").is_ok() {
        return; // root may write anywhere: nothing to test
    }
    let output = cloth(&["run", "scene.toml", "-o", "locked"], folder.path());
    assert_eq!(output.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&output.stderr).contains("cannot write to the folder locked"));
}

#[test]
fn materials_are_listed_with_formula_units_and_costs() {
    let output = cloth(&["materials"], Path::new("."));
    let text = String::from_utf8(output.stdout).unwrap();
    for part in ["StVK (energy)", "Spring (constraint)", "BridsonForceDamped (force)", "K [N/m]", "operations"] {
        assert!(text.contains(part), "{part}");
    }
}

#[test]
fn each_run_of_the_benchmark_measures_its_own_memory() {
    let folder = TempDir::new().unwrap();
    let sizes = ["bench", "--sizes", "65,5", "--cloth", "soft", "--threads", "1", "--seconds", "0.02"];
    let json = cloth(&[&sizes[..], &["--json"]].concat(), folder.path());
    let runs: Vec<serde_json::Value> = serde_json::from_slice(&json.stdout).unwrap();
    let of = |name: &str| runs.iter().map(|run| run[name].as_u64()).collect::<Vec<_>>();
    assert_eq!((of("vertices"), of("steps")), (vec![Some(4225), Some(25)], vec![Some(2), Some(2)]));
    // A second run in the same process would report the memory of the first.
    if let [Some(large), Some(small)] = of("peak_memory")[..] {
        assert!(small < large, "{small} {large}");
    }
    let table = String::from_utf8(cloth(&sizes, folder.path()).stdout).unwrap();
    assert!(table.contains("4225") && table.contains("ms/step"), "{table}");
}

#[test]
fn the_benchmark_tells_what_contact_costs() {
    let folder = TempDir::new().unwrap();
    let sizes = ["bench", "--sizes", "9", "--cloth", "cotton", "--threads", "1", "--seconds", "0.02"];
    let arguments = [&sizes[..], &["--contact", "off,on"]].concat();
    let json = cloth(&[&arguments[..], &["--json"]].concat(), folder.path());
    let runs: Vec<serde_json::Value> = serde_json::from_slice(&json.stdout).unwrap();
    let of = |pointer: &str| runs.iter().map(|run| run.pointer(pointer).cloned()).collect::<Vec<_>>();
    assert_eq!(of("/contact"), [Some(false.into()), Some(true.into())]);
    // Nothing touches, so no search finds anything.
    assert_eq!(of("/lowest")[0], of("/lowest")[1]);
    assert_eq!(of("/report/contact/candidates"), [Some(0.into()), Some(0.into())]);
    assert_eq!(of("/report/contact/clear"), of("/report/contact/searches"));
    assert!(of("/report/contact/moves")[1].as_ref().is_some_and(|moves| moves.as_u64() > Some(0)), "{runs:?}");
    let table = String::from_utf8(cloth(&arguments, folder.path()).stdout).unwrap();
    assert!(table.contains("of no contact") && table.contains("× "), "{table}");
}

#[test]
fn a_dry_run_tells_size_memory_and_time_and_writes_nothing() {
    let folder = TempDir::new().unwrap();
    std::fs::write(folder.path().join("scene.toml"), SCENE).unwrap();
    let output = cloth(&["run", "scene.toml", "--dry-run"], folder.path());
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(output.status.success(), "{text}");
    for part in ["49 vertices (1 pinned), 72 triangles", "10 steps, 6 frames", "memory: about 0.00 GB", "time: about "]
    {
        assert!(text.contains(part), "{part}: {text}");
    }
    let output = cloth(&["run", "scene.toml", "--dry-run", "--log", "json", "-o", "out"], folder.path());
    let forecast: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((&forecast["vertices"], &forecast["steps"], &forecast["failure"]), (&49.into(), &10.into(), &().into()));
    assert!(forecast["seconds"].as_f64().unwrap() > 0.0 && !folder.path().join("out").exists());
    let without = cloth(&["run", "scene.toml"], folder.path());
    assert_eq!(without.status.code(), Some(2), "only a dry run needs no folder");
}

#[test]
fn json_logs_are_objects_line_by_line_and_the_last_tells_how_the_run_ended() {
    let folder = TempDir::new().unwrap();
    std::fs::write(folder.path().join("scene.toml"), SCENE).unwrap();
    let output = cloth(&["run", "scene.toml", "-o", "out", "--log", "json"], folder.path());
    let lines = String::from_utf8(output.stdout).unwrap();
    let events: Vec<serde_json::Value> = lines.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let last_step = events.iter().rfind(|event| event["event"] == "step").unwrap();
    assert_eq!((&last_step["step"], &last_step["steps"]), (&10.into(), &10.into()));
    let end = events.last().unwrap();
    assert!(end["event"] == "end" && end["finished"] == true && end["frames"] == 6, "{end}");
    let usd = end["files"].as_array().unwrap().iter().any(|file| file.as_str().unwrap().ends_with("cloth.usda"));
    assert!(usd && output.stderr.is_empty(), "{end}");
}

#[test]
fn completions_and_manual_pages_name_the_subcommands() {
    let folder = TempDir::new().unwrap();
    let script = String::from_utf8(cloth(&["completions", "bash"], folder.path()).stdout).unwrap();
    assert!(script.contains("--dry-run") && script.contains("complete -F _cloth"), "{script}");
    let page = String::from_utf8(cloth(&["man"], folder.path()).stdout).unwrap();
    assert!(page.contains(".TH cloth 1") && page.contains("Exit status"), "{page}");
    assert!(cloth(&["man", "-o", "pages"], folder.path()).status.success());
    let pages = std::fs::read_dir(folder.path().join("pages")).unwrap().count();
    assert!(pages > 12, "{pages}");
    let run = std::fs::read_to_string(folder.path().join("pages/cloth-run.1")).unwrap();
    assert!(run.contains(".TH cloth-run 1") && run.contains("dry\\-run"), "{run}");
}

#[test]
fn shallow_crossings_are_named_and_repaired_on_request() {
    let fabric = "fabric = { density = 0.2, thickness = 1e-3, material.stvk = \
                  { stretch_stiffness = 40.0, poisson_ratio = 0.3 } }";
    let sheet = "mesh.sheet = { cells = [5, 5], size = [0.1, 0.1] }";
    let scene = format!(
        "dt = 0.01\nduration = 0.02\nintegrator = \"newton\"\n[[garment]]\n{sheet}\n{fabric}\n\
         [[garment]]\n{sheet}\n{fabric}\nplacement.translate = [0.003, 0.002, 0.0]\n\
         placement.rotate = {{ axis = [0.0, 1.0, 0.0], angle = 1.0 }}\n"
    );
    let message = refused(&scene, &[]);
    assert!(message.contains("goes through the triangle") && message.contains("`--untangle`"), "{message}");
    let folder = TempDir::new().unwrap();
    std::fs::write(folder.path().join("scene.toml"), scene).unwrap();
    let output = cloth(&["run", "scene.toml", "-o", "out", "--untangle"], folder.path());
    let [report, errors] = [output.stdout, output.stderr].map(|text| String::from_utf8(text).unwrap());
    assert!(output.status.success(), "{report}{errors}");
    assert!((report + &errors).contains("vertices moved by up to"), "the moves are reported");
}
