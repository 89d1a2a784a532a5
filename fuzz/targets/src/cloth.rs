//! Scenes, and the folders and tables that go with them.

use std::path::{Path, PathBuf};
use std::sync::LazyLock;
use std::sync::atomic::{AtomicBool, Ordering};

use cloth_core::Simulation;
use cloth_core::output::OutputFolder;
use cloth_core::run::{Checkpoint, MemoryNeed, Record, Run, RunOptions, write_report};
use cloth_core::scene::arcsim::Fabric;
use cloth_core::scene::{Scene, with_material};
use cloth_core::sweep::Grid;
use energy_files::sealed::Seal;

use crate::language::{self, compiled};
use crate::target::{Target, message, repository, text};

/// A scene, set up and stepped once as `cloth run --dry-run` does.
pub(crate) const SCENE: Target = Target {
    name: "scene",
    words: WORDS,
    shared: &["scenes/hang.toml", "scenes/hair.toml", "scenes/contact/drape.toml", "scenes/garment/skirt.toml"],
    made: Vec::new,
    read: |input, _| step(text(input)?),
};

/// A `.energy` file that a scene names.
pub(crate) const MATERIAL: Target =
    Target { name: "material", words: language::WORDS, shared: &["scenes/own.energy"], made: Vec::new, read: material };

/// A fabric file of ARCSim, converted to a table.
pub(crate) const ARCSIM: Target =
    Target { name: "arcsim", words: crate::fusion::WORDS, shared: &[], made: Vec::new, read: arcsim };

/// A table of values of `cloth sweep`.
pub(crate) const SWEEP: Target = Target { name: "sweep", words: WORDS, shared: &[], made: Vec::new, read: sweep };

/// The contents of a checkpoint, which are sealed before they are read.
pub(crate) const CHECKPOINT: Target = Target {
    name: "checkpoint",
    words: crate::fusion::WORDS,
    shared: &[],
    made: || STOPPED.iter().map(|run| run.checkpoint.clone()).collect(),
    read: checkpoint,
};

/// The record of a run, `run.json`, from which a report is made.
pub(crate) const RUN_FOLDER: Target = Target {
    name: "run_folder",
    words: crate::fusion::WORDS,
    shared: &[],
    made: || STOPPED.iter().map(|run| run.record.clone()).collect(),
    read: run_folder,
};

/// The largest simulation, in bytes: steps of larger ones take long on purpose.
const LARGEST: f64 = 2e6;

const SMALL: &str = r#"dt = 0.01
duration = 0.1
[mesh.sheet]
cells = [2, 2]
size = [1.0, 1.0]
[fabric]
density = 0.2
material.mass-spring = { structural = 10.0, shear = 5.0, bending = 1.0 }
[[pins]]
nearest = [-0.5, 0.5, 0.0]
[output]
png = false
gltf = false
"#;

/// Relative paths of scenes lead to this folder, which nothing is written to.
fn scene_path() -> PathBuf {
    repository().join("scenes/fuzzed.toml")
}

/// Converts a fabric; the result must be a table of a scene, unless its numbers contradict each other.
fn arcsim(input: &[u8], _: &Path) -> Result<(), String> {
    let table = Fabric::parse(text(input)?).map_err(message)?.table("fuzzed");
    let scene = format!("dt = 0.01\nduration = 0.1\n[mesh.disc]\nradius = 1.0\nrings = 2\n{table}");
    Scene::parse(&scene, &scene_path()).map(|_| ()).map_err(message)
}

/// Parses a scene. `None` if it is too large to be stepped.
fn parsed(text: &str) -> Result<Option<Scene>, String> {
    let scene = Scene::parse(text, &scene_path()).map_err(message)?;
    scene.check_paths(&[]).map_err(message)?;
    let need = MemoryNeed::of(&scene);
    Ok((need.simulation < LARGEST && need.total() < 10.0 * LARGEST).then_some(scene))
}

fn step(text: &str) -> Result<(), String> {
    let Some(scene) = parsed(text)? else { return Ok(()) };
    let mut simulation = Simulation::new(&scene).map_err(message)?.with_threads(1);
    advance(&mut simulation)
}

/// Takes a step. Its result is finite, or an error.
fn advance(simulation: &mut Simulation) -> Result<(), String> {
    if !simulation.is_finished() {
        simulation.step().map_err(message)?;
    }
    assert!(simulation.positions().as_flattened().iter().all(|x| x.is_finite()), "a position is not finite");
    Ok(())
}

fn material(input: &[u8], folder: &Path) -> Result<(), String> {
    compiled(input)?;
    let file = folder.join("own.energy");
    std::fs::write(&file, input).expect("the folder is there");
    let text = with_material(SMALL, &file, &[("k".to_owned(), 10.0)]);
    let scene = Scene::parse(&text, &folder.join("scene.toml")).map_err(message)?;
    let mut simulation = Simulation::new(&scene).map_err(message)?.with_threads(1);
    advance(&mut simulation)
}

fn sweep(input: &[u8], _: &Path) -> Result<(), String> {
    let grid = Grid::parse(text(input)?).map_err(message)?;
    let scene = SMALL.parse().expect("the scene is TOML");
    let choices = grid.choices(&scene, &scene_path()).map_err(message)?;
    assert!(choices.iter().all(|choice| choice.values.len() == grid.keys().count()));
    choices.first().map_or(Ok(()), |choice| step(&choice.text))
}

fn checkpoint(input: &[u8], folder: &Path) -> Result<(), String> {
    let path = folder.join(OutputFolder::CHECKPOINT);
    let file = Seal { keyword: "cloth-checkpoint", version: Checkpoint::VERSION }.close(input);
    let saved = Checkpoint::from_bytes(&file, &path).map_err(message)?;
    let Some(scene) = parsed(&saved.scene)? else { return Ok(()) };
    // Violent states take thousands of adaptive steps: work of the simulation, not of the reader.
    let scene = Scene { adaptive: false, ..scene };
    let mut simulation = Simulation::new(&scene).map_err(message)?.with_threads(1);
    simulation.restore(saved.state).map_err(message)?;
    advance(&mut simulation)?;
    let write = |name: &str, contents: &[u8]| std::fs::write(folder.join(name), contents).expect("the folder is there");
    write(OutputFolder::CHECKPOINT, &file);
    write(OutputFolder::SAVED_FRAMES, &STOPPED[0].frames);
    Run::resume_checked(folder, true, |scene| scene.check_paths(&[])).map(drop).map_err(message)
}

fn run_folder(input: &[u8], folder: &Path) -> Result<(), String> {
    std::fs::write(folder.join(OutputFolder::RECORD), input).expect("the folder is there");
    let record = Record::read(folder).map_err(message)?;
    // Audits of all elements that a record names take seconds each.
    if record.summary.terms.is_empty() {
        let page = std::fs::read_to_string(write_report(folder).map_err(message)?).expect("a page is text");
        assert!(!page.contains("<script") && !page.contains("javascript:\""));
    }
    Ok(())
}

/// Contact, friction, hair and plasticity, with steps that are retried.
const IN_CONTACT: &str = r#"dt = 0.01
duration = 0.1
integrator = "newton"
adaptive = true
[mesh.sheet]
cells = [2, 1]
size = [0.2, 0.1]
[fabric]
density = 0.2
friction = 0.3
plasticity = { stretch = 1.01 }
material.stvk = { stretch_stiffness = 40.0, poisson_ratio = 0.3, bending.flat.stiffness = 1e-5 }
[[obstacles]]
sphere = { centre = [0.0, 0.0, -0.1], radius = 0.0985 }
friction = 0.3
[output]
png = false
gltf = false
ledger = true
"#;

/// Histories of an integrator, and islands that fall asleep.
const WITH_HISTORY: &str = r#"dt = 0.01
duration = 0.1
integrator = "bdf2"
sleep = true
[[garment]]
mesh.sheet = { cells = [1, 1], size = [0.1, 0.1] }
fabric.density = 0.2
fabric.material.mass-spring = { structural = 10.0, shear = 5.0, bending = 1.0 }
[[garment]]
mesh.strip = { length = 0.1, width = 0.1, segments = 1, plane = "horizontal" }
fabric.density = 0.2
fabric.material.mass-spring = { structural = 10.0, shear = 5.0, bending = 1.0 }
[[pins]]
nearest = [0.0, 0.0, 0.0]
[output]
png = false
gltf = false
"#;

/// The files of a small run that was stopped after two steps.
struct Stopped {
    /// Contents of the checkpoint, without the seal.
    checkpoint: Vec<u8>,
    frames: Vec<u8>,
    record: Vec<u8>,
}

static STOPPED: LazyLock<[Stopped; 3]> = LazyLock::new(|| [SMALL, IN_CONTACT, WITH_HISTORY].map(stopped));

fn stopped(scene: &str) -> Stopped {
    let folder = tempfile::tempdir().expect("the folder of temporary files can be written to");
    let mut options = RunOptions::default();
    (options.checkpoint_interval, options.ignore_memory) = (Some(1), true);
    let run = Run::new(scene.to_owned(), &scene_path(), folder.path(), options);
    let (mut run, stop) = (run.expect("the scene is valid").with_threads(1), AtomicBool::new(false));
    let mut steps = 0;
    let ending = run.go(&stop, |_| {
        steps += 1;
        stop.store(steps >= 2, Ordering::Relaxed);
    });
    assert!(ending.is_ok_and(|ending| ending.failure.is_none()));
    let read = |name: &str| std::fs::read(folder.path().join(name)).expect("the run wrote its files");
    let checkpoint = read(OutputFolder::CHECKPOINT);
    let seal = checkpoint.iter().position(|&byte| byte == b'\n').expect("the seal is a line");
    // Audits take long: a record without terms.
    let mut record: serde_json::Value = serde_json::from_slice(&read(OutputFolder::RECORD)).expect("a record is JSON");
    record["summary"]["terms"] = serde_json::json!([]);
    Stopped {
        checkpoint: checkpoint[seal + 1..].to_vec(),
        frames: read(OutputFolder::SAVED_FRAMES),
        record: serde_json::to_vec(&record).expect("a record is JSON"),
    }
}

const WORDS: &[&str] = &[
    "[[pins]]\n",
    "[[garment]]\n",
    "[[obstacles]]\n",
    "[[seams]]\n",
    "[[hair]]\n",
    "[output]\n",
    "[wind]\n",
    "[mesh.sheet]\n",
    "[mesh.disc]\n",
    "[fabric]\n",
    "= ",
    "\"",
    "'",
    "true",
    "false",
    "[",
    "]",
    "{",
    "}",
    ",",
    "\n",
    "nan",
    "inf",
    "integrator = \"newton\"\n",
    "contact = \"on\"\n",
    "sleep = true\n",
    "untangle = true\n",
    "fabric = \"denim\"\n",
    "\"torus.obj\"",
    "\"own.energy\"",
    "../",
    "sphere = { radius = 0.2 }\n",
];
