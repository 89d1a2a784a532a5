use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::Result;
use clap::{Args, ValueEnum};
use cloth_core::output::OutputFolder;
use cloth_core::physics::fabric::Locking;
use cloth_core::run::{Ending, Event, Forecast, Log, Progress, Run, RunError, RunOptions, stats};
use cloth_core::scene::{self, Scene};
use energy_cli::{Interrupts, Notice, tell};
use serde_json::{Value, json};

use super::allowed_folders::AllowedFolders;
use super::print;

#[derive(Debug, Args)]
pub struct RunScene {
    /// Scene file (TOML).
    scene: PathBuf,
    /// Output folder.
    #[arg(short, long, required_unless_present = "dry_run")]
    output: Option<PathBuf>,
    /// Check the scene, take its first steps, and print vertices, memory and estimated time; write nothing.
    #[arg(long)]
    dry_run: bool,
    /// Form of progress and results: `text`, or `json`: one object per line on standard output.
    #[arg(long, value_enum, default_value_t)]
    log: LogChoice,
    /// Replace the files of an earlier run.
    #[arg(long)]
    overwrite: bool,
    /// Save the state every STEPS steps, for `cloth resume`.
    #[arg(long, value_name = "STEPS", value_parser = clap::value_parser!(u64).range(1..))]
    checkpoint: Option<u64>,
    /// Start even if the run seems not to fit into memory.
    #[arg(long)]
    ignore_memory: bool,
    /// Replace the material of every fabric by the elements that this file declares. They are interpreted, two
    /// to three times slower than built-in elements.
    #[arg(long, value_name = "FILE.energy")]
    material: Option<PathBuf>,
    /// Parameters of these elements, such as `k=20,nu=0.3`, in the units of the declaration.
    #[arg(long, requires = "material", value_delimiter = ',', value_parser = parameter)]
    parameters: Vec<(String, f64)>,
    #[command(flatten)]
    allowed: AllowedFolders,
    /// Repair shallow crossings at the start, as `untangle = true` does in the scene.
    #[arg(long)]
    untangle: bool,
    /// Check each frame for crossings of cloth with itself and with obstacles, by an exact test.
    #[arg(long)]
    check_crossings: bool,
    /// Print what each term evaluated, skipped and reused, how much slept, and the time of each phase.
    #[arg(long)]
    stats: bool,
    /// Maximum number of threads; default: one per core. Results are bit-identical.
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..))]
    threads: Option<u16>,
}

impl RunScene {
    pub fn run(self) -> Result<ExitCode> {
        let Self { scene, output, overwrite, checkpoint, ignore_memory, stats, threads, log, mut allowed, .. } = self;
        let check_crossings = self.check_crossings;
        let mut text = Scene::text(&scene)?;
        if let Some(file) = self.material {
            text = scene::with_material(&text, &file, &self.parameters);
            allowed.allow(file);
        }
        if self.untangle {
            text = scene::with_untangling(&text);
        }
        allowed.check(&text, &scene)?;
        let compiles = text.contains(".energy");
        let notice = compiles.then(|| Notice::of(format!("compiling the materials of {} …", scene.display())));
        let Some(output) = output.filter(|_| !self.dry_run) else {
            return dry_run(&text, &scene, threads, log);
        };
        let mut options = RunOptions::default();
        (options.overwrite, options.checkpoint_interval, options.ignore_memory) =
            (overwrite, checkpoint, ignore_memory);
        options.check_crossings = check_crossings;
        let run = Run::new(text, &scene, &output, options).map_err(|error| match error {
            RunError::Simulation(error) => anyhow::Error::new(error).context(scene.display().to_string()),
            located => located.into(),
        })?;
        drop(notice);
        simulate(limit_threads(run, threads), stats, log)
    }
}

/// The form of progress and results.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum LogChoice {
    /// Text for people.
    #[default]
    Text,
    /// One JSON object per line on standard output.
    Json,
}

impl From<LogChoice> for Log {
    fn from(choice: LogChoice) -> Self {
        match choice {
            LogChoice::Text => Self::Text,
            LogChoice::Json => Self::Json,
        }
    }
}

/// Prints what a run will take. A scene whose first steps fail gives exit status 1.
fn dry_run(text: &str, path: &Path, threads: Option<u16>, log: LogChoice) -> Result<ExitCode> {
    let forecast = Forecast::of(text, path, threads.map(usize::from))?;
    if log == LogChoice::Json {
        let memory = forecast.memory.total();
        let locking = |(garment, locking): &(String, Locking)| {
            json!({
                "garment": garment,
                "edge": locking.edge,
                "stiffness": locking.stiffness,
                "wasted": locking.wasted,
                "is_nodal": locking.is_nodal,
                "sufficient_edge": locking.sufficient_edge,
                "sufficient_stiffness": locking.sufficient_stiffness,
            })
        };
        print_event(&json!({
            "event": "forecast",
            "vertices": forecast.vertices,
            "pinned": forecast.pinned,
            "triangles": forecast.triangles,
            "steps": forecast.steps,
            "frames": forecast.frames,
            "memory": memory,
            "available_memory": forecast.available,
            "seconds": forecast.time(),
            "warnings": forecast.warnings,
            "locking": forecast.locking.iter().map(locking).collect::<Vec<_>>(),
            "failure": forecast.failure.as_ref().map(ToString::to_string),
        }))?;
    } else {
        forecast.warnings.iter().for_each(|warning| tell(&format!("warning: {warning}")));
        print(&format!("{forecast}\n"))?;
    }
    Ok(if forecast.failure.is_some() { ExitCode::FAILURE } else { ExitCode::SUCCESS })
}

/// Prints a JSON object on a line.
fn print_event(event: &Value) -> Result<()> {
    print(&format!("{event}\n"))
}

fn parameter(text: &str) -> Result<(String, f64), String> {
    let (name, value) = text.split_once('=').ok_or_else(|| "expected a name and a number, such as k=20".to_owned())?;
    let number = value.trim().parse().ok().filter(|value: &f64| value.is_finite());
    let number = number.ok_or_else(|| format!("expected a number for {name}, got `{value}`"))?;
    Ok((name.trim().to_owned(), number))
}

pub fn limit_threads(run: Run, threads: Option<u16>) -> Run {
    match threads {
        Some(threads) => run.with_threads(usize::from(threads)),
        None => run,
    }
}

/// Simulates until the end or a signal, and prints the summary and the files written. The exit code is 128 and the
/// number of the signal if the run was interrupted.
pub fn simulate(mut run: Run, with_stats: bool, log: LogChoice) -> Result<ExitCode> {
    run.notes().iter().for_each(|note| tell(&format!("note: {note}")));
    run.simulation().warnings().iter().for_each(|warning| tell(&format!("warning: {warning}")));
    let interrupts = Interrupts::listen()?;
    let mut progress = Progress::new(run.simulation().steps(), run.simulation().steps_done(), log.into());
    let ended = run.go(interrupts.flag(), |event| match event {
        Event::Step(simulation, report) => progress.step(simulation.steps_done(), report),
        Event::LastStep => progress.last_step(),
    });
    progress.finish();
    let Ending { summary, files, frames, finished, abandoned, failure } = ended?;
    if log == LogChoice::Json {
        print_event(&json!({
            "event": "end",
            "finished": finished && !abandoned,
            "steps": run.simulation().steps_done(),
            "frames": frames,
            "files": files,
            "warnings": summary.warnings,
            "failure": failure.as_ref().map(ToString::to_string),
        }))?;
    }
    let files: String = files.iter().map(|path| format!("wrote {}\n", path.display())).collect();
    let folder = run.folder().path();
    let tables = if with_stats { format!("{}\n", stats::tables(&summary)) } else { String::new() };
    let frame_folder = folder.join(OutputFolder::FRAMES);
    if log == LogChoice::Text {
        print(&format!("{summary}\n\n{tables}{files}wrote {frames} frames to {}\n", frame_folder.display()))?;
    }
    if let Some(failure) = failure {
        let kept = format!("the files hold the {} steps before it", run.simulation().steps_done());
        return Err(anyhow::anyhow!("{failure}; {kept}"));
    }
    if finished && !abandoned {
        return Ok(ExitCode::SUCCESS);
    }
    let resume = match run.leaves_checkpoints() {
        true => format!("resume with `cloth resume {}`", folder.display()),
        false => "pass --checkpoint to be able to resume".to_owned(),
    };
    let missing = if abandoned { ", before all files were written" } else { "" };
    let (done, all) = (run.simulation().steps_done(), run.simulation().steps());
    tell(&format!("stopped after step {done} of {all}{missing}; {resume}"));
    Ok(interrupts.exit_code())
}
