use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::ROUNDOFF;
use super::exact::Truth;
use super::file::{Record, RecordError, read};
use super::mapping::{Mapping, mapping};
use super::policy::{PolicyLine, policy};
use verify::blocks::evaluate;

/// The errors of one block of a potential over all records.
#[derive(Clone, Debug, Serialize)]
pub struct BlockLine {
    /// Name of the potential.
    pub potential: String,
    /// Element that computed it.
    pub element: &'static str,
    /// Name of the block.
    pub block: String,
    /// Number of records.
    pub records: usize,
    /// Number of records with a NaN.
    pub nan: usize,
    /// Worst error over records with a non-zero block, in units of roundoff of the block's largest number.
    pub worst: f64,
    /// Record of `worst`.
    pub worst_record: String,
    /// Worst error in units of roundoff times max(1, κ).
    pub worst_kappa: f64,
    /// Record of `worst_kappa`.
    pub worst_kappa_record: String,
    /// Worst error in u over the records with edges that are exact doubles, for which κ makes no allowance. It has no
    /// bound, because parameters and rest shapes are still rounded.
    pub worst_exact_edges: Option<f64>,
    /// Records beyond tier A: 8 u max(1, κ), and exactly zero for a true zero.
    pub beyond_tier_a: Vec<String>,
    /// Bound without κ, in u; `None` if tier B does not apply.
    pub tier_b: Option<f64>,
    /// Records beyond tier B.
    pub beyond_tier_b: Vec<String>,
}

/// A comparison with a folder of reference values.
#[derive(Clone, Debug, Default, Serialize)]
pub struct ReferenceReport {
    /// One line per potential and block.
    pub lines: Vec<BlockLine>,
    /// Potentials that no element computes yet.
    pub undeclared: Vec<String>,
    /// Results at degenerate inputs, if the folder has them.
    pub policy: Vec<PolicyLine>,
}

#[derive(Deserialize)]
struct Potential {
    potential: String,
    records: Vec<Value>,
}

/// Returns the bound in u without allowance for edges: 8, 12 and 16 for values, first and second derivatives; 24 for
/// Jacobians of forces; 16 for Hessians of bending near rest.
fn tier_b(mapping: &Mapping, block: &str) -> Option<f64> {
    match (block, mapping.potential) {
        ("hess", "hinge_quadratic" | "bridson_conservative") => Some(16.0),
        (
            "dfdx" | "dfdv",
            "bridson_force" | "bridson_force_damped" | "witkin_spring_damped" | "witkin_vector_damped",
        ) => Some(24.0),
        ("energy", _) if mapping.kappa_free => Some(8.0),
        ("grad", _) if mapping.kappa_free => Some(12.0),
        ("hess", _) if mapping.kappa_free => Some(16.0),
        _ => None,
    }
}

/// Evaluates the generated code at every record of a folder.
///
/// # Errors
/// If a file cannot be read or a record is malformed.
pub fn reference(folder: &Path) -> Result<ReferenceReport, RecordError> {
    let entries = std::fs::read_dir(folder).map_err(|e| RecordError::file(folder, e))?;
    let mut paths: Vec<_> = entries
        .filter_map(Result::ok)
        .map(|e| e.path())
        .filter(|p| p.extension().is_some_and(|e| e == "json"))
        .collect();
    paths.sort();
    if paths.is_empty() {
        let missing = std::io::Error::new(std::io::ErrorKind::NotFound, "the folder holds no .json file of records");
        return Err(RecordError::file(folder, missing));
    }
    let mut report = ReferenceReport::default();
    for path in paths {
        if path.file_name().is_some_and(|name| name == "policy.json") {
            report.policy = policy(&path)?;
            continue;
        }
        let potential: Potential = read(&path)?;
        match mapping(&potential.potential) {
            Some(mapping) => report.lines.extend(compare(&path, &mapping, &potential.records)?),
            None => report.undeclared.push(potential.potential),
        }
    }
    Ok(report)
}

fn compare(path: &Path, mapping: &Mapping, records: &[Value]) -> Result<Vec<BlockLine>, RecordError> {
    let mut lines: Vec<BlockLine> = Vec::new();
    for value in records {
        let name = value.get("id").and_then(Value::as_str).unwrap_or("without id").to_owned();
        let fail = |message: String| RecordError::record(path, &name, message);
        let record: Record = serde_json::from_value(value.clone()).map_err(|e| fail(e.to_string()))?;
        let sample = record.sample(mapping).map_err(fail)?;
        let answer = evaluate(mapping.entry.declaration, mapping.entry.evaluate, &sample.inputs())
            .map_err(|e| fail(e.to_string()))?;
        let truths = value.get("out").and_then(Value::as_object).ok_or_else(|| fail("`out` is missing".into()))?;
        for (block, truth) in truths {
            let truth = truth_numbers(truth).map_err(|e| fail(format!("out.{block}: {e}")))?;
            let Some(got) = answer.blocks.iter().find(|b| b.name.name() == block) else {
                return Err(fail(format!("{} does not return a block `{block}`", mapping.entry.declaration.name)));
            };
            if got.numbers.len() != truth.len() {
                return Err(fail(format!("out.{block} holds {} numbers, expected {}", truth.len(), got.numbers.len())));
            }
            let at = lines.iter().position(|l| l.block == *block).unwrap_or_else(|| {
                lines.push(BlockLine {
                    potential: mapping.potential.into(),
                    element: &mapping.entry.declaration.name,
                    block: block.clone(),
                    records: 0,
                    nan: 0,
                    worst: 0.0,
                    worst_record: String::new(),
                    worst_kappa: 0.0,
                    worst_kappa_record: String::new(),
                    worst_exact_edges: None,
                    beyond_tier_a: Vec::new(),
                    tier_b: tier_b(mapping, block),
                    beyond_tier_b: Vec::new(),
                });
                lines.len() - 1
            });
            add(&mut lines[at], &record, &got.numbers, &truth, record.kappa.get(block).copied().flatten());
        }
    }
    Ok(lines)
}

/// Adds the result of one record.
fn add(line: &mut BlockLine, record: &Record, got: &[f64], truth: &[Truth], kappa: Option<f64>) {
    line.records += 1;
    if got.iter().any(|x| x.is_nan()) {
        line.nan += 1;
        line.beyond_tier_a.push(record.id.clone());
        line.beyond_tier_b.extend(line.tier_b.map(|_| record.id.clone()));
        return;
    }
    let largest = truth.iter().map(|t| t.high.abs()).fold(0.0, f64::max);
    if largest == 0.0 {
        // An underflowed true value allows any subnormal result; an exact zero must be zero.
        let allowed = if record.range.iter().any(|r| r == "f64_underflow") { f64::MIN_POSITIVE } else { 0.0 };
        if got.iter().any(|x| x.abs() > allowed) {
            line.beyond_tier_a.push(record.id.clone());
        }
        return;
    }
    if largest.is_infinite() {
        let right = got.iter().zip(truth).all(|(g, t)| !t.high.is_infinite() || g.is_infinite() && *g == t.high);
        if !right {
            line.beyond_tier_a.push(record.id.clone());
        }
        return;
    }
    // Relative errors mean nothing below the normal numbers.
    let scale = largest.max(f64::MIN_POSITIVE);
    let error = got.iter().zip(truth).map(|(g, t)| t.error_of(*g)).fold(0.0, f64::max) / scale / ROUNDOFF;
    let by_kappa = error / kappa.unwrap_or(1.0).max(1.0);
    if error > line.worst {
        (line.worst, line.worst_record) = (error, record.id.clone());
    }
    if record.exact_edges {
        line.worst_exact_edges = Some(line.worst_exact_edges.map_or(error, |worst| worst.max(error)));
    }
    if by_kappa > line.worst_kappa {
        (line.worst_kappa, line.worst_kappa_record) = (by_kappa, record.id.clone());
    }
    if by_kappa > 8.0 {
        line.beyond_tier_a.push(record.id.clone());
    }
    if line.tier_b.is_some_and(|bound| error > bound) {
        line.beyond_tier_b.push(record.id.clone());
    }
}

fn truth_numbers(value: &Value) -> Result<Vec<Truth>, String> {
    let one = |value: &Value| match value {
        Value::String(text) => text.parse(),
        other => Err(format!("expected a decimal string, found {other}")),
    };
    match value {
        Value::Array(list) => list.iter().map(one).collect(),
        single => Ok(vec![one(single)?]),
    }
}
