//! The family of scenes in `scenes/family`, and the figures that its runner takes.
#![cfg(target_os = "linux")]

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use cloth_core::Simulation;
use cloth_core::scene::Scene;
use tempfile::TempDir;

use crate::runs::with_scene;

fn scenes() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes")
}

/// Runs a script of the family; `None`, with the reason on standard error, without Python.
fn family(script: &str, arguments: &[&str]) -> Option<Output> {
    let told = Command::new("python3").arg(scenes().join("family").join(script)).args(arguments).output();
    told.map_err(|error| eprintln!("skipped: no python3 ({error})")).ok()
}

fn cloth(arguments: &[&str], folder: &Path) -> Output {
    Command::new(env!("CARGO_BIN_EXE_cloth")).args(arguments).current_dir(folder).output().unwrap()
}

#[test]
fn no_member_of_the_family_is_refused_ends_early_or_crosses_itself() {
    let folder = TempDir::new().unwrap();
    let output = folder.path().to_str().unwrap();
    // All 42 pairs of garments and motions.
    let sample = ["--sample", "42", "--seed", "7", "--vertices", "60", "--duration", "0.05", "-o", output];
    let Some(told) = family("run.py", &[&sample[..], &["--program", env!("CARGO_BIN_EXE_cloth")]].concat()) else {
        return;
    };
    let (said, also) = (String::from_utf8_lossy(&told.stdout), String::from_utf8_lossy(&told.stderr));
    assert!(told.status.success() && said.contains("42 scenes, 0 with a fault"), "{said}{also}");
    let rows: Vec<serde_json::Value> =
        serde_json::from_str(&std::fs::read_to_string(folder.path().join("family.json")).unwrap()).unwrap();
    let figure = |row: &serde_json::Value, name: &str| row[name].as_f64().unwrap();
    assert_eq!(rows.len(), 42);
    for row in &rows {
        assert!(figure(row, "steps") == 5.0 && figure(row, "solves/step") >= 1.0, "{row}");
        // The first iterate is evaluated, too.
        assert!(figure(row, "energies/step") >= figure(row, "solves/step"), "{row}");
    }
    // A process that waits for its turn may count in any phase.
    let mut others: Vec<f64> = rows.iter().map(|row| figure(row, "other %")).collect();
    others.sort_by(f64::total_cmp);
    assert!(others[31] < 5.0 && others[0] >= 0.0, "{others:?}");
    let plot = std::fs::read_to_string(folder.path().join("family.svg")).unwrap();
    assert!(plot.contains("preparation") && plot.matches("<text").count() > 80, "{plot}");
}

#[test]
fn a_seed_gives_the_same_scenes_and_a_program_that_fails_is_a_fault() {
    let [first, second] = [(); 2].map(|()| TempDir::new().unwrap());
    for folder in [&first, &second] {
        let sample = ["--sample", "3", "--seed", "5", "--vertices", "60", "-o", folder.path().to_str().unwrap()];
        let Some(made) = family("make.py", &sample) else { return };
        assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
    }
    for one in std::fs::read_dir(first.path()).unwrap() {
        let name = one.unwrap().file_name();
        let text = |folder: &TempDir| std::fs::read(folder.path().join(&name).join("scene.toml")).unwrap();
        assert_eq!(text(&first), text(&second), "{name:?}");
    }
    let sample = ["--sample", "1", "--vertices", "60", "--program", "false", "-o", first.path().to_str().unwrap()];
    let told = family("run.py", &sample).unwrap();
    assert_eq!(told.status.code(), Some(1), "{}", String::from_utf8_lossy(&told.stdout));
}

const SHEET: &str = "dt = 0.01\nduration = 0.2\nintegrator = \"newton\"\ntolerances.velocity = 1e-3\n\
                     fabric = \"single-jersey\"\nmesh.sheet = { cells = [6, 6], size = [0.3, 0.3] }\n\
                     pins = [{ vertex = 0 }]\n\
                     obstacles = [{ sphere = { centre = [0.05, 0.0, -0.12], radius = 0.1 }, friction = 0.3 }]\n";

#[test]
fn the_local_error_of_a_scene_falls_with_its_step() {
    // Contact is not smooth; a sheet that swings is.
    let swinging = SHEET.split("obstacles").next().unwrap();
    let folder = with_scene(swinging);
    std::fs::write(folder.path().join("half.toml"), swinging.replace("dt = 0.01", "dt = 0.005")).unwrap();
    let measured = |scene: &str| -> serde_json::Value {
        let told = cloth(&["bench", "--error", scene, "--json", "--threads", "1"], folder.path());
        assert!(told.status.success(), "{}", String::from_utf8_lossy(&told.stderr));
        serde_json::from_slice(&told.stdout).unwrap()
    };
    let [whole, half] = ["scene.toml", "half.toml"].map(measured);
    let starts: Vec<f64> = whole["windows"].as_array().unwrap().iter().map(|w| w["start"].as_f64().unwrap()).collect();
    assert_eq!(starts, [0.0, 0.02, 0.04, 0.06, 0.08, 0.1]);
    let rms = |error: &serde_json::Value| error["rms"].as_f64().unwrap();
    let order = (rms(&whole) / rms(&half)).log2();
    // Implicit Euler is of first order.
    assert!((0.7..1.3).contains(&order) && rms(&whole) < whole["largest"].as_f64().unwrap(), "{order}: {whole} {half}");
    assert!(whole["solves_per_second"].as_f64() > Some(100.0), "{whole}");
    let table = cloth(&["bench", "--error", "scene.toml"], folder.path());
    let table = String::from_utf8(table.stdout).unwrap();
    assert!(table.contains("largest, mm") && table.contains("per simulated second"), "{table}");
    let refused = cloth(&["bench", "scene.toml"], folder.path());
    assert_eq!(refused.status.code(), Some(2), "{}", String::from_utf8_lossy(&refused.stderr));
}

/// Pins, an obstacle that moves and friction go on as they were.
#[test]
fn a_state_goes_on_in_a_simulation_with_another_step() {
    let moving = SHEET.replace(
        "friction = 0.3 }",
        "friction = 0.3, motion.keys = [{ time = 0.0 }, { time = 0.2, translate = [0.0, 0.1, 0.1] }] }",
    );
    let moving = moving.replace("tolerances.velocity = 1e-3", "tolerances.velocity = 1e-6");
    let scene = |step: f64| Scene::parse(&moving.replace("dt = 0.01", &format!("dt = {step}")), "s.toml".as_ref());
    let [mut fine, mut same, mut coarse] =
        [0.001, 0.001, 0.002].map(|step| Simulation::new(&scene(step).unwrap()).unwrap());
    let go = |simulation: &mut Simulation, steps: usize| (0..steps).for_each(|_| assert!(simulation.step().is_ok()));
    go(&mut fine, 100);
    same.restore(fine.save().after_other_steps(100)).unwrap();
    coarse.restore(fine.save().after_other_steps(50)).unwrap();
    assert!((coarse.time() - fine.time()).abs() < 1e-12 && coarse.positions() == fine.positions());
    go(&mut fine, 20);
    go(&mut same, 20);
    go(&mut coarse, 10);
    let distance = |other: &Simulation| {
        let apart = |(x, y): (&[f64; 3], &[f64; 3])| (0..3).map(|axis| (x[axis] - y[axis]).abs()).fold(0.0, f64::max);
        fine.positions().iter().zip(other.positions()).map(apart).fold(0.0, f64::max)
    };
    // Only the first iterates differ with the same step.
    assert!(distance(&same) < 1e-6, "{:e}", distance(&same));
    assert!((1e-6..2e-3).contains(&distance(&coarse)), "{:e}", distance(&coarse));
}

#[test]
fn frames_are_checked_for_crossings() {
    // Two sheets that pass through each other: nothing collides.
    let sheet = |name: &str, turn: &str| {
        format!(
            "[[garment]]\nname = \"{name}\"\nfabric = \"denim\"\nmesh.sheet = {{ cells = [3, 3], size = [0.2, 0.2] \
                 }}\n{turn}"
        )
    };
    let turn = "placement.rotate = { axis = [1.0, 0.0, 0.0], angle = 80.0 }\n";
    let head = "dt = 0.01\nduration = 0.08\nframes_per_second = 25\nintegrator = \"newton\"\ncontact = \"off\"\n";
    let folder = with_scene(&format!("{head}{}{}", sheet("flat", ""), sheet("upright", turn)));
    let told = cloth(&["run", "scene.toml", "-o", "out", "--check-crossings", "--checkpoint", "4"], folder.path());
    let summary = String::from_utf8_lossy(&told.stdout);
    assert!(told.status.success() && summary.contains("there are crossings in 3 of 3 checked frames"), "{summary}");
    let told = cloth(&["run", "scene.toml", "-o", "plain", "--stats"], folder.path());
    assert!(!String::from_utf8_lossy(&told.stdout).contains("checked frames"));
}

/// The sense of a fold differs between neighbours with opposite fronts.
#[test]
fn neighbours_with_opposite_fronts_are_refused_by_name() {
    let text = "dt = 0.01\nduration = 0.1\nintegrator = \"newton\"\nmesh.obj.path = \"turned.obj\"\n";
    let folder = with_scene(&format!("{text}fabric = \"denim\"\n"));
    let obj = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 1 4 3\n";
    std::fs::write(folder.path().join("turned.obj"), obj).unwrap();
    let told = cloth(&["run", "scene.toml", "-o", "out"], folder.path());
    let message = String::from_utf8_lossy(&told.stderr);
    let expected = "triangles 0 and 1 are neighbours with opposite fronts";
    assert!(told.status.code() == Some(1) && message.contains(expected), "{message}");
}
