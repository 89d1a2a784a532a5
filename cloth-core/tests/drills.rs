//! Every failure of a write and kills at any time: clear errors, whole files, and the same results after another try.
//! `DRILL_KILLS=500 cargo test -p cloth-core --test all drills:: -- --ignored --nocapture` kills at random times;
//! `DRILL_SEED` has the seed.

use std::path::Path;

use energy_files::drill::Drill;
use tempfile::TempDir;

use crate::runs::with_scene;

const SCENE: &str = r#"dt = 0.01
duration = 0.04
frames_per_second = 50
integrator = "newton"
[mesh.sheet]
cells = [3, 3]
size = [0.5, 0.5]
[fabric]
density = 0.2
material.stvk = { stretch_stiffness = 40.0, poisson_ratio = 0.3 }
[[pins]]
nearest = [0.25, 0.25, 0.0]
[output]
picture = false
png = false
ledger = true
usd = false
pc2 = true
"#;

const VALUES: &str = "fabric.density = [0.1, 0.2]\n";

/// Returns a folder with a scene whose runs take this many seconds of simulated time, and a sweep.
fn folder(duration: &str) -> TempDir {
    let folder = with_scene(&SCENE.replace("0.04", duration));
    std::fs::write(folder.path().join("values.toml"), VALUES).unwrap();
    folder
}

fn run(output: &Path) -> Vec<String> {
    let has = |name: &str| output.join(name).exists();
    let output = output.display();
    let text = if has("checkpoint") || has("checkpoint.previous") {
        format!("resume {output}")
    } else {
        format!("run scene.toml --checkpoint 2 --overwrite --threads 1 -o {output}")
    };
    text.split(' ').map(str::to_owned).collect()
}

fn sweep(output: &Path) -> Vec<String> {
    let text = format!("sweep scene.toml values.toml --checkpoint 2 --jobs 1 -o {}", output.display());
    text.split(' ').map(str::to_owned).collect()
}

/// States are left out; times are cut off.
fn repeatable(path: &Path, contents: Vec<u8>) -> Option<Vec<u8>> {
    let name = path.file_name()?.to_str()?;
    match name {
        _ if name.starts_with("checkpoint") || name == "cloth.lock" => None,
        "run.json" => {
            let record: serde_json::Value = serde_json::from_slice(&contents).expect("a record is JSON");
            // A run that ended early has another one, until it continues.
            record["finished"].as_bool()?.then(|| record["summary"]["momentum"].to_string().into_bytes())
        }
        // A failure is a row of the index, until the sweep continues.
        "index.csv" if String::from_utf8_lossy(&contents).contains(",failed,") => None,
        "summary.txt" | "times.csv" => Some(Vec::new()),
        _ => Some(contents),
    }
}

fn drill(folder: &TempDir, arguments: fn(&Path) -> Vec<String>) -> Drill<'_> {
    Drill { program: env!("CARGO_BIN_EXE_cloth"), folder: folder.path(), arguments, repeatable }
}

#[test]
fn every_failure_of_a_run_is_told_and_mended() {
    let count = drill(&folder("0.04"), run).faults();
    assert!(count > 50, "{count} faults");
}

#[test]
fn every_failure_of_a_sweep_is_told_and_mended() {
    let count = drill(&folder("0.02"), sweep).faults();
    assert!(count > 50, "{count} faults");
}

fn kills(arguments: fn(&Path) -> Vec<String>) {
    let number = |name: &str, usual: u64| {
        std::env::var(name).map_or(usual, |text| text.parse().unwrap_or_else(|_| panic!("{name} is not a number")))
    };
    let (count, seed) = (number("DRILL_KILLS", 100), number("DRILL_SEED", 1));
    let works = drill(&folder("0.2"), arguments).kills(count as usize, seed);
    println!("{count} kills, {works} completed works");
}

#[test]
#[ignore = "takes minutes: as many kills as DRILL_KILLS says, at random times"]
fn killed_runs_continue() {
    kills(run);
}

#[test]
#[ignore = "takes minutes: as many kills as DRILL_KILLS says, at random times"]
fn killed_sweeps_continue() {
    kills(sweep);
}
