//! The benchmark of idle vertices: the step time of sleeping or pinned vertices over that of moving ones, from one run.

use std::fmt::Write as _;
use std::time::{Duration, Instant};

use comfy_table::{CellAlignment, Table, presets};

use crate::scene::{Scene, SceneError};
use crate::simulation::{Simulation, SimulationError};

/// Sizes of the scenes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sizes {
    /// Cells along each side of the cloth that settles, and of each of the many cloths.
    pub cells: usize,
    /// Number of cloths, of which one moves.
    pub cloths: usize,
    /// Cells along each side of the pinned cloth.
    pub pinned_cells: usize,
    /// Timed steps of each scene.
    pub steps: usize,
}

impl Default for Sizes {
    fn default() -> Self {
        Self { cells: 32, cloths: 100, pinned_cells: 128, steps: 60 }
    }
}

/// A comparison of two step times.
#[derive(Clone, Debug, PartialEq)]
pub struct Ratio {
    /// A description of the two steps.
    pub question: String,
    /// Lower quartile of the first step time.
    pub cost: Duration,
    /// Lower quartile of the second step time.
    pub reference: Duration,
    /// The largest acceptable ratio.
    pub target: f64,
}

impl Ratio {
    /// The ratio of the two times.
    #[must_use]
    pub fn value(&self) -> f64 {
        self.cost.as_secs_f64() / self.reference.as_secs_f64()
    }
}

/// A scene of the benchmark that cannot be set up or run.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SleepBenchError {
    /// The scene is invalid.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The simulation cannot be set up, or a step failed.
    #[error(transparent)]
    Simulation(#[from] SimulationError),
    /// The ledger cannot be opened.
    #[error(transparent)]
    Evaluation(#[from] energy_solve::EvaluationError),
    /// Islands that should sleep are awake.
    #[error("after {steps} steps {awake} islands are still awake")]
    Awake {
        /// Completed steps.
        steps: u64,
        /// Number of islands awake.
        awake: usize,
    },
}

/// Contact of cloth with itself would couple all cloths.
const HEAD: &str = "dt = 0.01\nduration = 1000.0\nintegrator = \"newton\"\ncontact = \"obstacles\"\n\
                    tolerances.velocity = 1e-3\n";
/// Steps within which islands must fall asleep.
const PATIENCE: u64 = 20_000;

/// Returns a garment: a square of cotton, 0.5 m wide, at a position.
fn garment(cells: usize, at: [f64; 2]) -> String {
    let [x, y] = at;
    format!(
        "[[garment]]\nplacement.translate = [{x}, {y}, 0.0]\n\
         mesh.sheet = {{ cells = [{cells}, {cells}], size = [0.5, 0.5] }}\n\
         [garment.fabric]\ndensity = 0.15\n[garment.fabric.material.stvk]\n\
         stretch_stiffness = 50.0\npoisson_ratio = 0.3\n\
         bending.flat.stiffness = 1e-5\n"
    )
}

/// Creates a simulation with a ledger, as `cloth run` does by default.
fn simulation_with_ledger(text: &str) -> Result<Simulation, SleepBenchError> {
    let mut simulation = Simulation::new(&Scene::parse(text, "bench.toml".as_ref())?)?;
    simulation.keep_ledger()?;
    Ok(simulation)
}

fn step(simulation: &mut Simulation) -> Result<Duration, SimulationError> {
    let simulation_with_ledger = Instant::now();
    simulation.step()?;
    Ok(simulation_with_ledger.elapsed())
}

/// Returns the lower quartile: other load on the machine only adds to times.
fn typical(mut times: Vec<Duration>) -> Duration {
    times.sort_unstable();
    times.get(times.len() / 4).copied().unwrap_or_default()
}

/// Simulates until at most `awake` islands are awake.
fn settle(simulation: &mut Simulation, awake: usize) -> Result<(), SleepBenchError> {
    let moving = |simulation: &Simulation| simulation.islands().iter().filter(|island| !island.is_asleep()).count();
    while moving(simulation) > awake {
        if simulation.steps_done() == PATIENCE {
            return Err(SleepBenchError::Awake { steps: PATIENCE, awake: moving(simulation) });
        }
        simulation.step()?;
    }
    Ok(())
}

/// Times two simulations alternately, so that other load on the machine affects both equally.
fn time_alternately(pair: [&mut Simulation; 2], steps: usize) -> Result<[Duration; 2], SimulationError> {
    let [one, other] = pair;
    let (mut times, mut references) = (Vec::new(), Vec::new());
    for turn in 0..steps {
        if turn % 2 == 0 {
            times.push(step(one)?);
        }
        references.push(step(other)?);
        if turn % 2 == 1 {
            times.push(step(one)?);
        }
    }
    Ok([typical(times), typical(references)])
}

/// Compares a hanging cloth after it has settled with its first steps.
fn settled(sizes: &Sizes) -> Result<Ratio, SleepBenchError> {
    let pins = "[[pins]]\nnearest = [-0.25, 0.25, 0.0]\n[[pins]]\nnearest = [0.25, 0.25, 0.0]\n";
    let text = format!("{HEAD}drag = 4.0\nsleep = true\n{}{pins}", garment(sizes.cells, [0.0; 2]));
    let mut simulation = simulation_with_ledger(&text)?;
    let active = (0..sizes.steps).map(|_| step(&mut simulation)).collect::<Result<_, _>>()?;
    settle(&mut simulation, 0)?;
    let asleep = (0..sizes.steps).map(|_| step(&mut simulation)).collect::<Result<_, _>>()?;
    let question = format!("{} vertices asleep, over awake", simulation.positions().len());
    Ok(Ratio { question, cost: typical(asleep), reference: typical(active), target: 0.01 })
}

/// Compares many weightless cloths, of which one is whirled around, with that one alone.
fn one_of_many(sizes: &Sizes) -> Result<Ratio, SleepBenchError> {
    let keys = "keys = [{ time = 0.0 }, { time = 1000.0, angle = 3.6e5 }]";
    let pin = format!("[[pins]]\nof = \"garment 0\"\nnearest = [0.25, 0.25, 0.0]\nmotion = {{ {keys} }}\n");
    let head = format!("{HEAD}gravity = [0.0, 0.0, 0.0]\nsleep.after = 0.05\n");
    let mut text = head.clone();
    for number in 0..sizes.cloths {
        write!(text, "{}", garment(sizes.cells, [(number % 10) as f64, (number / 10) as f64]))
            .expect("writing to a string succeeds");
    }
    let mut many = simulation_with_ledger(&format!("{text}{pin}"))?;
    let mut alone = simulation_with_ledger(&format!("{head}{}{pin}", garment(sizes.cells, [0.0; 2])))?;
    settle(&mut many, 1)?;
    while alone.steps_done() < many.steps_done() {
        alone.step()?;
    }
    let [cost, reference] = time_alternately([&mut many, &mut alone], sizes.steps)?;
    Ok(Ratio { question: format!("1 of {} cloths awake, over it alone", sizes.cloths), cost, reference, target: 1.1 })
}

/// Compares a cloth with 90 % of its vertices pinned with the same cloth held by two corners.
fn mostly_pinned(sizes: &Sizes) -> Result<Ratio, SleepBenchError> {
    let cloth = format!("{HEAD}{}", garment(sizes.pinned_cells, [0.0; 2]));
    let corners = "[[pins]]\nnearest = [-0.25, 0.25, 0.0]\n[[pins]]\nnearest = [0.25, 0.25, 0.0]\n";
    let nine_tenths = "[[pins]]\nbox = { min = [-1.0, -0.2, -1.0], max = [1.0, 1.0, 1.0] }\n";
    let mut pinned = simulation_with_ledger(&format!("{cloth}{nine_tenths}"))?;
    let mut free = simulation_with_ledger(&format!("{cloth}{corners}"))?;
    let [cost, reference] = time_alternately([&mut pinned, &mut free], sizes.steps)?;
    let question = format!("{} vertices, 90 % pinned, over two pinned", free.positions().len());
    Ok(Ratio { question, cost, reference, target: 0.15 })
}

/// Measures all ratios, and calls `report` with each.
///
/// # Errors
/// Returns an error if a scene cannot be simulated, or does not fall asleep.
pub fn measure(sizes: &Sizes, mut report: impl FnMut(&Ratio)) -> Result<Vec<Ratio>, SleepBenchError> {
    type Ask = fn(&Sizes) -> Result<Ratio, SleepBenchError>;
    let all: [Ask; 3] = [settled, one_of_many, mostly_pinned];
    let ratios = all.into_iter().map(|ask| ask(sizes).inspect(&mut report));
    ratios.collect()
}

/// Formats the ratios as a table.
#[must_use]
pub fn table(ratios: &[Ratio]) -> Table {
    let mut table = Table::new();
    table.load_preset(presets::NOTHING);
    table.set_header(["a step of", "ms", "of ms", "ratio", "at most"]);
    for ratio in ratios {
        let milliseconds = |time: Duration| format!("{:.4}", time.as_secs_f64() * 1e3);
        table.add_row([
            ratio.question.clone(),
            milliseconds(ratio.cost),
            milliseconds(ratio.reference),
            format!("{:.5}", ratio.value()),
            ratio.target.to_string(),
        ]);
    }
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}
