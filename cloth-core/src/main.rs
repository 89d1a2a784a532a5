//! `cloth`: runs scenes, shows a demonstration, lists materials.

#![forbid(unsafe_code)]

use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::{Context, Result};
use clap::{Parser, Subcommand};
use cloth_core::bench::{self, Cloth, Measured};
use cloth_core::bench_sleep::{self, Sizes};
use cloth_core::fabric::MEASURED;
use cloth_core::integrator::LinearSolverChoice;
use cloth_core::output::OutputFolder;
use cloth_core::progress::Progress;
use cloth_core::run::{Ending, Run, RunError};
use cloth_core::scene::Scene;
use cloth_core::validate::{self, Cantilever, Finding, LateralBuckling, MeshKind, ValidateError};
use cloth_core::view::{self, Colouring, Moment, Screenshot};
use cloth_core::{Simulation, demo, materials, report, scene, stats, trajectory_error};
use indicatif::{ProgressBar, ProgressStyle};

/// Cloth simulated with audited derivatives.
#[derive(Debug, Parser)]
#[command(version)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Audits the materials of a sheet hung by two corners, simulates it, and writes a picture, an animation and OBJ frames.
    Demo {
        /// Where the files go; those of an earlier demo are replaced.
        #[arg(short, long, default_value = "out")]
        output: PathBuf,
    },
    /// Simulates a scene and writes a picture, an animation and OBJ frames.
    Run {
        /// The scene file (TOML).
        scene: PathBuf,
        /// Where the files go.
        #[arg(short, long)]
        output: PathBuf,
        /// Replace the files of an earlier run.
        #[arg(long)]
        overwrite: bool,
        /// Save the state each time after this many steps, for `cloth resume`.
        #[arg(long, value_name = "STEPS", value_parser = clap::value_parser!(u64).range(1..))]
        checkpoint: Option<u64>,
        /// Makes every fabric of the elements that this file declares, read at run time: slower than those built in.
        #[arg(long, value_name = "FILE.energy")]
        material: Option<PathBuf>,
        /// Their parameters, as in `k=20,nu=0.3`, in the units of the declaration.
        #[arg(long, requires = "material", value_delimiter = ',', value_parser = parameter)]
        parameters: Vec<(String, f64)>,
        /// Prints at the end what each term evaluated, skipped and used again, what slept, and the time of each phase.
        #[arg(long)]
        stats: bool,
        /// At most so many threads, rather than as many as the machine has. What is computed is the same, to the last bit.
        #[arg(long, value_parser = clap::value_parser!(u16).range(1..))]
        threads: Option<u16>,
    },
    /// Goes on with a run that was interrupted, from its last checkpoint: the result is the same bit by bit.
    Resume {
        /// The folder of the run.
        folder: PathBuf,
        /// Prints what `cloth run --stats` prints.
        #[arg(long)]
        stats: bool,
        /// At most so many threads, rather than as many as the machine has.
        #[arg(long, value_parser = clap::value_parser!(u16).range(1..))]
        threads: Option<u16>,
    },
    /// Makes one page, report.html, of a finished run: pictures, energies, times, what was evaluated, and the audit of its elements.
    Report {
        /// The folder of the run.
        folder: PathBuf,
    },
    /// Shows a scene while it is simulated, or plays a finished run, in a window (a build with `--features view`); `--screenshot` needs neither.
    View {
        /// The scene file, or the folder of a run.
        shown: PathBuf,
        /// What colours show; the key c changes it.
        #[arg(long, value_enum, default_value_t)]
        colours: Colouring,
        /// Draws the edges of triangles; the key w changes it.
        #[arg(long)]
        wireframe: bool,
        /// Writes a picture to this PNG file instead of opening a window.
        #[arg(long, value_name = "FILE.png")]
        screenshot: Option<PathBuf>,
        /// With --screenshot: this frame, from 0, rather than the last.
        #[arg(long, requires = "screenshot", conflicts_with = "time")]
        frame: Option<usize>,
        /// With --screenshot: this time, in s.
        #[arg(long, requires = "screenshot", value_parser = not_negative)]
        time: Option<f64>,
    },
    /// Prints the JSON schema of scene files, for editors.
    Schema,
    /// Lists the declared elements: formula, parameters with units, operations per routine.
    Materials,
    /// Compares with known answers: what theory says exactly about strips, sheets and motions. Exit status 1 when one is missed.
    Validate {
        /// `cantilever`, `buckling`, `catenary`, `hanging-strip`, `modes`, `orders`, `momentum`, `long-run`; all if none is named.
        #[arg(value_parser = clap::builder::PossibleValuesParser::new(validate::QUESTIONS))]
        questions: Vec<String>,
        /// Coarser meshes and fewer cases: a few seconds.
        #[arg(long)]
        quick: bool,
        /// A cantilever or, with `buckling`, a strip on edge of your own: Γ = σ g L³/D of the cantilever.
        #[arg(long, value_parser = positive)]
        gamma: Option<f64>,
        /// Poisson's ratio of the plate.
        #[arg(long, value_parser = ratio)]
        nu: Option<f64>,
        /// Width over length.
        #[arg(long, value_parser = positive)]
        aspect: Option<f64>,
        /// The mesh.
        #[arg(long)]
        mesh: Option<MeshKind>,
        /// The angle of the mesh to the strip, in degrees.
        #[arg(long, allow_negative_numbers = true)]
        orientation: Option<f64>,
        /// Edges along the strip.
        #[arg(long, value_parser = clap::value_parser!(u16).range(4..))]
        segments: Option<u16>,
    },
    /// Times a square metre of cloth hung by two corners, implicit Euler by Newton's method, steps of 10 ms.
    Bench {
        /// Vertices along each side.
        #[arg(long, value_delimiter = ',', default_values_t = [33, 65, 129], value_parser = clap::value_parser!(u16).range(2..))]
        sizes: Vec<u16>,
        /// `soft`, `cotton`; both if none is named.
        #[arg(long, value_delimiter = ',', value_parser = cloth_named)]
        cloth: Vec<Cloth>,
        /// Numbers of threads. What is computed is the same, to the last bit.
        #[arg(long, value_delimiter = ',', default_values_t = [1, 2], value_parser = clap::value_parser!(u16).range(1..))]
        threads: Vec<u16>,
        /// What solves the linear systems: `auto`, `over-relaxation`, `multigrid`, `cholesky`, `incomplete-cholesky`.
        #[arg(long, value_delimiter = ',', default_value = "auto", value_parser = solver_named)]
        solver: Vec<LinearSolverChoice>,
        /// How long is simulated, in s. Default: 1, and 0.3 from 129 vertices a side.
        #[arg(long, value_parser = positive)]
        seconds: Option<f64>,
        /// Compares integrators instead: time against error of the trajectory, for steps from 16 to 0.5 ms, and the stable ones of explicit methods.
        #[arg(long)]
        error: bool,
        /// Compares a step of what sleeps or is pinned with one of what moves instead.
        #[arg(long, conflicts_with = "error")]
        sleep: bool,
        /// Prints the figures as JSON instead of a table.
        #[arg(long, conflicts_with_all = ["error", "sleep"])]
        json: bool,
        /// With --error: where the figures go as CSV, Markdown and SVG.
        #[arg(short, long, requires = "error")]
        output: Option<PathBuf>,
    },
    /// Prints fabrics that were measured, as tables for scene files, with their sources.
    Fabrics {
        /// `denim`, `interlock`, `ribbon` or `dots`; all if none is named.
        #[arg(value_parser = clap::builder::PossibleValuesParser::new(MEASURED.map(|fabric| fabric.name)))]
        names: Vec<String>,
    },
}

fn positive(text: &str) -> Result<f64, String> {
    text.parse().ok().filter(|x: &f64| x.is_finite() && *x > 0.0).ok_or_else(|| "it is a number above 0".to_owned())
}

fn not_negative(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|x: &f64| x.is_finite() && *x >= 0.0)
        .ok_or_else(|| "it is a number, 0 or above".to_owned())
}

fn ratio(text: &str) -> Result<f64, String> {
    text.parse().ok().filter(|x: &f64| x.abs() < 1.0).ok_or_else(|| "it is a number between −1 and 1".to_owned())
}

fn parameter(text: &str) -> Result<(String, f64), String> {
    let (name, value) = text.split_once('=').ok_or_else(|| "it is a name and a number, as in k=20".to_owned())?;
    let value = value.trim().parse().ok().filter(|value: &f64| value.is_finite());
    Ok((name.trim().to_owned(), value.ok_or_else(|| format!("what {name} is must be a number"))?))
}

fn cloth_named(name: &str) -> Result<Cloth, String> {
    Cloth::ALL.into_iter().find(|cloth| cloth.name() == name).ok_or_else(|| "it is soft or cotton".to_owned())
}

fn solver_named(name: &str) -> Result<LinearSolverChoice, String> {
    let names = || LinearSolverChoice::ALL.map(LinearSolverChoice::name).join(", ");
    LinearSolverChoice::ALL.into_iter().find(|solver| solver.name() == name).ok_or_else(names)
}

/// Prints findings as they are made; an error when one is missed.
fn validate(ask: impl FnOnce(&mut dyn FnMut(&Finding)) -> Result<(), ValidateError>) -> Result<()> {
    print(&format!("{}\n", validate::head()))?;
    let (mut missed, mut all) = (0, 0);
    ask(&mut |finding| {
        all += 1;
        missed += usize::from(!finding.passed());
        // A reader that has seen enough is no reason to stop.
        let _ = print(&format!("{}\n", validate::line(finding)));
    })?;
    print(&format!("{} of {all} answers within their limits\n", all - missed))?;
    anyhow::ensure!(missed == 0, "{missed} of {all} answers are outside their limits");
    Ok(())
}

fn main() -> ExitCode {
    // A reader that has seen enough (`| head`) ends the program, without a panic.
    sigpipe::reset();
    obey(Arguments::parse().command).unwrap_or_else(|error| {
        eprintln!("error: {}", verify::message(&error));
        ExitCode::FAILURE
    })
}

fn obey(command: Command) -> Result<ExitCode> {
    match command {
        Command::Demo { output } => {
            let scene = demo::scene()?;
            print(&format!("{}\n", demo::audit_materials(&Simulation::new(&scene)?)?))?;
            return run(Run::new(demo::SCENE.to_owned(), "scenes/hang.toml".as_ref(), &output, true, None)?, false);
        }
        Command::Run { scene, output, overwrite, checkpoint, material, parameters, stats, threads } => {
            let mut text = Scene::text(&scene)?;
            if let Some(file) = material {
                text = scene::with_material(&text, &file, &parameters);
            }
            let new = Run::new(text, &scene, &output, overwrite, checkpoint);
            let new = new.map_err(|error| match error {
                RunError::Simulation(unfit) => anyhow::Error::new(unfit).context(scene.display().to_string()),
                located => located.into(),
            })?;
            return run(on_threads(new, threads), stats);
        }
        Command::Resume { folder, stats, threads } => return run(on_threads(Run::resume(&folder)?, threads), stats),
        Command::Report { folder } => print(&format!("wrote {}\n", report::write_report(&folder)?.display())),
        Command::View { shown, colours, wireframe, screenshot: Some(file), frame, time } => {
            let moment = match (frame, time) {
                (Some(frame), _) => Moment::Frame(frame),
                (None, Some(time)) => Moment::Time(time),
                (None, None) => Moment::End,
            };
            let progress = ProgressBar::new_spinner();
            let shot = view::screenshot(&shown, moment, colours, wireframe, || progress.inc(1));
            progress.finish_and_clear();
            let Screenshot { png, time, legend } = shot?;
            verify::write_whole(&file, &png).with_context(|| format!("cannot write {}", file.display()))?;
            print(&format!("wrote {}: t = {time:.4} s, {legend}\n", file.display()))
        }
        Command::View { shown, colours, wireframe, screenshot: None, .. } => open_window(&shown, colours, wireframe),
        Command::Schema => print(&format!("{:#}\n", scene::schema())),
        Command::Materials => print(&materials::listing()),
        Command::Validate { questions, quick, gamma, nu, aspect, mesh, orientation, segments } => {
            let own = gamma.is_some()
                || nu.is_some()
                || aspect.is_some()
                || mesh.is_some()
                || orientation.is_some()
                || segments.is_some();
            if !own {
                validate(|tell| validate::ask(&questions, quick, tell).map(|_| ()))?;
                return Ok(ExitCode::SUCCESS);
            }
            let (poisson_ratio, aspect) = (nu.unwrap_or(0.0), aspect.unwrap_or(0.1));
            let (mesh, orientation) = (mesh.unwrap_or(MeshKind::Diagonal), orientation.unwrap_or(0.0));
            let segments = usize::from(segments.unwrap_or(if quick { 40 } else { 80 }));
            validate(|tell| {
                if questions.iter().any(|question| question == "buckling") {
                    tell(&LateralBuckling { poisson_ratio, aspect, mesh, orientation, segments }.ask()?);
                } else {
                    let gamma = gamma.unwrap_or(1.0);
                    tell(&Cantilever { gamma, poisson_ratio, aspect, mesh, orientation, segments }.ask()?);
                }
                Ok(())
            })
        }
        Command::Fabrics { names } => {
            let wanted =
                MEASURED.iter().filter(|fabric| names.is_empty() || names.iter().any(|name| name == fabric.name));
            print(&wanted.map(|fabric| fabric.table).collect::<Vec<_>>().join("\n"))
        }
        Command::Bench { cloth, error: true, output, .. } => {
            let cloths = if cloth.is_empty() { vec![Cloth::Soft] } else { cloth };
            cloths.into_iter().try_for_each(|cloth| compare(cloth, output.as_deref()))
        }
        Command::Bench { sleep: true, .. } => {
            let progress = ProgressBar::new_spinner();
            let ratios = bench_sleep::measure(&Sizes::default(), |_| progress.inc(1))?;
            progress.finish_and_clear();
            print(&format!("{}\n", bench_sleep::table(&ratios)))
        }
        Command::Bench { sizes, cloth, threads, solver, seconds, json, .. } => {
            let cloths = if cloth.is_empty() { Cloth::ALL.to_vec() } else { cloth };
            let runs = time(&cloths, &threads, &solver, &sizes, seconds)?;
            if json {
                return print(&format!("{}\n", serde_json::to_string(&runs)?)).map(|()| ExitCode::SUCCESS);
            }
            print(&format!("{}\n{}", bench::table(&runs), bench::growth(&runs)))
        }
    }
    .map(|()| ExitCode::SUCCESS)
}

#[cfg(feature = "view")]
fn open_window(shown: &Path, colours: Colouring, wireframe: bool) -> Result<()> {
    Ok(view::open_window(shown, colours, wireframe)?)
}

/// The window's engine is left out of a plain build.
#[cfg(not(feature = "view"))]
fn open_window(_: &Path, _: Colouring, _: bool) -> Result<()> {
    anyhow::bail!(
        "this build has no window; make one that has with `cargo build --release -p cloth-core --features view`, or write a picture with \
         --screenshot FILE.png"
    )
}

fn on_threads(run: Run, threads: Option<u16>) -> Run {
    match threads {
        Some(threads) => run.with_threads(usize::from(threads)),
        None => run,
    }
}

/// Times the benchmark's scene.
fn time(
    cloths: &[Cloth],
    threads: &[u16],
    solvers: &[LinearSolverChoice],
    sizes: &[u16],
    seconds: Option<f64>,
) -> Result<Vec<Measured>> {
    let mut runs = Vec::new();
    for &cloth in cloths {
        for &threads in threads {
            for &solver in solvers {
                let run = |&size| HangRun { cloth, size, threads, solver, seconds: seconds.unwrap_or(simulated(size)) };
                runs.extend(sizes.iter().map(run));
            }
        }
    }
    match &*runs {
        [run] => Ok(vec![run.measure()?]),
        runs => runs.iter().map(HangRun::measure_apart).collect(),
    }
}

/// How long a sheet of this size is simulated, in s, where nothing else is said.
fn simulated(size: u16) -> f64 {
    if size < 129 { 1.0 } else { 0.3 }
}

/// A run of the benchmark.
struct HangRun {
    cloth: Cloth,
    size: u16,
    threads: u16,
    solver: LinearSolverChoice,
    seconds: f64,
}

impl HangRun {
    fn measure(&self) -> Result<Measured> {
        let &Self { cloth, size, threads, solver, seconds } = self;
        let progress = progress_bar((seconds / 0.01).round() as u64);
        let cells = usize::from(size) - 1;
        let measured = bench::measure(cloth, cells, usize::from(threads), solver, seconds, || progress.inc(1))?;
        progress.finish_and_clear();
        Ok(measured)
    }

    /// In a process of its own, so that memory which others have left does not count.
    fn measure_apart(&self) -> Result<Measured> {
        let Self { cloth, size, threads, solver, seconds } = self;
        let mut itself = std::process::Command::new(std::env::current_exe().context("where this program is")?);
        itself.args(["bench", "--json", "--cloth", cloth.name(), "--solver", solver.name()]);
        itself.args([format!("--sizes={size}"), format!("--threads={threads}"), format!("--seconds={seconds}")]);
        let done = itself.stderr(std::process::Stdio::inherit()).output().context("running a part of the benchmark")?;
        anyhow::ensure!(done.status.success(), "{} at {size} vertices a side ended with {}", cloth.name(), done.status);
        let [measured] = serde_json::from_slice(&done.stdout).context("the figures of a part of the benchmark")?;
        Ok(measured)
    }
}

/// Compares the integrators, prints the table, and writes it.
fn compare(cloth: Cloth, output: Option<&Path>) -> Result<()> {
    let progress = progress_bar(0);
    let runs = trajectory_error::compare(cloth, |done, total| {
        progress.set_length(total as u64);
        progress.set_position(done as u64);
    })?;
    progress.finish_and_clear();
    let table = trajectory_error::markdown(&runs);
    print(&format!("{} cloth\n\n{table}\n", cloth.name()))?;
    if let Some(path) = output {
        std::fs::create_dir_all(path).with_context(|| format!("cannot make the folder {}", path.display()))?;
        let picture = trajectory_error::svg(&runs).map_err(anyhow::Error::msg)?;
        for (extension, text) in [("csv", trajectory_error::csv(&runs)), ("md", table), ("svg", picture)] {
            let file = path.join(format!("{}-error.{extension}", cloth.name()));
            verify::write_whole(&file, text.as_bytes()).with_context(|| format!("cannot write {}", file.display()))?;
        }
    }
    Ok(())
}

/// Simulates to the end or until interrupted, and says what was written.
fn run(mut run: Run, with_stats: bool) -> Result<ExitCode> {
    run.simulation().warnings().iter().for_each(|warning| eprintln!("warning: {warning}"));
    let interrupted = interruption()?;
    let mut progress = Progress::new(run.simulation().steps(), run.simulation().steps_done());
    let ended = run.go(interrupted, |simulation, report| progress.step(simulation.steps_done(), report));
    progress.finish();
    let Ending { summary, files, frames, finished } = ended?;
    let files: String = files.iter().map(|path| format!("wrote {}\n", path.display())).collect();
    let folder = run.folder().path();
    let tables = if with_stats { format!("{}\n", stats::tables(&summary)) } else { String::new() };
    print(&format!(
        "{summary}\n\n{tables}{files}wrote {frames} frames to {}\n",
        folder.join(OutputFolder::FRAMES).display()
    ))?;
    if finished {
        return Ok(ExitCode::SUCCESS);
    }
    let resume = match run.leaves_checkpoints() {
        true => format!("go on with `cloth resume {}`", folder.display()),
        false => "with --checkpoint it could be resumed".to_owned(),
    };
    eprintln!("stopped after step {} of {}; {resume}", summary.steps, run.simulation().steps());
    Ok(ExitCode::from(130))
}

/// Set by Ctrl-C; a second one ends the program at once.
fn interruption() -> Result<&'static AtomicBool> {
    static INTERRUPTED: AtomicBool = AtomicBool::new(false);
    ctrlc::set_handler(|| {
        if INTERRUPTED.swap(true, Ordering::Relaxed) {
            std::process::exit(130);
        }
    })
    .context("cannot listen for Ctrl-C")?;
    Ok(&INTERRUPTED)
}

/// Prints to standard output. A reader that has seen enough (`| head`) is no error.
fn print(text: &str) -> Result<()> {
    match std::io::stdout().lock().write_all(text.as_bytes()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => Err(error).context("cannot print"),
        _ => Ok(()),
    }
}

/// Hidden where standard error is not a terminal.
fn progress_bar(steps: u64) -> ProgressBar {
    let style = ProgressStyle::with_template("{wide_bar} step {pos}/{len}, {eta} left").expect("the template is valid");
    ProgressBar::new(steps).with_style(style)
}
