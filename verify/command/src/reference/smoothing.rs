//! hsmooth: attachments of nodes to bones, filled and relaxed by `fusion-core`.

use fusion_core::model::Attachments;
use serde_json::Value;

use super::fusion::{Case, Lines, numbers};

/// Allowed error of means of numbers up to 1.
const BOUND: f64 = 8e-16;

/// Fills until nothing changes, then relaxes, and compares every pass. A pass that stalls is counted, as in the
/// reference.
pub(super) fn smoothing(case: &Case<'_>, lines: &mut Lines) -> Result<(), String> {
    let graph = graph(case)?;
    let mut attachments = Attachments { rows: rows(case.field("H0")?)?, assigned: flags(case.field("assigned0")?)? };
    let nodes = attachments.rows.len();
    if attachments.assigned.len() != nodes || graph.len() != nodes || graph.iter().flatten().any(|&node| node >= nodes)
    {
        return Err(format!("`assigned0` and `neighbors` do not fit the {nodes} rows of `H0`"));
    }
    let history = case.out("history")?.as_array().map_or(&[][..], Vec::as_slice);
    let (mut pass, mut fills) = (0, 0);
    while attachments.assigned.contains(&false) {
        let changed = attachments.fill_once(&graph);
        compare(case, lines, ("fill", history.get(pass)), &attachments)?;
        (pass, fills) = (pass + 1, fills + 1);
        if !changed {
            break;
        }
    }
    for _ in 0..case.number("relax_iters")? as usize {
        attachments.relax_once(&graph);
        compare(case, lines, ("relax", history.get(pass)), &attachments)?;
        pass += 1;
    }
    lines.exact(case, "passes", history.len() == pass);
    lines.compare(case, ("fill_iters", 0.0, 0.0), &[f64::from(fills)], case.out("fill_iters")?)
}

/// Compares the attachments after a pass with the reference's.
fn compare(
    case: &Case<'_>,
    lines: &mut Lines,
    (phase, truth): (&str, Option<&Value>),
    found: &Attachments,
) -> Result<(), String> {
    let Some(truth) = truth else {
        lines.exact(case, "passes", false);
        lines.keep(&format!("H, {phase}"), &found.rows.concat());
        return Ok(());
    };
    lines.exact(case, "phase", truth["phase"] == phase);
    lines.exact(case, "assigned", flags(&truth["assigned"])? == found.assigned);
    lines.compare(case, (&format!("H, {phase}"), 0.0, BOUND), &found.rows.concat(), &truth["H"])
}

fn graph(case: &Case<'_>) -> Result<Vec<Vec<usize>>, String> {
    let rows = rows(case.field("neighbors")?)?;
    Ok(rows.into_iter().map(|around| around.into_iter().map(|node| node as usize).collect()).collect())
}

fn rows(value: &Value) -> Result<Vec<Vec<f64>>, String> {
    value.as_array().ok_or_else(|| format!("expected a list of rows, found {value}"))?.iter().map(numbers).collect()
}

fn flags(value: &Value) -> Result<Vec<bool>, String> {
    let list = value.as_array().ok_or_else(|| format!("expected a list of booleans, found {value}"))?;
    list.iter().map(|flag| flag.as_bool().ok_or_else(|| format!("expected a boolean, found {flag}"))).collect()
}
