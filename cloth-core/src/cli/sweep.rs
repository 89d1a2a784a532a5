use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

use anyhow::{Context, Result, anyhow};
use clap::Args;
use cloth_core::output::OutputFolder;
use cloth_core::run::{Ending, Record, Run, RunOptions};
use cloth_core::scene::Scene;
use cloth_core::sweep::{Choice, Grid};
use energy_cli::{Interrupts, tell};
use energy_files::{FolderLock, remove_parts};
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

impl Sweep {
    pub fn run(self) -> Result<ExitCode> {
        let text = Scene::text(&self.scene)?;
        // Errors of the scene are those of the parser of scenes, with their place.
        let scene = text.parse().or_else(|_| Scene::parse(&text, &self.scene).map(|_| Table::new()))?;
        let file = self.parameters.display().to_string();
        let text =
            energy_files::read_text(&self.parameters, LARGEST_TABLE).with_context(|| format!("cannot read {file}"))?;
        let grid = Grid::parse(&text).with_context(|| file.clone())?;
        let choices = grid.choices(&scene, &self.scene).context(file)?;
        energy_files::create_folder(&self.output)
            .with_context(|| format!("cannot create {}", self.output.display()))?;
        let _lock = FolderLock::take(&self.output, LOCK)?;
        remove_parts(&self.output).with_context(|| format!("cannot prepare {}", self.output.display()))?;
        let interrupts = Interrupts::listen()?;
        let failures = self.simulate(&choices, &interrupts)?;
        if interrupts.flag().load(Ordering::Relaxed) {
            tell("stopped; the same command continues the sweep");
            return Ok(interrupts.exit_code());
        }
        let keys: Vec<&str> = grid.keys().collect();
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
        self.allowed.check(&choice.text, &self.scene).map_err(|error| with_line(&choice.text, error))?;
        // A symbolic link in its place would lead elsewhere.
        let cannot = |path: &Path| format!("cannot write {}", path.display());
        let folder = energy_files::subfolder(&self.output, &choice.name)
            .with_context(|| cannot(&self.output.join(&choice.name)))?;
        let done = folder.join(DONE);
        if done.symlink_metadata().is_ok_and(|done| done.is_file()) {
            return Ok(());
        }
        let mut options = RunOptions::default();
        (options.overwrite, options.checkpoint_interval) = (true, Some(self.checkpoint));
        let start = || Run::new(choice.text.clone(), &self.scene, &folder, options);
        let has_state =
            [OutputFolder::CHECKPOINT, OutputFolder::PREVIOUS_CHECKPOINT].map(|name| folder.join(name).exists());
        let run = match has_state.contains(&true) {
            true => Run::resume(&folder, false).or_else(|_| start()),
            false => start(),
        };
        let run = run.map_err(|error| with_line(&choice.text, error))?;
        let ending = run.with_threads(1).go(interrupts.flag(), |_| ())?;
        match ending {
            Ending { failure: Some(failure), .. } => Err(failure.into()),
            Ending { finished: true, abandoned: false, .. } => {
                energy_files::write_whole(&done, b"").with_context(|| cannot(&done))
            }
            _ => Ok(()),
        }
    }

    /// Returns the forces of pins and the strains of garments at the end of each run, by column; none if it failed.
    fn measured(&self, choices: &[Choice], failures: &[Option<String>]) -> Result<Vec<Vec<(String, f64)>>> {
        let of_run = |(choice, failure): (&Choice, &Option<String>)| match failure {
            Some(_) => Ok(Vec::new()),
            None => Ok(Record::read(&self.output.join(&choice.name))?.measurements.at_end()),
        };
        choices.iter().zip(failures).map(of_run).collect()
    }

    /// Writes the index, which depends on the scenes alone, and the times, which do not.
    fn write_index(&self, keys: &[&str], choices: &[Choice], failures: &[Option<String>]) -> Result<()> {
        let measured = self.measured(choices, failures)?;
        let mut names: Vec<&str> = Vec::new();
        for (name, _) in measured.iter().flatten() {
            if !names.contains(&name.as_str()) {
                names.push(name);
            }
        }
        let head = keys.iter().copied().chain(COLUMNS).chain(names.iter().copied()).map(cell);
        let head = head.collect::<Vec<_>>().join(",");
        let (mut index, mut times) = (format!("{head}\n"), "folder,seconds\n".to_owned());
        for ((choice, failure), measured) in choices.iter().zip(failures).zip(&measured) {
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
            let numbers = names.iter().map(|wanted| {
                let found = measured.iter().find(|(name, number)| name == wanted && !number.is_nan());
                found.map_or(String::new(), |(_, number)| number.to_string())
            });
            let row: Vec<String> = values.chain([choice.name.clone()]).chain(results).chain(numbers).collect();
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

/// Lock of the folder: two sweeps must not write one index.
const LOCK: &str = "cloth.lock";
const INDEX: &str = "index.csv";
/// A file in the folder of a run that was completed.
const DONE: &str = "sweep.done";
/// Columns of the index after those of the parameters, and before those of measurements.
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
fn with_line(text: &str, error: impl Into<anyhow::Error>) -> anyhow::Error {
    let message = energy_cli::message(&error.into());
    let number = message.split(':').nth(1).and_then(|number| number.parse::<usize>().ok());
    match number.and_then(|number| text.lines().nth(number.checked_sub(1)?)) {
        Some(line) => anyhow!("{message}: {}", energy_files::excerpt(line.trim())),
        None => anyhow!(message),
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
