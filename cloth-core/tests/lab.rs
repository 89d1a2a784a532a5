//! `cloth measure` and `cloth test` from outside: known answers, and what happens to interrupted and wrong ones.

use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::Duration;

use serde_json::Value;
use tempfile::TempDir;

/// A fabric with straight laws: 700 N/m along both threads, 30 N/m in shear, 8 µN m in bending.
const FABRIC: &str = "[fabric]\ndensity = 0.15\n[fabric.material.baraff-witkin]\nstretch = 700.0\nshear = 30.0\n\
                      bending.plate.isotropic = { young_modulus = 96e6, thickness = 1e-4, poisson_ratio = 0.0 }\n";

const STRIP: &str = "dt = 0.02\nduration = 1.0\nfrequency\nintegrator = \"newton\"\ncontact = \"off\"\n\
                     gravity = [0.0, 0.0, 0.0]\ntolerances.velocity = 1e-7\n\
                     [[garment]]\nname = \"strip\"\nmesh.sheet = { cells = [10, 5], size = [0.2, 0.1] }\n\
                     fabric = { density = 0.2, material.stvk = { stretch_stiffness = 100.0, poisson_ratio = 0.0 } }\n\
                     [[pins]]\nname = \"left\"\nbox = { min = [-0.11, -1.0, -1.0], max = [-0.09, 1.0, 1.0] }\n\
                     [[pins]]\nname = \"right\"\nbox = { min = [0.09, -1.0, -1.0], max = [0.11, 1.0, 1.0] }\n\
                     motion.keys = [{ time = 0.0 }, { time = 1.0, translate = [0.02, 0.0, 0.0] }]\n";

fn cloth(arguments: &[&str], folder: &Path) -> Output {
    Command::new(env!("CARGO_BIN_EXE_cloth")).args(arguments).current_dir(folder).output().unwrap()
}

fn succeeds(arguments: &[&str], folder: &Path) -> String {
    let output = cloth(arguments, folder);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

fn refused(arguments: &[&str], folder: &Path) -> String {
    let output = cloth(arguments, folder);
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert!(!message.contains("panicked"), "{message}");
    message
}

fn strip() -> TempDir {
    let folder = TempDir::new().unwrap();
    std::fs::write(folder.path().join("strip.toml"), STRIP.replace("frequency", "frames_per_second = 10")).unwrap();
    folder
}

#[test]
fn a_run_its_scene_and_its_last_mesh_have_the_same_measurements() {
    let folder = strip();
    succeeds(&["run", "strip.toml", "-o", "out"], folder.path());
    let of = |measured: &str| -> Value {
        serde_json::from_str(&succeeds(&["measure", measured, "--json"], folder.path())).unwrap()
    };
    let (run, scene) = (of("out"), of("strip.toml"));
    assert_eq!(run["measurements"], scene["measurements"]);
    // Frames have nine digits.
    for quantity in ["warp", "weft"] {
        let of = |survey: &Value| survey["garments"][0]["strain"][quantity]["mean"].as_f64().unwrap();
        assert!((of(&run) - of(&scene)).abs() < 1e-7, "{quantity}");
    }
    // Without coupling the strip stretches uniformly: P = Y (ε + ε²/2)(1 + ε).
    let last = &run["pull"]["points"][10];
    let expected = 0.1 * 100.0 * 0.105 * 1.1;
    assert!((last["force"].as_f64().unwrap() / expected - 1.0).abs() < 1e-3, "{last}");
    assert!((last["strain"].as_f64().unwrap() - 0.1).abs() < 1e-12, "{last}");
    let warp = &run["garments"][0]["strain"]["warp"];
    for statistic in ["mean", "largest", "low", "high"] {
        assert!((warp[statistic].as_f64().unwrap() - 0.1).abs() < 1e-3, "{warp}");
    }
    // The shadow of the mesh is that of the run.
    let mesh = of("out/frames/cloth_0010.obj");
    let area = |survey: &Value| survey["garments"][0]["drape"]["area"].as_f64().unwrap();
    assert!((area(&mesh) / area(&run) - 1.0).abs() < 1e-9 && (area(&run) / 0.022 - 1.0).abs() < 1e-3);
    let table = succeeds(&["measure", "out"], folder.path());
    assert!(table.contains("between group left and group right, 200.00 mm apart at the start"), "{table}");
    // The record and the table of the run hold the same.
    let csv = std::fs::read_to_string(folder.path().join("out/measurements.csv")).unwrap();
    let rows: Vec<Vec<&str>> = csv.lines().map(|line| line.split(',').collect()).collect();
    let column = rows[0].iter().position(|name| *name == "group right Fx [N]").unwrap();
    let force: f64 = rows[11][column].parse().unwrap();
    assert_eq!(Some(force), run["measurements"]["readings"][10]["pins"][1]["force"][0].as_f64());
    for (arguments, part) in [
        (&["measure", "out", "--garment", "sleeve"][..], "there is no garment called `sleeve`; there are strip"),
        (&["measure", "out", "--between", "left", "top"], "there is no pin or group `top`; there are pin 0, pin 1"),
        (&["measure", "out", "--disc", "0.2"], "strip: the disc of radius 0.2 m is not smaller than the specimen"),
        (&["measure", "nowhere"], "cannot read the scene nowhere"),
        (&["measure", "none.obj"], "none.obj"),
    ] {
        let message = refused(arguments, folder.path());
        assert!(message.contains(part), "{message}");
    }
}

#[test]
fn runs_without_frames_say_what_is_missing_and_those_with_ply_are_measured() {
    let folder = strip();
    let text = std::fs::read_to_string(folder.path().join("strip.toml")).unwrap();
    let output = "[output]\nobj = false\npicture = false\ngltf = false\nusd = false\n";
    std::fs::write(folder.path().join("bare.toml"), format!("{text}{output}")).unwrap();
    std::fs::write(folder.path().join("ply.toml"), format!("{text}{output}ply = true\n")).unwrap();
    succeeds(&["run", "bare.toml", "-o", "bare"], folder.path());
    let message = refused(&["measure", "bare"], folder.path());
    assert!(message.contains("was the run made with `output.obj = false`?"), "{message}");
    succeeds(&["run", "ply.toml", "-o", "ply"], folder.path());
    let table = succeeds(&["measure", "ply"], folder.path());
    assert!(table.contains("warp %"), "{table}");
    // A record of an earlier version has no readings.
    let record = folder.path().join("ply/run.json");
    let mut old: Value = serde_json::from_slice(&std::fs::read(&record).unwrap()).unwrap();
    old.as_object_mut().unwrap().remove("measurements");
    std::fs::write(&record, old.to_string()).unwrap();
    let table = succeeds(&["measure", "ply"], folder.path());
    assert!(table.contains("warp %") && !table.contains("on pins"), "{table}");
}

#[test]
fn a_fabric_with_straight_laws_has_its_own_numbers_and_a_killed_test_continues() {
    let folder = TempDir::new().unwrap();
    std::fs::write(folder.path().join("straight.toml"), FABRIC).unwrap();
    std::fs::write(folder.path().join("other.toml"), FABRIC.replace("700.0", "800.0")).unwrap();
    let test =
        |fabric: &'static str, output: &'static str| ["test", fabric, "-o", output, "--only", "tensile,bending,shear"];
    let table = succeeds(&test("straight.toml", "out"), folder.path());
    assert!(table.contains("EMT warp") && table.contains("in KES units"), "{table}");
    let read = |path: &str| std::fs::read(folder.path().join(path)).unwrap();
    let results: Value = serde_json::from_slice(&read("out/results.json")).unwrap();
    let number = |name: &str, kind: &str| {
        let outcomes = results["outcomes"].as_array().unwrap().iter();
        let mut all = outcomes.flat_map(|outcome| outcome["numbers"].as_array().unwrap());
        all.find(|number| number["name"] == name).unwrap()[kind].as_f64().unwrap()
    };
    // Free sides and the polygon cost a little; the input is exact.
    for (name, expected, by) in [
        ("EMT warp", 100.0 * 490.3325 / 700.0, 0.002),
        ("EMT weft", 100.0 * 490.3325 / 700.0, 0.002),
        ("LT warp", 1.0, 0.002),
        ("G", 30.0, 0.05),
        ("B warp", 8.0, 0.01),
        ("B weft", 8.0, 0.01),
    ] {
        let found = ["simulated", "input"].map(|kind| number(name, kind));
        assert!((found[0] / expected - 1.0).abs() < by, "{name}: {found:?}");
        assert!((found[1] / expected - 1.0).abs() < 0.03_f64.min(by), "{name}: {found:?}");
    }
    assert!(number("2HB warp", "simulated").abs() < 1e-3 && number("2HG", "simulated").abs() < 1e-2);

    // The same command once more runs nothing; another fabric is refused.
    let told = cloth(&test("straight.toml", "out"), folder.path());
    assert!(!String::from_utf8_lossy(&told.stderr).contains("step"), "{told:?}");
    let message = refused(&test("other.toml", "out"), folder.path());
    assert!(message.contains("holds a test of another fabric") && message.contains("--overwrite"), "{message}");

    // A killed test continues with the same results.
    let arguments = [&test("straight.toml", "again")[..], &["--checkpoint", "1"]].concat();
    let mut process = Command::new(env!("CARGO_BIN_EXE_cloth"))
        .args(&arguments)
        .current_dir(folder.path())
        .stderr(Stdio::null())
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    let checkpoint = folder.path().join("again/tensile-weft/checkpoint");
    while !checkpoint.exists() && process.try_wait().unwrap().is_none() {
        std::thread::sleep(Duration::from_millis(1));
    }
    process.kill().unwrap();
    process.wait().unwrap();
    succeeds(&arguments, folder.path());
    assert_eq!(read("again/results.json"), read("out/results.json"));
    for name in ["curves.csv", "tensile.svg", "shear.svg", "bending.svg", "tensile-weft/measurements.csv"] {
        assert_eq!(read(&format!("again/{name}")), read(&format!("out/{name}")), "{name}");
    }
}

#[test]
fn what_is_no_fabric_is_refused() {
    let folder = TempDir::new().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write("scene.toml", "dt = 0.01\n");
    write("broken.toml", "[fabric\n");
    write("thin.toml", &FABRIC.replace("0.15", "-0.15"));
    for (fabric, part) in [
        ("velvt", "unknown fabric `velvt`"),
        ("none.toml", "cannot read none.toml"),
        ("scene.toml", "scene.toml has no table `[fabric]`"),
        ("broken.toml", "broken.toml: "),
        ("thin.toml", "expected a finite number greater than 0, got -0.15"),
    ] {
        let message = refused(&["test", fabric, "-o", "out"], folder.path());
        assert!(message.contains(part), "{message}");
        assert!(!folder.path().join("out").exists(), "{fabric}");
    }
    // Files of custom elements must be in the fabric's folder, or where the user allows.
    std::fs::create_dir(folder.path().join("mine")).unwrap();
    let own = "[fabric]\ndensity = 0.2\nmaterial.file = { path = \"../own.energy\", parameters = { k = 40.0 } }\n";
    write("mine/fabric.toml", own);
    write("own.energy", "energy Spring(p, q: Point; k: Scalar[N/m], L: Scalar[m]) = \"k/2 (‖p − q‖ − L)²\";\n");
    let message = refused(&["test", "mine/fabric.toml", "-o", "out", "--only", "tensile"], folder.path());
    assert!(message.contains("own.energy is outside the scene's folder"), "{message}");
    let table =
        succeeds(&["test", "mine/fabric.toml", "-o", "out", "--only", "shear", "--allow-path", "."], folder.path());
    assert!(table.contains("gf/(cm °)"), "{table}");
}
