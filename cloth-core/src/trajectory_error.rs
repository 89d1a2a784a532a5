//! What a step costs and what it buys: time against error of the trajectory, for each integrator.

use std::fmt::Write as _;
use std::time::Instant;

use plotters::prelude::*;

use crate::bench::{self, BenchError, Cloth};
use crate::integrator::{Scheme, StepError};
use crate::mesh::{norm, subtract};
use crate::validate::{ValidateError, runge_kutta};

/// A run of an integrator.
#[derive(Clone, Debug, PartialEq)]
pub struct Run {
    /// The integrator.
    pub integrator: &'static str,
    /// Its step, in s.
    pub dt: f64,
    /// The time it took, in s.
    pub wall: f64,
    /// How far the vertex that is farthest off is from where it should be at the end, in m; or why the run failed.
    pub error: Result<f64, StepError>,
    /// By how much halving the step from that of the run before raised the accuracy, as a power of 2.
    pub order: Option<f64>,
}

/// A comparison that could not be made.
#[derive(Debug, thiserror::Error)]
pub enum ComparisonError {
    /// The scene.
    #[error(transparent)]
    Scene(#[from] BenchError),
    /// The reference.
    #[error("the reference: {0}")]
    Reference(#[from] ValidateError),
}

/// Cells along each side of the sheet.
const CELLS: usize = 16;
/// The time simulated, in s.
const TIME: f64 = 0.32;
/// Steps of the reference, a Runge–Kutta method of fourth order.
const REFERENCE_STEPS: usize = 12_800;
/// How often the step is halved.
const HALVINGS: usize = 5;
/// How many runs [`compare`] makes.
pub const RUNS: u64 = (Scheme::ALL.len() * (HALVINGS + 1)) as u64;

/// Runs the benchmark's hanging sheet of 17 × 17 vertices with steps of 16 ms halved down to 0.5 ms, for every integrator.
///
/// # Errors
/// When the scene or the reference fails. A run that fails is a result.
pub fn compare(cloth: Cloth, mut progress: impl FnMut()) -> Result<Vec<Run>, ComparisonError> {
    let mut truth = bench::hang(cloth, CELLS)?;
    runge_kutta(&mut truth, TIME, REFERENCE_STEPS)?;
    let mut runs: Vec<Run> = Vec::new();
    for scheme in Scheme::ALL {
        let mut before: Option<f64> = None;
        for halvings in 0..=HALVINGS {
            let steps = 20_usize << halvings;
            let (mut body, mut scheme) = (bench::hang(cloth, CELLS)?, scheme.integrator());
            let dt = TIME / steps as f64;
            let started = Instant::now();
            let stepped = (0..steps).try_for_each(|_| scheme.step(&mut body, dt).map(|_| ()));
            let wall = started.elapsed().as_secs_f64();
            let off = || body.x.iter().zip(&truth.x).map(|(x, y)| norm(subtract(*x, *y))).fold(0.0, f64::max);
            let error = stepped.map(|()| off());
            let order = before.zip(error.as_ref().ok()).map(|(before, after)| (before / after).log2());
            before = error.as_ref().ok().copied();
            runs.push(Run { integrator: scheme.name(), dt, wall, error, order });
            progress();
        }
    }
    Ok(runs)
}

/// The runs as comma-separated values.
#[must_use]
pub fn csv(runs: &[Run]) -> String {
    let mut text = "integrator,dt_s,wall_s,error_m,order,failure\n".to_owned();
    for run in runs {
        let error = run.error.as_ref().map_or(String::new(), |error| format!("{error:.6e}"));
        let failure =
            run.error.as_ref().err().map_or(String::new(), |error| error.to_string().replace(['"', '\n'], " "));
        let order = run.order.map_or(String::new(), |order| format!("{order:.3}"));
        writeln!(text, "{},{},{:.6},{error},{order},\"{failure}\"", run.integrator, run.dt, run.wall)
            .expect("writing to a string succeeds");
    }
    text
}

/// The runs as a table in Markdown.
#[must_use]
pub fn markdown(runs: &[Run]) -> String {
    let mut text = "| integrator | dt, ms | time, ms | error, mm | order |\n|---|---:|---:|---:|---:|\n".to_owned();
    for run in runs {
        let error = run.error.as_ref().map_or("failed".to_owned(), |error| format!("{:.4}", 1e3 * error));
        let order = run.order.map_or("–".to_owned(), |order| format!("{order:.2}"));
        writeln!(text, "| {} | {} | {:.1} | {error} | {order} |", run.integrator, 1e3 * run.dt, 1e3 * run.wall)
            .expect("writing to a string succeeds");
    }
    text
}

/// Time against error as an SVG, both axes logarithmic; runs off by more than a metre are left out.
///
/// # Errors
/// When there is nothing to draw.
pub fn svg(runs: &[Run]) -> Result<String, String> {
    let points: Vec<(&'static str, f64, f64)> = runs
        .iter()
        .filter_map(|run| Some((run.integrator, run.wall.max(1e-9), *run.error.as_ref().ok()?)))
        .filter(|(_, _, error)| *error > 0.0 && *error < 1.0)
        .collect();
    if points.is_empty() {
        return Err("no run came near the reference".into());
    }
    let mut text = String::new();
    draw(&mut text, &points).map_err(|error| error.to_string())?;
    Ok(text)
}

fn draw(text: &mut String, points: &[(&'static str, f64, f64)]) -> Result<(), Box<dyn std::error::Error>> {
    let range = |of: fn(&(&'static str, f64, f64)) -> f64| {
        let (low, high) =
            points.iter().map(of).fold((f64::INFINITY, 0.0_f64), |(low, high), x| (low.min(x), high.max(x)));
        (0.7 * low..1.4 * high).log_scale()
    };
    let area = SVGBackend::with_string(text, (800, 500)).into_drawing_area();
    area.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&area)
        .caption("time against error", ("sans-serif", 18))
        .margin(12)
        .x_label_area_size(36)
        .y_label_area_size(64)
        .build_cartesian_2d(range(|point| point.1), range(|point| point.2))?;
    chart.configure_mesh().x_desc("time, s").y_desc("error, m").light_line_style(WHITE).draw()?;
    let mut names: Vec<&'static str> = points.iter().map(|point| point.0).collect();
    names.dedup();
    for (number, name) in names.into_iter().enumerate() {
        let colour = Palette99::pick(number).to_rgba();
        let line = points.iter().filter(|point| point.0 == name).map(|point| (point.1, point.2));
        chart
            .draw_series(LineSeries::new(line, colour.stroke_width(2)))?
            .label(name)
            .legend(move |(x, y)| PathElement::new(vec![(x, y), (x + 18, y)], colour.stroke_width(2)));
    }
    chart.configure_series_labels().background_style(WHITE.mix(0.8)).border_style(BLACK).draw()?;
    area.present()?;
    Ok(())
}
