use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::file::{Record, RecordError, read};
use super::mapping::mapping;
use crate::blocks::{Answer, BlockName, NoAnswer, evaluate};

/// One block of one degenerate input.
#[derive(Clone, Debug, Serialize)]
pub struct PolicyLine {
    /// The record.
    pub record: String,
    /// The potential.
    pub potential: String,
    /// The block.
    pub block: String,
    /// What is asked for: `limit`, `regular`, `infinite`, `branch`, `kink` or `singular`.
    pub status: String,
    /// Whether the element does it; nothing where no element computes the potential.
    pub passed: Option<bool>,
    /// What it returned.
    pub found: String,
}

#[derive(Deserialize)]
struct Policy {
    records: Vec<PolicyRecord>,
}

#[derive(Deserialize)]
struct PolicyRecord {
    potential: String,
    blocks: BTreeMap<String, Rule>,
    #[serde(flatten)]
    record: Record,
}

#[derive(Deserialize)]
struct Rule {
    status: String,
    #[serde(default)]
    value: Option<Value>,
    #[serde(default)]
    values: Vec<String>,
}

/// Runs the elements on the degenerate inputs of a file.
///
/// # Errors
/// When the file cannot be read or a record is malformed.
pub fn policy(path: &Path) -> Result<Vec<PolicyLine>, RecordError> {
    let policy: Policy = read(path)?;
    let mut lines = Vec::new();
    for PolicyRecord { potential, blocks, record } in policy.records {
        let fail = |message: String| RecordError::record(path, &record.id, message);
        let Some(mapping) = mapping(&potential) else {
            lines.extend(blocks.iter().map(|(block, rule)| PolicyLine {
                record: record.id.clone(),
                potential: potential.clone(),
                block: block.clone(),
                status: rule.status.clone(),
                passed: None,
                found: "not declared".into(),
            }));
            continue;
        };
        let sample = record.sample(&mapping).map_err(fail)?;
        let kind = mapping.entry.declaration.kind;
        let answer = evaluate(mapping.entry.declaration, mapping.entry.evaluate, &sample.inputs());
        for (block, rule) in &blocks {
            let (passed, found) = match &answer {
                Ok(answer) => {
                    let name = BlockName::of_kind(kind).iter().copied().find(|n| n.name() == block);
                    let name = name.ok_or_else(|| fail(format!("unknown block `{block}`")))?;
                    judge(rule, answer, name, answer.flags[name.order(kind)].any()).map_err(fail)?
                }
                Err(NoAnswer::Rest(error)) => (rule.status == "singular", error.to_string()),
                Err(other) => return Err(fail(other.to_string())),
            };
            lines.push(PolicyLine {
                record: record.id.clone(),
                potential: potential.clone(),
                block: block.clone(),
                status: rule.status.clone(),
                passed: Some(passed),
                found,
            });
        }
    }
    Ok(lines)
}

fn judge(rule: &Rule, answer: &Answer, name: BlockName, flagged: bool) -> Result<(bool, String), String> {
    let numbers = &answer.block(name).numbers;
    let finite = numbers.iter().all(|x| x.is_finite());
    let passed = match rule.status.as_str() {
        "limit" => {
            let expected = match &rule.value {
                Some(Value::Array(list)) => list.iter().map(number).collect::<Result<Vec<_>, _>>()?,
                Some(single) => vec![number(single)?],
                None => return Err("a `limit` needs its `value`".into()),
            };
            *numbers == expected && !flagged
        }
        "regular" => finite && !flagged,
        "infinite" => numbers.iter().all(|x| *x == f64::INFINITY),
        "branch" => {
            finite && (rule.values.is_empty() || rule.values.iter().any(|v| branch_value(v) == Some(numbers[0])))
        }
        "kink" | "singular" => finite && flagged,
        other => return Err(format!("unknown status `{other}`")),
    };
    let shown = match numbers.as_slice() {
        [one] => format!("{one}"),
        many => format!("max {:e}", many.iter().fold(0.0_f64, |a, b| if b.is_nan() { *b } else { a.max(b.abs()) })),
    };
    Ok((passed, if flagged { format!("{shown}, flagged") } else { shown }))
}

fn number(value: &Value) -> Result<f64, String> {
    let text = value.as_str().ok_or_else(|| format!("expected a decimal string, found {value}"))?;
    text.parse().map_err(|_| format!("`{text}` is not a number"))
}

fn branch_value(text: &str) -> Option<f64> {
    match text {
        "pi" => Some(std::f64::consts::PI),
        "-pi" => Some(-std::f64::consts::PI),
        other => other.parse().ok(),
    }
}
