use std::time::Duration;

use comfy_table::{CellAlignment, Table, presets};

use super::Measured;
use crate::integrator::Phases;

/// Formats the runs as a table, with the growth of the step time from mesh to mesh.
#[must_use]
pub fn table(runs: &[Measured]) -> Table {
    let mut table = Table::new();
    table.load_preset(presets::NOTHING);
    table.set_header([
        "cloth",
        "vertices",
        "threads",
        "solver",
        "contact",
        "ms/step",
        "Newton/step",
        "CG/Newton",
        "assembly",
        "factor",
        "solve",
        "line search",
        "collision",
        "set-up ms",
        "peak MB",
        "lowest m",
        "growth",
        "of one thread",
        "of no contact",
        "solved by",
    ]);
    for run in runs {
        let milliseconds = |time: Duration| time.as_secs_f64() * 1e3;
        let step_time = |run: &Measured| 1e3 * run.step_time();
        let share = |time: Duration| format!("{:.0} %", 100.0 * time.as_secs_f64() / run.time.as_secs_f64());
        let Phases { assembly, factorisation, solve, line_search, collision, .. } = run.report.phases;
        let comparable = runs.iter().filter(|other| other.kind() == run.kind());
        let smaller = comparable.filter(|other| other.vertices < run.vertices);
        let before = smaller.max_by_key(|other| other.vertices);
        let growth =
            before.map_or("–".to_owned(), |before| format!("{:.2}", exponent(&[before.point(), run.point()])));
        let with = |threads: usize, contact: bool| {
            let kind = (run.cloth, threads, run.linear_solver, contact);
            let other = runs.iter().find(|other| other.vertices == run.vertices && other.kind() == kind);
            other.map_or("–".to_owned(), |other| format!("× {:.2}", step_time(run) / step_time(other)))
        };
        let alone = if run.threads > 1 { with(1, run.contact) } else { "–".to_owned() };
        let without_contact = if run.contact { with(run.threads, false) } else { "–".to_owned() };
        table.add_row([
            run.cloth.name().to_owned(),
            run.vertices.to_string(),
            run.threads.to_string(),
            run.linear_solver.name().to_owned(),
            if run.contact { "on" } else { "off" }.to_owned(),
            format!("{:.2}", step_time(run)),
            format!("{:.1}", run.report.solves as f64 / run.steps as f64),
            format!("{:.1}", run.report.iterations as f64 / run.report.solves as f64),
            share(assembly),
            share(factorisation),
            share(solve),
            share(line_search),
            share(collision),
            format!("{:.0}", milliseconds(run.set_up)),
            run.peak_memory.map_or("–".to_owned(), |bytes| format!("{:.0}", bytes as f64 / 1e6)),
            format!("{:.4}", run.lowest),
            growth,
            alone,
            without_contact,
            run.report.solved_by.to_string(),
        ]);
    }
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}

/// Returns the exponent p of t ~ nᵖ, where t is the step time and n the number of vertices, by least squares of ln t.
/// One line per fabric, number of threads, solver and contact with at least three sizes.
#[must_use]
pub fn growth(runs: &[Measured]) -> String {
    let mut lines = String::new();
    for (number, run) in runs.iter().enumerate() {
        if runs[..number].iter().any(|earlier| earlier.kind() == run.kind()) {
            continue;
        }
        let comparable = runs.iter().filter(|other| other.kind() == run.kind());
        let points: Vec<[f64; 2]> = comparable.map(Measured::point).collect();
        if points.len() >= 3 {
            let threads = if run.threads == 1 { "thread" } else { "threads" };
            let contact = if run.contact { ", with contact" } else { "" };
            let of = format!("{}, {} {threads}{contact}", run.cloth.name(), run.threads);
            lines += &format!("{of}: a step's time grows as vertices ^ {:.2}\n", exponent(&points));
        }
    }
    lines
}

/// Fits p of t = c nᵖ to points (n, t), by least squares of the logarithms.
fn exponent(points: &[[f64; 2]]) -> f64 {
    let count = points.len() as f64;
    let logarithms = points.iter().map(|point| point.map(f64::ln));
    let mean = |axis: usize| logarithms.clone().map(|point| point[axis]).sum::<f64>() / count;
    let [n, t] = [mean(0), mean(1)];
    let (mut across, mut along) = (0.0, 0.0);
    for [x, y] in logarithms.clone() {
        across += (x - n) * (y - t);
        along += (x - n) * (x - n);
    }
    across / along
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn powers_are_fitted() {
        let points = |p: f64| [10.0_f64, 20.0, 70.0].map(|n| [n, 3.0 * n.powf(p)]);
        assert!((exponent(&points(1.2)) - 1.2).abs() < 1e-12);
        // The same factor off at both ends: the slope is unchanged.
        let off = [[1.0, 2.0], [4.0, 4.0], [16.0, 32.0]];
        assert!((exponent(&off) - 1.0).abs() < 1e-12);
    }
}
