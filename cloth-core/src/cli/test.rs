use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::Ordering;

use anyhow::{Context, Result, bail};
use clap::Args;
use clap::builder::PossibleValuesParser;
use cloth_core::output::OutputFolder;
use cloth_core::run::{Checkpoint, Ending, Event, Log, Progress, Record, Run, RunOptions};
use cloth_core::tester::{Results, TestedFabric, Trial};
use energy_cli::{Interrupts, Notice, tell};
use energy_files::{FolderLock, remove_parts};

use super::allowed_folders::AllowedFolders;
use super::print;

#[derive(Debug, Args)]
pub struct Test {
    /// Name of a fabric (see `cloth fabrics`), or TOML file with a table `[fabric]`.
    fabric: String,
    /// Tests to run, separated by commas; default: all.
    #[arg(long, value_delimiter = ',', value_parser = PossibleValuesParser::new(Trial::KINDS))]
    only: Vec<String>,
    /// Folder for scenes, runs and results. Tests that are done are skipped, interrupted ones resume.
    #[arg(short, long)]
    output: PathBuf,
    /// Replace tests of another fabric.
    #[arg(long)]
    overwrite: bool,
    /// Steps between checkpoints.
    #[arg(long, value_name = "STEPS", default_value = "20", value_parser = clap::value_parser!(u64).range(1..))]
    checkpoint: u64,
    /// Maximum number of threads; default: one per core. Results are bit-identical.
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..))]
    threads: Option<u16>,
    #[command(flatten)]
    allowed: AllowedFolders,
    /// Print curves and numbers as JSON, as in `results.json`.
    #[arg(long)]
    json: bool,
}

impl Test {
    pub fn run(self) -> Result<ExitCode> {
        let fabric = TestedFabric::find(&self.fabric)?;
        fabric.check_paths(self.allowed.folders())?;
        let is_wanted = |trial: &Trial| self.only.is_empty() || self.only.iter().any(|kind| kind == trial.kind());
        let trials: Vec<Trial> = Trial::ALL.into_iter().filter(is_wanted).collect();
        energy_files::create_folder(&self.output)
            .with_context(|| format!("cannot create {}", self.output.display()))?;
        let _lock = FolderLock::take(&self.output, LOCK)?;
        remove_parts(&self.output).with_context(|| format!("cannot prepare {}", self.output.display()))?;
        let interrupts = Interrupts::listen()?;
        for (number, trial) in trials.iter().enumerate() {
            tell(&format!("{} of {}: {}", number + 1, trials.len(), trial.name()));
            if !self.simulate(*trial, &fabric, &interrupts)? {
                tell("stopped; the same command continues the tests");
                return Ok(interrupts.exit_code());
            }
        }
        let notice = Notice::of(format!("evaluating the tests of {} …", fabric.name()));
        let outcomes = trials.iter().map(|trial| trial.outcome(&fabric, &self.output.join(trial.name())));
        let results = Results { fabric: fabric.name().to_owned(), outcomes: outcomes.collect::<Result<_, _>>()? };
        drop(notice);
        let written = self.write(&results)?;
        if self.json {
            print(&format!("{}\n", serde_json::to_string_pretty(&results)?))?;
        } else {
            print(&format!("{results}\n\n{written}"))?;
        }
        Ok(ExitCode::SUCCESS)
    }

    /// Runs a test, or continues it. Returns whether it is done; `false` after a signal.
    fn simulate(&self, trial: Trial, fabric: &TestedFabric, interrupts: &Interrupts) -> Result<bool> {
        let (scene, mesh) = trial.scene(fabric)?;
        let cannot = |path: &Path| format!("cannot write {}", path.display());
        let folder = energy_files::subfolder(&self.output, &trial.name())
            .with_context(|| cannot(&self.output.join(trial.name())))?;
        let earlier = Earlier::find(&folder, &scene);
        if earlier == Earlier::Done {
            return Ok(true);
        }
        if earlier == Earlier::Other && !self.overwrite {
            bail!(
                "{} holds a test of another fabric or version; choose another folder with -o, or pass --overwrite",
                folder.display()
            );
        }
        let file = |extension: &str| self.output.join(format!("{}.{extension}", trial.name()));
        let files = [(file("toml"), Some(scene.clone())), (file("obj"), mesh)];
        for (path, text) in files.iter().filter_map(|(path, text)| Some((path, text.as_ref()?))) {
            // A file that is written again would count as edited.
            let is_same = energy_files::read_text(path, LARGEST_SCENE).is_ok_and(|found| found == *text);
            if !is_same {
                energy_cli::write_whole(path, text.as_bytes()).with_context(|| cannot(path))?;
            }
        }
        let mut options = RunOptions::default();
        (options.overwrite, options.checkpoint_interval) = (true, Some(self.checkpoint));
        let start = || Run::new(scene, &file("toml"), &folder, options);
        let run = match earlier {
            Earlier::Interrupted => Run::resume(&folder, false).or_else(|_| start())?,
            _ => start()?,
        };
        go(super::run::limit_threads(run, self.threads), trial, interrupts)
    }

    /// Writes the files of results, and returns the lines that name them.
    fn write(&self, results: &Results) -> Result<String> {
        let [curves, numbers] = cloth_core::tester::RESULT_FILES.map(str::to_owned);
        let json = serde_json::to_string_pretty(results)?;
        let files = [(curves, results.csv()), (numbers, json)].into_iter().chain(results.plots()?);
        let mut lines = String::new();
        for (name, text) in files {
            let path = self.output.join(name);
            energy_cli::write_whole(&path, text.as_bytes())
                .with_context(|| format!("cannot write {}", path.display()))?;
            lines.push_str(&format!("wrote {}\n", path.display()));
        }
        Ok(lines)
    }
}

/// Lock of the folder: two commands must not write the same tests.
const LOCK: &str = "cloth.lock";
/// The largest scene or mesh of a test, in bytes.
const LARGEST_SCENE: u64 = 16 << 20;

/// The files in the folder of a test.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Earlier {
    Nothing,
    /// A checkpoint of the same scene.
    Interrupted,
    Done,
    /// A run of another scene.
    Other,
}

impl Earlier {
    fn find(folder: &Path, scene: &str) -> Self {
        if let Ok(record) = Record::read(folder) {
            match (record.scene == scene, record.finished) {
                // The picture is the last file of a run; the record comes first.
                (true, true) if folder.join(OutputFolder::PICTURE).is_file() => return Self::Done,
                (true, _) => {}
                (false, _) => return Self::Other,
            }
        }
        let checkpoints = [OutputFolder::CHECKPOINT, OutputFolder::PREVIOUS_CHECKPOINT];
        let scenes = checkpoints.map(|name| Checkpoint::read(&folder.join(name)).map(|saved| saved.scene).ok());
        match scenes.into_iter().flatten().next() {
            Some(saved) if saved == scene => Self::Interrupted,
            Some(_) => Self::Other,
            None => Self::Nothing,
        }
    }
}

/// Steps a run to its end. Returns whether it got there; `false` after a signal.
fn go(mut run: Run, trial: Trial, interrupts: &Interrupts) -> Result<bool> {
    run.notes().iter().for_each(|note| tell(&format!("note: {note}")));
    run.simulation().warnings().iter().for_each(|warning| tell(&format!("warning: {}: {warning}", trial.name())));
    let mut progress = Progress::new(run.simulation().steps(), run.simulation().steps_done(), Log::Text);
    let ended = run.go(interrupts.flag(), |event| match event {
        Event::Step(simulation, report) => progress.step(simulation.steps_done(), report),
        Event::LastStep => progress.last_step(),
    });
    progress.finish();
    match ended? {
        Ending { failure: Some(failure), .. } => Err(anyhow::Error::new(failure).context(trial.name())),
        Ending { finished, abandoned, .. } => Ok(finished && !abandoned && !interrupts.flag().load(Ordering::Relaxed)),
    }
}
