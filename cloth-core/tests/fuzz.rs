//! Reading a file terminates with a mesh, a scene or an error, whatever the file contains. Every run replays the corpus
//! with a few edits. `FUZZ_MINUTES=5 cargo test -p cloth-core --test all fuzz:: -- --ignored` runs for longer.

use std::path::{Path, PathBuf};
use std::time::Duration;

use cloth_core::mesh::read_obj;
use cloth_core::scene::Scene;
use verify::fuzz::{Budget, fuzz};

fn corpus(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/corpus").join(name)
}

/// Returns a copy of a corpus, for short runs that must not add to it.
fn copied(name: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for entry in std::fs::read_dir(corpus(name)).unwrap() {
        let path = entry.unwrap().path();
        std::fs::copy(&path, folder.path().join(path.file_name().unwrap())).unwrap();
    }
    folder
}

fn minutes() -> Budget {
    let minutes = std::env::var("FUZZ_MINUTES").map_or(1.0, |text| text.parse().expect("FUZZ_MINUTES is a number"));
    Budget::Time(Duration::from_secs_f64(60.0 * minutes))
}

const OBJ_WORDS: &[&str] =
    &["v ", "f ", "vn ", "vt ", "o ", "g ", "\n", "/", "//", " 1", " -1", " 0", "#", "\\\n", "1e308", "\r\n"];

fn run_obj(corpus: &Path, budget: Budget) -> anyhow::Result<verify::fuzz::Summary> {
    let folder = tempfile::tempdir()?;
    let file = folder.path().join("mesh.obj");
    fuzz(corpus, OBJ_WORDS, budget, 1, |text| {
        std::fs::write(&file, text).expect("the folder is there");
        read_obj(&file).map_or_else(|error| error.to_string(), |mesh| format!("{} triangles", mesh.triangles().len()))
    })
}

const SCENE_WORDS: &[&str] = &[
    "[[pin]]\n",
    "[sheet]\n",
    "[mesh]\n",
    "= ",
    "\"",
    "true",
    "[",
    "]",
    "\n",
    "-1",
    "0",
    "1e9",
    "nan",
    "inf",
    "{",
    "}",
    "'",
];

fn run_scene(corpus: &Path, budget: Budget) -> anyhow::Result<verify::fuzz::Summary> {
    fuzz(corpus, SCENE_WORDS, budget, 1, |text| match Scene::parse(text, Path::new("scene.toml")) {
        Ok(scene) => format!("{} steps", scene.steps().min(1)),
        Err(error) => error.to_string(),
    })
}

#[test]
fn meshes() {
    let summary = run_obj(copied("obj").path(), Budget::Inputs(3000)).unwrap();
    assert!(summary.outcomes >= 8, "{summary:?}");
}

#[test]
fn scenes() {
    let summary = run_scene(copied("scenes").path(), Budget::Inputs(3000)).unwrap();
    assert!(summary.outcomes >= 8, "{summary:?}");
}

#[test]
#[ignore = "as long as FUZZ_MINUTES says"]
fn meshes_for_minutes() {
    println!("{:?}", run_obj(&corpus("obj"), minutes()).unwrap());
}

#[test]
#[ignore = "as long as FUZZ_MINUTES says"]
fn scenes_for_minutes() {
    println!("{:?}", run_scene(&corpus("scenes"), minutes()).unwrap());
}
