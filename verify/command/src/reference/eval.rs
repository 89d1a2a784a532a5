use std::path::Path;

use anyhow::Context;
use energy_compiler::Textbook;
use energy_dsl::{Declaration, Flags};
use serde_json::{Map, Value, json};

use super::file::{Record, RecordError, read};
use super::fusion::{evaluate_fusion, family_names};
use super::mapping::{is_undeclared, mapping};
use verify::audit::{Subject, Target};
use verify::blocks::{Answer, NoAnswer, evaluate};
use verify::multiprecision::{TrueBlock, truth};
use verify::sample::Sample;

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

/// Evaluates every record of a file (`potref-1` or `potref-policy-1`, or the families of body tracking, see
/// [`evaluate_fusion`]) and writes the records with `out` and `flags`.
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
        return evaluate_families(input, output, source);
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

/// Evaluates a file of body tracking, which has families in place of records.
fn evaluate_families(input: &Path, output: &Path, source: Source) -> Result<usize, RecordError> {
    let fail = |message: String| RecordError::record(input, "(the file)", message);
    if source != Source::GeneratedCode {
        let message = "expected a list `records`; families of body tracking are evaluated by generated code only: \
                       leave out --digits";
        return Err(fail(message.into()));
    }
    let names = family_names();
    evaluate_fusion(input, output)?
        .ok_or_else(|| fail(format!("expected a list `records`, or families of body tracking: {names}")))
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
    let (out, flags);
    match evaluate(declaration, mapping.entry.evaluate, &sample.inputs()) {
        Ok(answer) => {
            let truths = match source {
                Source::GeneratedCode => Vec::new(),
                Source::Truth { digits } => {
                    let formula =
                        Textbook::from_source(&declaration.source).map_err(|e| format!("{}: {e}", declaration.name))?;
                    truth(declaration, &formula, &sample, digits)
                }
            };
            let wanted = |name: &str| asked.as_ref().is_none_or(|asked| asked.iter().any(|a| a == name));
            (out, flags) = described(declaration, &answer, (source, &truths), wanted);
        }
        Err(NoAnswer::Rest(error)) => return without_answer(fields, error.to_string()),
        Err(other) => return Err(other.to_string()),
    }
    fields.insert("out".into(), Value::Object(out));
    fields.insert("flags".into(), Value::Object(flags));
    Ok(())
}

/// Evaluates declarations of a file at inputs in the form that `verify audit --at` reads, and writes for each input
/// `element`, `input`, `out` and `flags`, or `error` if the rest shape is degenerate. An input that names no element is
/// for the only one.
///
/// Returns the number of inputs.
///
/// # Errors
/// If the inputs cannot be read or fit no element, or the output cannot be written. Nothing is written then.
pub fn evaluate_inputs(targets: &[Target], inputs: &Path, output: &Path, source: Source) -> anyhow::Result<usize> {
    let subjects: Vec<Subject> =
        targets.iter().map(|target| target.subject().map_err(anyhow::Error::msg)).collect::<Result<_, _>>()?;
    let mut records = Vec::new();
    for (name, sample) in crate::read_inputs(inputs)? {
        let found = match &name {
            Some(name) => subjects.iter().find(|subject| subject.declaration.name == **name),
            None => subjects.first().filter(|_| subjects.len() == 1),
        };
        let subject = found.with_context(|| match name {
            Some(name) => format!("{}: no declaration is called {name}", inputs.display()),
            None => format!("{}: name the element that the input is for", inputs.display()),
        })?;
        sample.fits(&subject.declaration).map_err(|why| anyhow::anyhow!("{}: {why}", inputs.display()))?;
        records.push(evaluated(subject, &sample, source)?);
    }
    let text = serde_json::to_string_pretty(&json!({ "records": records }))?;
    energy_cli::write_whole(output, text.as_bytes()).with_context(|| format!("cannot write {}", output.display()))?;
    Ok(records.len())
}

fn evaluated(subject: &Subject, sample: &Sample, source: Source) -> anyhow::Result<Value> {
    let mut record = json!({ "element": subject.declaration.name, "input": sample });
    let fields = record.as_object_mut().context("a record is an object")?;
    match subject.answer(sample) {
        Ok(answer) => {
            let truths = match source {
                Source::GeneratedCode => Vec::new(),
                Source::Truth { digits } => truth(&subject.declaration, &subject.formula, sample, digits),
            };
            let (out, flags) = described(&subject.declaration, &answer, (source, &truths), |_| true);
            fields.extend([("out".to_owned(), Value::Object(out)), ("flags".to_owned(), Value::Object(flags))]);
        }
        Err(NoAnswer::Rest(error)) => {
            fields.insert("error".into(), json!(error.to_string()));
        }
        Err(other) => return Err(other.into()),
    }
    Ok(record)
}

/// Returns the numbers and the flags of the wanted blocks.
fn described(
    declaration: &Declaration,
    answer: &Answer,
    (source, truths): (Source, &[TrueBlock]),
    wanted: impl Fn(&str) -> bool,
) -> (Map<String, Value>, Map<String, Value>) {
    let (mut out, mut flags) = (Map::new(), Map::new());
    for block in answer.blocks.iter().filter(|block| wanted(block.name.name())) {
        let name = block.name.name();
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
    (out, flags)
}
