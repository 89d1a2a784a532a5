//! Inputs in JSON files.

use std::path::Path;

use anyhow::Context;
use serde_json::Value;

use verify::sample::Sample;

/// The largest file of inputs, in bytes.
const LARGEST_FILE: u64 = 256 << 20;

/// Reads the inputs of a file: one object, a list of objects, or the inputs in a report. Returns each with the name of
/// its element, if the file names it.
///
/// # Errors
/// If the file cannot be read, or contains no input.
pub fn read_inputs(path: &Path) -> anyhow::Result<Vec<(Option<String>, Sample)>> {
    let place = || path.display();
    let text = energy_files::read_text(path, LARGEST_FILE).with_context(|| format!("cannot read {}", place()))?;
    let value: Value = serde_json::from_str(&text).with_context(|| format!("{}", place()))?;
    let mut inputs = Vec::new();
    if let Some(lines) = value.get("lines").and_then(Value::as_array) {
        for line in lines {
            let element = line.get("element").and_then(Value::as_str).map(str::to_owned);
            if let Some(input) = line.get("input").filter(|input| !input.is_null()) {
                inputs.push((element, sample(input).with_context(|| format!("{}", place()))?));
            }
        }
        inputs.dedup();
    } else {
        let list = value.as_array().map_or_else(|| std::slice::from_ref(&value), Vec::as_slice);
        for input in list {
            inputs.push((None, sample(input).with_context(|| format!("{}", place()))?));
        }
    }
    anyhow::ensure!(!inputs.is_empty(), "{} contains no input", place());
    Ok(inputs)
}

fn sample(value: &Value) -> anyhow::Result<Sample> {
    serde_json::from_value(value.clone())
        .context("expected an object with `positions`, `velocities`, `rest` and `parameters`")
}
