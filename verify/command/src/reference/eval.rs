use std::path::Path;

use energy_compiler::Textbook;
use energy_dsl::Flags;
use serde_json::{Map, Value, json};

use super::file::{Record, RecordError, read};
use super::mapping::{is_undeclared, mapping};
use verify::blocks::{NoAnswer, evaluate};
use verify::multiprecision::truth;

/// The source of the blocks in evaluated records.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// The generated code, with 17 digits.
    GeneratedCode,
    /// The formula in multi-precision; `undefined` where it has no value.
    Truth {
        /// Number of digits.
        digits: usize,
    },
}

/// Evaluates every record of a file (`potref-1` or `potref-policy-1`) and writes the records with `out` and `flags`.
/// `out` contains the blocks by the source. `flags` says whether the generated code marks a block as `degenerate` or a
/// `kink`. If the rest shape is degenerate, or no element computes the potential yet, `out` is empty and `error` has
/// the reason.
///
/// Returns the number of records.
///
/// # Errors
/// If the input is malformed or names an unknown potential, or the output cannot be written. Nothing is written then.
pub fn evaluate_file(input: &Path, output: &Path, source: Source) -> Result<usize, RecordError> {
    let mut file: Value = read(input)?;
    let common = file.get("potential").and_then(Value::as_str).map(str::to_owned);
    let Some(records) = file.get_mut("records").and_then(Value::as_array_mut) else {
        return Err(RecordError::record(input, "(the file)", "expected a list `records`"));
    };
    for record in records.iter_mut() {
        let id = record.get("id").and_then(Value::as_str).unwrap_or("without id").to_owned();
        let own = record.get("potential").and_then(Value::as_str).map(str::to_owned);
        let fail = |message: String| RecordError::record(input, &id, message);
        let potential = own.or_else(|| common.clone()).ok_or_else(|| fail("`potential` is missing".into()))?;
        evaluate_record(record, &potential, source).map_err(fail)?;
    }
    let count = records.len();
    let text = serde_json::to_string_pretty(&file).map_err(|e| RecordError::file(output, e.into()))?;
    energy_cli::write_whole(output, text.as_bytes()).map_err(|e| RecordError::file(output, e))?;
    Ok(count)
}

fn evaluate_record(value: &mut Value, potential: &str, source: Source) -> Result<(), String> {
    let record: Record = serde_json::from_value(value.clone()).map_err(|e| e.to_string())?;
    let fields = value.as_object_mut().ok_or("a record is an object")?;
    let without_answer = |fields: &mut Map<String, Value>, why: String| {
        fields.insert("out".into(), json!({}));
        fields.insert("flags".into(), json!({}));
        fields.insert("error".into(), json!(why));
        Ok(())
    };
    let Some(mapping) = mapping(potential) else {
        let why = format!("no declared element computes the potential `{potential}`");
        return if is_undeclared(potential) { without_answer(fields, why) } else { Err(why) };
    };
    let sample = record.sample(&mapping)?;
    let declaration = mapping.entry.declaration;
    // For constraints, the reference's own blocks determine which are computed.
    let asked: Option<Vec<String>> = ["out", "blocks"]
        .iter()
        .find_map(|key| fields.get(*key).and_then(Value::as_object))
        .map(|blocks| blocks.keys().cloned().collect());
    let (mut out, mut flags) = (Map::new(), Map::new());
    match evaluate(declaration, mapping.entry.evaluate, &sample.inputs()) {
        Ok(answer) => {
            let truths = match source {
                Source::GeneratedCode => Vec::new(),
                Source::Truth { digits } => {
                    let formula =
                        Textbook::from_source(declaration.source).map_err(|e| format!("{}: {e}", declaration.name))?;
                    truth(declaration, &formula, &sample, digits)
                }
            };
            for block in &answer.blocks {
                let name = block.name.name();
                if asked.as_ref().is_some_and(|asked| !asked.iter().any(|a| a == name)) {
                    continue;
                }
                let digits: Vec<Value> = match (source, truths.iter().find(|t| t.block.name == block.name)) {
                    (Source::Truth { digits }, Some(truth)) => {
                        truth.block.numbers.iter().map(|x| json!(x.to_decimal(digits))).collect()
                    }
                    _ => block.numbers.iter().map(|x| json!(format!("{x:.16e}"))).collect(),
                };
                let single = digits.len() == 1 && name == "energy";
                out.insert(name.into(), if single { digits[0].clone() } else { Value::Array(digits) });
                let Flags { degenerate, kink } = answer.flags[block.name.order(declaration.kind)];
                flags.insert(name.into(), json!({ "degenerate": degenerate, "kink": kink }));
            }
        }
        Err(NoAnswer::Rest(error)) => return without_answer(fields, error.to_string()),
        Err(other) => return Err(other.to_string()),
    }
    fields.insert("out".into(), Value::Object(out));
    fields.insert("flags".into(), Value::Object(flags));
    Ok(())
}
