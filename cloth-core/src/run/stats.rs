//! Tables of evaluation counts and times.

use std::fmt::Write as _;

use comfy_table::{CellAlignment, Table, presets};
use energy_solve::Counts;

use crate::integrator::{ContactWork, SolvedBy};
use crate::simulation::{Summary, TermSummary, Totals};

/// Formats a table with one row per term: its elements; the values, gradients and Hessians that were evaluated or
/// skipped, because all their vertices are pinned; and the numbers of flagged, projected and reused ones. Islands,
/// linear solvers and the time of each phase follow, if the integrator measures it.
///
/// ```
/// use cloth_core::{Simulation, run::stats};
///
/// let mut simulation = Simulation::new(&cloth_core::demo::scene()?)?;
/// simulation.step()?;
/// let text = stats::tables(&simulation.summary()?);
/// assert!(text.contains("membrane") && text.contains("1 island"), "{text}");
/// # Ok::<(), anyhow::Error>(())
/// ```
#[must_use]
pub fn tables(summary: &Summary) -> String {
    let mut text = format!("{}\n\n{}\n", terms(summary), summary.sleep());
    if summary.totals.solved_by != SolvedBy::default() {
        writeln!(text, "linear systems solved by {}", summary.totals.solved_by).expect("writing to a string succeeds");
    }
    let crossings = match summary.crossings {
        0 => "no edge crosses a triangle at the end".to_owned(),
        count => format!("{count} times an edge crosses a triangle at the end"),
    };
    writeln!(text, "{crossings}").expect("writing to a string succeeds");
    if let Totals { checked_frames: checked @ 1.., crossed_frames, .. } = summary.totals {
        writeln!(text, "crossings in {crossed_frames} of {checked} checked frames")
            .expect("writing to a string succeeds");
    }
    if summary.obstacle_crossings > 0 {
        let count = summary.obstacle_crossings;
        writeln!(text, "{count} times cloth crosses an obstacle at the end").expect("writing to a string succeeds");
    }
    if summary.totals.contact != ContactWork::default() {
        writeln!(text, "contact: {}", summary.totals.contact).expect("writing to a string succeeds");
    }
    if let Some(phases) = phases(summary) {
        write!(text, "\n{phases}\n").expect("writing to a string succeeds");
    }
    text
}

fn terms(summary: &Summary) -> Table {
    let mut table = plain([
        "term",
        "elements",
        "value",
        "skipped",
        "gradient",
        "skipped",
        "Hessian",
        "skipped",
        "flagged",
        "projected",
        "reused",
    ]);
    for term in &summary.terms {
        let elements = term.elements.map(|elements| elements as u64);
        let numbers = [elements].into_iter().chain(evaluated(term)).chain([term.reused]);
        let cell = |number: Option<u64>| number.map_or("–".to_owned(), |number| number.to_string());
        table.add_row([term.name.clone()].into_iter().chain(numbers.map(cell)));
    }
    aligned(table)
}

/// Returns the numbers of evaluated and skipped values, gradients and Hessians of a term, and of flagged and projected
/// elements; `None` where nothing counts them.
pub(super) fn evaluated(term: &TermSummary) -> [Option<u64>; 8] {
    let Some(Counts { value, gradient, hessian, .. }) = &term.counts else { return [None; 8] };
    let flagged = value.flagged + gradient.flagged + hessian.flagged;
    let [[value, no_value], [gradient, no_gradient], [second, no_second]] =
        [value, gradient, hessian].map(|tally| [tally.evaluated, tally.skipped]);
    [value, no_value, gradient, no_gradient, second, no_second, flagged, hessian.projected].map(Some)
}

fn phases(summary: &Summary) -> Option<Table> {
    let phases = summary.named_phases();
    if phases.iter().all(|(_, time)| time.is_zero()) {
        return None;
    }
    let total = summary.totals.stepping_time;
    let other = total.saturating_sub(phases.iter().map(|(_, time)| *time).sum());
    let mut table = plain(["phase", "s", "ms per step", "%"]);
    for (name, time) in phases.into_iter().chain([("other", other), ("all", total)]) {
        let seconds = time.as_secs_f64();
        table.add_row([
            name.to_owned(),
            format!("{seconds:.3}"),
            format!("{:.3}", 1e3 * seconds / summary.totals.steps.max(1) as f64),
            format!("{:.1}", 100.0 * seconds / total.as_secs_f64().max(f64::MIN_POSITIVE)),
        ]);
    }
    Some(aligned(table))
}

fn plain<const N: usize>(head: [&str; N]) -> Table {
    let mut table = Table::new();
    table.load_preset(presets::NOTHING);
    table.set_header(head);
    table
}

/// Right-aligns all columns except the first.
fn aligned(mut table: Table) -> Table {
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}
