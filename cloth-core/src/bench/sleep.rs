//! The other benchmark: what cannot move costs nothing. Ratios of times from one run: a step of what sleeps, or is pinned, over one of what moves.

use std::fmt::Write as _;
use std::time::{Duration, Instant};

use comfy_table::{CellAlignment, Table, presets};

use crate::scene::{Scene, SceneError};
use crate::simulation::{Simulation, SimulationError};

/// How large the scenes are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sizes {
    /// Cells along each side of the cloth that settles, and of each of many.
    pub cells: usize,
    /// How many there are, of which one moves.
    pub cloths: usize,
    /// Cells along each side of the cloth that is pinned.
    pub pinned_cells: usize,
    /// Steps that are timed of each.
    pub steps: usize,
}

impl Default for Sizes {
    fn default() -> Self {
        Self { cells: 32, cloths: 100, pinned_cells: 128, steps: 60 }
    }
}

/// What costs nothing, or should.
#[derive(Clone, Debug, PartialEq)]
pub struct Ratio {
    /// What is compared with what.
    pub question: String,
    /// A step of the one, the lower quartile of all.
    pub cost: Duration,
    /// A step of the other, likewise.
    pub reference: Duration,
    /// The most that the one may cost of the other.
    pub target: f64,
}

impl Ratio {
    /// The one over the other.
    #[must_use]
    pub fn value(&self) -> f64 {
        self.cost.as_secs_f64() / self.reference.as_secs_f64()
    }
}

/// A scene of the benchmark that could not be set up or run.
#[derive(Debug, thiserror::Error)]
pub enum SleepBenchError {
    /// Its text.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// Setting up, or a step.
    #[error(transparent)]
    Simulation(#[from] SimulationError),
    /// The ledger.
    #[error(transparent)]
    Evaluation(#[from] energy_solve::EvaluationError),
    /// It should have fallen asleep.
    #[error("after {steps} steps {awake} islands are still awake")]
    Awake {
        /// Steps done.
        steps: u64,
        /// Islands that should sleep.
        awake: usize,
    },
}

const HEAD: &str = "dt = 0.01\nduration = 1000.0\nintegrator = \"newton\"\ntolerances.velocity = 1e-3\n";
/// It must be asleep after so many steps.
const PATIENCE: u64 = 20_000;

/// A square of cotton, half a metre wide, as one garment of several.
fn garment(cells: usize, at: [f64; 2]) -> String {
    let [x, y] = at;
    format!(
        "[[garment]]\nplacement.translate = [{x}, {y}, 0.0]\nmesh.sheet = {{ cells = [{cells}, {cells}], size = [0.5, 0.5] }}\n\
         [garment.fabric]\ndensity = 0.15\n[garment.fabric.material.stvk]\nstretch_stiffness = 50.0\npoisson_ratio = 0.3\n\
         bending.flat.stiffness = 1e-5\n"
    )
}

/// With its ledger, as `cloth run` does by default.
fn started(text: &str) -> Result<Simulation, SleepBenchError> {
    let mut simulation = Simulation::new(&Scene::parse(text, "bench.toml".as_ref())?)?;
    simulation.keep_ledger()?;
    Ok(simulation)
}

fn step(simulation: &mut Simulation) -> Result<Duration, SimulationError> {
    let started = Instant::now();
    simulation.step()?;
    Ok(started.elapsed())
}

/// The lower quartile: what else the machine does only adds to times.
fn typical(mut times: Vec<Duration>) -> Duration {
    times.sort_unstable();
    times.get(times.len() / 4).copied().unwrap_or_default()
}

/// Steps until no more islands than that are awake.
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

/// Both in turns, so that what else the machine does is felt by both.
fn in_turns(pair: [&mut Simulation; 2], steps: usize) -> Result<[Duration; 2], SimulationError> {
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

/// A cloth hung by two corners, once it has settled, over its first steps.
fn settled(sizes: &Sizes) -> Result<Ratio, SleepBenchError> {
    let pins = "[[pins]]\nnearest = [-0.25, 0.25, 0.0]\n[[pins]]\nnearest = [0.25, 0.25, 0.0]\n";
    let text = format!("{HEAD}drag = 4.0\nsleep = true\n{}{pins}", garment(sizes.cells, [0.0; 2]));
    let mut simulation = started(&text)?;
    let active = (0..sizes.steps).map(|_| step(&mut simulation)).collect::<Result<_, _>>()?;
    settle(&mut simulation, 0)?;
    let asleep = (0..sizes.steps).map(|_| step(&mut simulation)).collect::<Result<_, _>>()?;
    let question = format!("{} vertices asleep, over awake", simulation.positions().len());
    Ok(Ratio { question, cost: typical(asleep), reference: typical(active), target: 0.01 })
}

/// Many cloths without weight, of which one is whirled around, over that one alone.
fn one_of_many(sizes: &Sizes) -> Result<Ratio, SleepBenchError> {
    let keys = "keys = [{ time = 0.0 }, { time = 1000.0, angle = 3.6e5 }]";
    let pin = format!("[[pins]]\nof = \"garment 0\"\nnearest = [0.25, 0.25, 0.0]\nmotion = {{ {keys} }}\n");
    let head = format!("{HEAD}gravity = [0.0, 0.0, 0.0]\nsleep.after = 0.05\n");
    let mut text = head.clone();
    for number in 0..sizes.cloths {
        write!(text, "{}", garment(sizes.cells, [(number % 10) as f64, (number / 10) as f64]))
            .expect("writing to a string succeeds");
    }
    let mut many = started(&format!("{text}{pin}"))?;
    let mut alone = started(&format!("{head}{}{pin}", garment(sizes.cells, [0.0; 2])))?;
    settle(&mut many, 1)?;
    while alone.steps_done() < many.steps_done() {
        alone.step()?;
    }
    let [cost, reference] = in_turns([&mut many, &mut alone], sizes.steps)?;
    Ok(Ratio { question: format!("1 of {} cloths awake, over it alone", sizes.cloths), cost, reference, target: 1.1 })
}

/// A cloth with nine tenths of its vertices pinned, over the same held by two corners.
fn mostly_pinned(sizes: &Sizes) -> Result<Ratio, SleepBenchError> {
    let cloth = format!("{HEAD}{}", garment(sizes.pinned_cells, [0.0; 2]));
    let corners = "[[pins]]\nnearest = [-0.25, 0.25, 0.0]\n[[pins]]\nnearest = [0.25, 0.25, 0.0]\n";
    let nine_tenths = "[[pins]]\nbox = { min = [-1.0, -0.2, -1.0], max = [1.0, 1.0, 1.0] }\n";
    let mut pinned = started(&format!("{cloth}{nine_tenths}"))?;
    let mut free = started(&format!("{cloth}{corners}"))?;
    let [cost, reference] = in_turns([&mut pinned, &mut free], sizes.steps)?;
    let question = format!("{} vertices, 90 % pinned, over two pinned", free.positions().len());
    Ok(Ratio { question, cost, reference, target: 0.15 })
}

/// Measures what sleeps and what is pinned, telling each ratio as it is known.
///
/// # Errors
/// When a scene cannot be simulated, or does not fall asleep.
pub fn measure(sizes: &Sizes, mut tell: impl FnMut(&Ratio)) -> Result<Vec<Ratio>, SleepBenchError> {
    type Ask = fn(&Sizes) -> Result<Ratio, SleepBenchError>;
    let all: [Ask; 3] = [settled, one_of_many, mostly_pinned];
    let told = all.into_iter().map(|ask| ask(sizes).inspect(&mut tell));
    told.collect()
}

/// The ratios as a table.
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
