use std::collections::BTreeMap;
use std::path::Path;

use energy_compiler::Textbook;
use energy_dsl::Declaration;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::file::{Record, RecordError, read};
use super::mapping::mapping;
use verify::blocks::{Answer, Block, BlockName, NoAnswer, evaluate, largest};
use verify::formula::expected_blocks;
use verify::sample::Sample;

/// The result of one block at one degenerate input.
#[derive(Clone, Debug, Serialize)]
pub struct PolicyLine {
    /// Id of the record.
    pub record: String,
    /// Name of the potential.
    pub potential: String,
    /// Name of the block.
    pub block: String,
    /// Expected behaviour: `limit`, `regular`, `infinite`, `branch`, `kink` or `singular`.
    pub status: String,
    /// Whether the element behaves as expected; `None` if no element computes the potential.
    pub passed: Option<bool>,
    /// The result of the element.
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

/// Evaluates the elements at the degenerate inputs of a file.
///
/// # Errors
/// If the file cannot be read or a record is malformed.
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
        let declaration = mapping.entry.declaration;
        let answer = evaluate(declaration, mapping.entry.evaluate, &sample.inputs());
        let again = evaluate(declaration, mapping.entry.evaluate, &sample.inputs());
        for (block, rule) in &blocks {
            let (passed, found) = match &answer {
                Ok(answer) => {
                    let name = BlockName::of_kind(kind).iter().copied().find(|n| n.name() == block);
                    let name = name.ok_or_else(|| fail(format!("unknown block `{block}`")))?;
                    let (mut passed, found) =
                        check(rule, answer, name, answer.flags[name.order(kind)].any()).map_err(fail)?;
                    passed &= again.as_ref().is_ok_and(|again| same_bits(again.block(name), answer.block(name)));
                    if rule.status == "regular" {
                        let formula = Textbook::from_source(&declaration.source);
                        let formula = formula.map_err(|e| fail(format!("{}: {e}", declaration.name)))?;
                        passed &= continues(declaration, &formula, &sample, answer.block(name));
                    }
                    (passed, found)
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

fn check(rule: &Rule, answer: &Answer, name: BlockName, flagged: bool) -> Result<(bool, String), String> {
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

fn same_bits(a: &Block, b: &Block) -> bool {
    a.numbers.iter().map(|x| x.to_bits()).eq(b.numbers.iter().map(|x| x.to_bits()))
}

/// Whether a block, at a point where the textbook form breaks down, is the limit of that form. The limit is the mean
/// over two points on either side, whose error is quadratic in their distance.
fn continues(declaration: &Declaration, formula: &Textbook, sample: &Sample, block: &Block) -> bool {
    const TOLERANCE: f64 = 1e-2;
    let step = sample.feature_length(declaration) * 2.0_f64.powi(-9);
    let expected = |sign: f64| {
        let mut beside = sample.clone();
        for (i, x) in beside.positions.iter_mut().enumerate() {
            // A fixed direction along no axis.
            *x += sign * step * (1.0 + 2.0 * i as f64 + (i * i) as f64).cos();
        }
        let blocks = expected_blocks(declaration, formula, &beside);
        blocks.into_iter().find(|b| b.name == block.name).map_or_else(Vec::new, |b| b.numbers)
    };
    let (ahead, behind) = (expected(1.0), expected(-1.0));
    let scale = largest(&ahead).max(largest(&behind)).max(block.largest());
    ahead.len() == block.numbers.len()
        && ahead
            .iter()
            .zip(&behind)
            .zip(&block.numbers)
            .all(|((a, b), got)| ((a + b) / 2.0 - got).abs() <= TOLERANCE * scale)
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Straight hair: the textbook form's Hessian loses its digits there, but not at its neighbours.
    #[test]
    fn a_regular_block_must_continue_its_neighbours() {
        let entry = crate::catalogue::find("HairBend").unwrap();
        let sample = Sample {
            parameters: vec![2.0],
            rest: Vec::new(),
            positions: vec![0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 3.0, 0.0, 0.0],
            velocities: Vec::new(),
        };
        let formula = Textbook::from_source(&entry.declaration.source).unwrap();
        let answer = evaluate(entry.declaration, entry.evaluate, &sample.inputs()).unwrap();
        let mut block = answer.block(BlockName::Hessian).clone();
        assert!(continues(entry.declaration, &formula, &sample, &block));
        let stiffest = block.numbers.iter().position(|x| x.abs() == block.largest()).unwrap();
        block.numbers[stiffest] *= 1.05;
        assert!(!continues(entry.declaration, &formula, &sample, &block));
    }
}
