//! Every failure of a write and kills at any time: clear errors, whole files, and the same results after another try.
//! `DRILL_KILLS=100 cargo test -p fusion-core --test all drills:: -- --ignored --nocapture` kills at random times;
//! `DRILL_SEED` has the seed.

use std::path::Path;
use std::process::Command;

use energy_files::drill::Drill;
use tempfile::TempDir;

/// Returns a folder with a recording of this many frames.
fn folder(frames: usize) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let last = (frames - 1).to_string();
    let mut command = Command::new(env!("CARGO_BIN_EXE_fusion"));
    command.args(["render", "--to", &last, "-o", "recording"]).current_dir(folder.path());
    assert!(command.output().unwrap().status.success());
    // Few nodes: the images are tracked in no time.
    std::fs::write(folder.path().join("options.json"), r#"{"model": {"node_radius": 0.3}}"#).unwrap();
    folder
}

fn track(output: &Path) -> Vec<String> {
    let has = |name: &str| output.join(name).exists();
    let output = output.display();
    let text = if has("checkpoint") || has("checkpoint.previous") {
        format!("resume {output}")
    } else {
        format!("track recording --no-bones --usd --gltf --options options.json --overwrite -o {output}")
    };
    text.split(' ').map(str::to_owned).collect()
}

/// States are left out, and times are cut off. Tables grow while the frames are tracked.
fn repeatable(path: &Path, contents: Vec<u8>) -> Option<Vec<u8>> {
    let name = path.file_name()?.to_str()?;
    match name {
        _ if name.starts_with("checkpoint") || name == "fusion.lock" => None,
        "frames.csv" | "nodes.json" => Some(Vec::new()),
        _ => Some(contents),
    }
}

fn drill(folder: &TempDir) -> Drill<'_> {
    Drill { program: env!("CARGO_BIN_EXE_fusion"), folder: folder.path(), arguments: track, repeatable }
}

#[test]
fn every_failure_of_a_track_is_told_and_mended() {
    let count = drill(&folder(2)).faults();
    assert!(count > 30, "{count} faults");
}

#[test]
#[ignore = "takes minutes: as many kills as DRILL_KILLS says, at random times"]
fn killed_tracks_continue() {
    let number = |name: &str, usual: u64| {
        std::env::var(name).map_or(usual, |text| text.parse().unwrap_or_else(|_| panic!("{name} is not a number")))
    };
    let (count, seed) = (number("DRILL_KILLS", 100), number("DRILL_SEED", 1));
    let works = drill(&folder(6)).kills(count as usize, seed);
    println!("{count} kills, {works} completed works");
}
