use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, Stdio};
use std::sync::atomic::Ordering;

use anyhow::{Context, Result};
use clap::{Args, ValueEnum};
use cloth_core::bench::sleep::{self, Sizes};
use cloth_core::bench::{self, Cloth, Measured, local_error, trajectory_error};
use cloth_core::physics::integrator::LinearSolverChoice;
use cloth_core::scene::Scene;
use energy_cli::Interrupts;
use indicatif::ProgressBar;

use super::allowed_folders::AllowedFolders;
use super::{positive, print, progress_bar};

#[derive(Debug, Args)]
pub struct Bench {
    /// Vertices along each side.
    #[arg(
        long,
        value_delimiter = ',',
        default_values_t = [33, 65, 129],
        value_parser = clap::value_parser!(u16).range(2..),
    )]
    sizes: Vec<u16>,
    /// `soft`, `cotton`; default: both.
    #[arg(long, value_delimiter = ',', value_parser = cloth_by_name)]
    cloth: Vec<Cloth>,
    /// Numbers of threads. Results are bit-identical.
    #[arg(
        long,
        value_delimiter = ',',
        default_values_t = [1, 2],
        value_parser = clap::value_parser!(u16).range(1..),
    )]
    threads: Vec<u16>,
    /// Linear solvers: `auto`, `over-relaxation`, `multigrid`, `cholesky`.
    #[arg(long, value_delimiter = ',', default_value = "auto", value_parser = solver_by_name)]
    solver: Vec<LinearSolverChoice>,
    /// Contact of the cloth with itself: `off`, `on`. Cotton touches nothing, so the difference is what searches cost.
    #[arg(long, value_delimiter = ',', default_value = "off")]
    contact: Vec<Contact>,
    /// Simulated time, in s. Default: 1, or 0.3 from 129 vertices per side.
    #[arg(long, value_parser = positive)]
    seconds: Option<f64>,
    /// Compare integrators instead: wall time against trajectory error, for steps from 16 to 0.5 ms, or for the
    /// largest stable steps of an explicit method. With a scene: its distance from a reference with a sixteenth of the
    /// step, 0.1 s after each of six states of the reference.
    #[arg(long)]
    error: bool,
    /// Scene file (TOML) whose local error to measure.
    #[arg(requires = "error")]
    scene: Option<PathBuf>,
    #[command(flatten)]
    allowed: AllowedFolders,
    /// Compare the time per step of sleeping or pinned vertices with that of moving ones instead.
    #[arg(long, conflicts_with = "error")]
    sleep: bool,
    /// Print the figures as JSON instead of a table. With --error for a scene only.
    #[arg(long, conflicts_with = "sleep")]
    json: bool,
    /// With --error and no scene: output folder for the figures as CSV, Markdown and SVG.
    #[arg(short, long, requires = "error", conflicts_with = "scene")]
    output: Option<PathBuf>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Contact {
    Off,
    On,
}

impl Bench {
    pub fn run(&self) -> Result<ExitCode> {
        match &self.scene {
            Some(scene) => self.measure_local_error(scene),
            None => self.measure_sheets().map(|()| ExitCode::SUCCESS),
        }
    }

    /// Measures the error of a scene, on the first number of threads.
    fn measure_local_error(&self, path: &Path) -> Result<ExitCode> {
        let text = Scene::text(path)?;
        self.allowed.check(&text, path)?;
        let scene = Scene::parse(&text, path)?;
        let interrupts = Interrupts::listen()?;
        let progress = progress_bar(0);
        let on_step = |done: u64, total: u64| {
            progress.set_length(total);
            progress.set_position(done);
            !interrupts.flag().load(Ordering::Relaxed)
        };
        let threads = self.threads.first().map(|&threads| usize::from(threads));
        let measured = local_error::measure(&scene, threads, on_step);
        progress.finish_and_clear();
        match measured.with_context(|| path.display().to_string())? {
            None => return Ok(interrupts.exit_code()),
            Some(error) if self.json => print(&format!("{}\n", serde_json::to_string(&error)?))?,
            Some(error) => print(&local_error::table(&error))?,
        }
        Ok(ExitCode::SUCCESS)
    }

    fn measure_sheets(&self) -> Result<()> {
        if self.error {
            anyhow::ensure!(!self.json, "--json with --error needs a scene");
            let cloths = if self.cloth.is_empty() { &[Cloth::Soft] } else { &*self.cloth };
            return cloths.iter().try_for_each(|&cloth| compare_integrators(cloth, self.output.as_deref()));
        }
        if self.sleep { compare_sleep() } else { self.time_steps() }
    }

    fn time_steps(&self) -> Result<()> {
        let measured = match &*self.runs() {
            [run] => vec![run.measure()?],
            runs => runs.iter().map(HangRun::measure_in_own_process).collect::<Result<_>>()?,
        };
        if self.json {
            return print(&format!("{}\n", serde_json::to_string(&measured)?));
        }
        print(&format!("{}\n{}", bench::table(&measured), bench::growth(&measured)))
    }

    /// Returns one run for each combination of cloth, threads, solver, size and contact.
    fn runs(&self) -> Vec<HangRun> {
        let cloths = if self.cloth.is_empty() { &Cloth::ALL } else { &*self.cloth };
        let mut runs = Vec::new();
        for &cloth in cloths {
            for &threads in &self.threads {
                for &solver in &self.solver {
                    for &size in &self.sizes {
                        let seconds = self.seconds.unwrap_or(if size < 129 { 1.0 } else { 0.3 });
                        let run = |&contact| HangRun { cloth, size, threads, solver, contact, seconds };
                        runs.extend(self.contact.iter().map(run));
                    }
                }
            }
        }
        runs
    }
}

/// One run of the benchmark.
struct HangRun {
    cloth: Cloth,
    /// Vertices along each side.
    size: u16,
    threads: u16,
    solver: LinearSolverChoice,
    contact: Contact,
    /// Simulated time, in s.
    seconds: f64,
}

impl HangRun {
    fn measure(&self) -> Result<Measured> {
        let &Self { cloth, size, threads, solver, contact, seconds } = self;
        let progress = progress_bar((seconds / 0.01).round() as u64);
        let cells = usize::from(size) - 1;
        let measured =
            bench::measure(cloth, cells, usize::from(threads), solver, contact == Contact::On, seconds, || {
                progress.inc(1)
            })?;
        progress.finish_and_clear();
        Ok(measured)
    }

    /// Measures in a child process, so that the peak memory of earlier runs does not count.
    fn measure_in_own_process(&self) -> Result<Measured> {
        let Self { cloth, size, threads, solver, contact, seconds } = self;
        let contact = if *contact == Contact::On { "on" } else { "off" };
        let mut child = Command::new(std::env::current_exe().context("cannot find the path of this program")?);
        child.args(["bench", "--json", "--cloth", cloth.name(), "--solver", solver.name(), "--contact", contact]);
        child.args([format!("--sizes={size}"), format!("--threads={threads}"), format!("--seconds={seconds}")]);
        let done = child.stderr(Stdio::inherit()).output().context("cannot start a run of the benchmark")?;
        anyhow::ensure!(done.status.success(), "{} at {size} vertices per side: {}", cloth.name(), done.status);
        let [measured] = serde_json::from_slice(&done.stdout).context("cannot read the figures of a run")?;
        Ok(measured)
    }
}

fn compare_sleep() -> Result<()> {
    let progress = ProgressBar::new_spinner();
    let ratios = sleep::measure(&Sizes::default(), |_| progress.inc(1))?;
    progress.finish_and_clear();
    print(&format!("{}\n", sleep::table(&ratios)))
}

/// Compares the integrators, prints the table and, if asked for, writes it to a folder.
fn compare_integrators(cloth: Cloth, output: Option<&Path>) -> Result<()> {
    let progress = progress_bar(0);
    let runs = trajectory_error::compare(cloth, |done, total| {
        progress.set_length(total as u64);
        progress.set_position(done as u64);
    })?;
    progress.finish_and_clear();
    let table = trajectory_error::markdown(&runs);
    print(&format!("{} cloth\n\n{table}\n", cloth.name()))?;
    if let Some(path) = output {
        std::fs::create_dir_all(path).with_context(|| format!("cannot create the folder {}", path.display()))?;
        let picture = trajectory_error::svg(&runs).map_err(anyhow::Error::msg)?;
        for (extension, text) in [("csv", trajectory_error::csv(&runs)), ("md", table), ("svg", picture)] {
            let file = path.join(format!("{}-error.{extension}", cloth.name()));
            energy_cli::write_whole(&file, text.as_bytes())
                .with_context(|| format!("cannot write {}", file.display()))?;
        }
    }
    Ok(())
}

fn cloth_by_name(name: &str) -> Result<Cloth, String> {
    let cloth = Cloth::ALL.into_iter().find(|cloth| cloth.name() == name);
    cloth.ok_or_else(|| "expected `soft` or `cotton`".to_owned())
}

fn solver_by_name(name: &str) -> Result<LinearSolverChoice, String> {
    let names = || LinearSolverChoice::ALL.map(LinearSolverChoice::name).join(", ");
    let solver = LinearSolverChoice::ALL.into_iter().find(|solver| solver.name() == name);
    solver.ok_or_else(|| format!("expected one of {}", names()))
}
