use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::slice;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

use anyhow::{Context, Result, anyhow, bail};
use clap::Args;
use cloth_core::output::OutputFolder;
use cloth_core::run::{Checkpoint, Ending, Record, Run, RunOptions};
use cloth_core::scene::Scene;
use energy_cli::{Interrupts, tell};
use energy_files::excerpt;
use toml::{Table, Value};

use super::allowed_folders::AllowedFolders;
use super::print;

#[derive(Debug, Args)]
pub struct Sweep {
    /// Scene file (TOML).
    scene: PathBuf,
    /// Table of values for keys of the scene (TOML), such as `fabric.density = [0.1, 0.2]`. Each combination is a run.
    parameters: PathBuf,
    /// Folder for the runs, `index.csv` and `times.csv`. Runs that are done are skipped, interrupted ones resume.
    #[arg(short, long)]
    output: PathBuf,
    /// Runs at a time, each on one thread; default: one per core.
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..))]
    jobs: Option<u16>,
    #[command(flatten)]
    allowed: AllowedFolders,
    /// Steps between checkpoints.
    #[arg(long, value_name = "STEPS", default_value = "50", value_parser = clap::value_parser!(u64).range(1..))]
    checkpoint: u64,
}

/// One run of a sweep.
#[derive(Debug)]
struct Choice {
    /// Values of the parameters, in the order of their keys.
    values: Vec<Value>,
    /// Text of the scene.
    text: String,
    /// Name of the folder: a hash of everything that the run reads. The same run continues in the same folder. After an
    /// edit of a mesh, no earlier result counts.
    name: String,
}

impl Sweep {
    pub fn run(self) -> Result<ExitCode> {
        let base: Table = Scene::text(&self.scene)?.parse().with_context(|| self.scene.display().to_string())?;
        let file = self.parameters.display().to_string();
        let text =
            energy_files::read_text(&self.parameters, LARGEST_TABLE).with_context(|| format!("cannot read {file}"))?;
        let mut grid = Vec::new();
        flatten("", &text.parse().with_context(|| file.clone())?, &mut grid).with_context(|| file.clone())?;
        let choices = choices(&base, &grid, &self.scene).context(file)?;
        std::fs::create_dir_all(&self.output).with_context(|| format!("cannot create {}", self.output.display()))?;
        let interrupts = Interrupts::listen()?;
        let failures = self.simulate(&choices, &interrupts)?;
        if interrupts.flag().load(Ordering::Relaxed) {
            tell("stopped; the same command continues the sweep");
            return Ok(interrupts.exit_code());
        }
        let keys: Vec<&str> = grid.iter().map(|(key, _)| key.as_str()).collect();
        self.write_index(&keys, &choices, &failures)?;
        let failed = failures.iter().flatten().count();
        print(&format!("{} runs, {failed} failed; see {}\n", choices.len(), self.output.join(INDEX).display()))?;
        Ok(if failed == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE })
    }

    /// Runs all choices, several at a time. Returns why each failed; `None` for those that did not.
    fn simulate(&self, choices: &[Choice], interrupts: &Interrupts) -> Result<Vec<Option<String>>> {
        let jobs = self.jobs.map_or_else(|| thread::available_parallelism().map_or(1, usize::from), usize::from);
        let (next, failures) = (AtomicUsize::new(0), Mutex::new(vec![None; choices.len()]));
        thread::scope(|scope| {
            let work = || {
                while !interrupts.flag().load(Ordering::Relaxed) {
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    let Some(choice) = choices.get(index) else { return };
                    let failure = self.run_one(choice, interrupts).err().map(|error| energy_cli::message(&error));
                    if !interrupts.flag().load(Ordering::Relaxed) {
                        let state = failure.as_deref().unwrap_or("done");
                        tell(&format!("{} of {}: {} {state}", index + 1, choices.len(), choice.name));
                    }
                    failures.lock().expect("no thread panics")[index] = failure;
                }
            };
            let workers: Vec<_> = (0..jobs.min(choices.len())).map(|_| scope.spawn(work)).collect();
            let is_sound = workers.into_iter().all(|worker| worker.join().is_ok());
            if is_sound { Ok(()) } else { Err(anyhow!("a run ended by a bug of this program")) }
        })?;
        Ok(failures.into_inner().expect("no thread panics"))
    }

    fn run_one(&self, choice: &Choice, interrupts: &Interrupts) -> Result<()> {
        self.allowed
            .check(&choice.text, &self.scene)
            .map_err(|error| anyhow!(with_line(&choice.text, &error.to_string())))?;
        // A symbolic link in its place would lead elsewhere.
        let folder = energy_files::subfolder(&self.output, &choice.name)?;
        let done = folder.join(DONE);
        if done.symlink_metadata().is_ok_and(|done| done.is_file()) {
            return Ok(());
        }
        let options = RunOptions { overwrite: true, checkpoint_interval: Some(self.checkpoint), ignore_memory: false };
        let start = || Run::new(choice.text.clone(), &self.scene, &folder, options);
        let run = match folder.join(OutputFolder::CHECKPOINT).exists() {
            true => Run::resume(&folder, false).or_else(|_| start()),
            false => start(),
        };
        let run = run.map_err(|error| anyhow!(with_line(&choice.text, &error.to_string())))?;
        let ending = run.with_threads(1).go(interrupts.flag(), |_| ())?;
        match ending {
            Ending { failure: Some(failure), .. } => Err(failure.into()),
            Ending { finished: true, abandoned: false, .. } => Ok(energy_files::write_whole(&done, b"")?),
            _ => Ok(()),
        }
    }

    /// Writes the index, which depends on the scenes alone, and the times, which do not.
    fn write_index(&self, keys: &[&str], choices: &[Choice], failures: &[Option<String>]) -> Result<()> {
        let head = keys.iter().copied().chain(COLUMNS).map(cell).collect::<Vec<_>>().join(",");
        let (mut index, mut times) = (format!("{head}\n"), "folder,seconds\n".to_owned());
        for (choice, failure) in choices.iter().zip(failures) {
            let values = choice.values.iter().map(|value| match value {
                Value::String(text) => cell(text),
                value => cell(&value.to_string()),
            });
            let (results, seconds) = match failure {
                Some(message) => {
                    let blanks = vec![String::new(); COLUMNS.len() - 3];
                    ([vec!["failed".to_owned()], blanks, vec![cell(message)]].concat(), String::new())
                }
                None => results(&self.output.join(&choice.name))?,
            };
            let row: Vec<String> = values.chain([choice.name.clone()]).chain(results).collect();
            let _ = writeln!(index, "{}", row.join(","));
            let _ = writeln!(times, "{},{seconds}", choice.name);
        }
        for (name, text) in [(INDEX, index), ("times.csv", times)] {
            let path = self.output.join(name);
            energy_cli::write_whole(&path, text.as_bytes())
                .with_context(|| format!("cannot write {}", path.display()))?;
        }
        Ok(())
    }
}

/// The largest table of values, in bytes.
const LARGEST_TABLE: u64 = 1 << 20;
/// The largest number of runs. All their scenes are in memory.
const MOST_RUNS: usize = 10_000;

const INDEX: &str = "index.csv";
/// A file in the folder of a run that was completed.
const DONE: &str = "sweep.done";
/// Columns of the index after those of the parameters.
const COLUMNS: [&str; 10] = [
    "folder",
    "status",
    "steps",
    "frames",
    "energy",
    "kinetic_energy",
    "crossings",
    "obstacle_crossings",
    "warnings",
    "message",
];

/// Adds the line of the text that a message names. Users never see the text: its values come from two files.
fn with_line(text: &str, message: &str) -> String {
    let number = message.split(':').nth(1).and_then(|number| number.parse::<usize>().ok());
    match number.and_then(|number| text.lines().nth(number.checked_sub(1)?)) {
        Some(line) => format!("{message}: {}", line.trim()),
        None => message.to_owned(),
    }
}

/// Returns the results of a run for the index, and the seconds of its steps.
fn results(folder: &Path) -> Result<(Vec<String>, String)> {
    let Record { frames, summary, .. } = Record::read(folder)?;
    let energy: f64 = summary.terms.iter().filter_map(|term| term.energy).sum();
    let results = vec![
        "done".to_owned(),
        summary.totals.steps.to_string(),
        frames.to_string(),
        energy.to_string(),
        summary.kinetic_energy.to_string(),
        summary.crossings.to_string(),
        summary.obstacle_crossings.to_string(),
        summary.warnings.len().to_string(),
        String::new(),
    ];
    Ok((results, format!("{:.3}", summary.totals.stepping_time.as_secs_f64())))
}

/// Quotes a cell of a CSV file if it has to be.
fn cell(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) { format!("\"{}\"", text.replace('"', "\"\"")) } else { text.to_owned() }
}

/// Lists the keys of nested tables as paths, `fabric.density`, with their values.
fn flatten(prefix: &str, table: &Table, grid: &mut Vec<(String, Vec<Value>)>) -> Result<()> {
    for (key, value) in table {
        let path = if prefix.is_empty() { key.clone() } else { format!("{prefix}.{key}") };
        match value {
            Value::Table(table) => flatten(&path, table, grid)?,
            Value::Array(values) => grid.push((path, values.clone())),
            other => bail!("{path}: expected a list of values, got {other}"),
        }
    }
    Ok(())
}

/// Returns all combinations of values; the last key varies fastest. `path` is that of the scene.
fn choices(base: &Table, grid: &[(String, Vec<Value>)], path: &Path) -> Result<Vec<Choice>> {
    let count = grid.iter().try_fold(1_usize, |count, (_, values)| count.checked_mul(values.len()));
    if count.is_none_or(|count| count > MOST_RUNS) {
        let lists = grid.iter().map(|(key, values)| format!("{} of {key}", values.len())).collect::<Vec<_>>();
        bail!("expected at most {MOST_RUNS} runs, got all combinations of {}", excerpt(&lists.join(", ")));
    }
    let mut combinations: Vec<Vec<Value>> = vec![Vec::new()];
    for (_, values) in grid {
        let extend = |head: Vec<Value>| values.iter().map(move |value| [&head[..], slice::from_ref(value)].concat());
        combinations = combinations.into_iter().flat_map(extend).collect();
    }
    let choice = |values: Vec<Value>| {
        let mut scene = base.clone();
        for ((key, _), value) in grid.iter().zip(&values) {
            set(&mut scene, key, value)?;
        }
        let text = toml::to_string(&scene)?;
        let name = format!("{:016x}", identity(&text, path));
        Ok(Choice { values, text, name })
    };
    combinations.into_iter().map(choice).collect()
}

/// Sets the value at a path, `obstacles.0.friction`. Numbers are places in lists; missing tables are created.
fn set(scene: &mut Table, path: &str, value: &Value) -> Result<()> {
    let (tables, last) = path.rsplit_once('.').map_or((None, path), |(tables, last)| (Some(tables), last));
    let mut table = scene;
    let mut keys = tables.into_iter().flat_map(|tables| tables.split('.'));
    while let Some(key) = keys.next() {
        let mut entry = table.entry(key).or_insert_with(|| Table::new().into());
        if let Value::Array(list) = entry {
            let place = keys.next().and_then(|place| place.parse::<usize>().ok());
            let message = format!("{path}: expected one of the {} places of `{key}`, counted from 0", list.len());
            entry = place.and_then(|place| list.get_mut(place)).context(message)?;
        }
        let Value::Table(next) = entry else { bail!("{path}: `{key}` is not a table of the scene") };
        table = next;
    }
    table.insert(last.to_owned(), value.clone());
    Ok(())
}

/// Returns a hash of what a run reads: the version of the program, the text of its scene, and the meshes and materials
/// that the scene names. An invalid scene has none.
fn identity(text: &str, path: &Path) -> u64 {
    let version = format!("{}, checkpoints {}\n", env!("CARGO_PKG_VERSION"), Checkpoint::VERSION);
    let files = Scene::parse(text, path).map_or_else(|_| Vec::new(), |scene| scene.input_files());
    let start = [version.as_bytes(), text.as_bytes()].into_iter().fold(FNV_OFFSET, fnv1a);
    files.iter().fold(start, |hash, file| match std::fs::read(file) {
        Ok(contents) => fnv1a(fnv1a(hash, &contents.len().to_le_bytes()), &contents),
        Err(_) => fnv1a(hash, b"unreadable"),
    })
}

/// The start of the hash FNV-1a.
const FNV_OFFSET: u64 = 0xcbf2_9ce4_8422_2325;

/// Continues the hash FNV-1a with some bytes.
fn fnv1a(hash: u64, bytes: &[u8]) -> u64 {
    bytes.iter().fold(hash, |hash, &byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}
