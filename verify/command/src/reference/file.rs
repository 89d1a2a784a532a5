use std::collections::BTreeMap;
use std::path::Path;

use serde::Deserialize;
use serde_json::Value;

use verify::sample::Sample;

/// An error in a file of records.
#[derive(Debug, thiserror::Error)]
pub enum RecordError {
    /// The file cannot be read or written.
    #[error("{path}: {source}")]
    File {
        /// Path of the file.
        path: String,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The file is not JSON, or does not match the schema.
    #[error("{path}:{line}:{column}: {message}")]
    Syntax {
        /// Path of the file.
        path: String,
        /// Line number.
        line: usize,
        /// Column number.
        column: usize,
        /// Description of the error.
        message: String,
    },
    /// A record has an error.
    #[error("{path}: record {record}: {message}")]
    Record {
        /// Path of the file.
        path: String,
        /// Id of the record.
        record: String,
        /// Description of the error.
        message: String,
    },
}

impl RecordError {
    pub(super) fn file(path: &Path, source: std::io::Error) -> Self {
        Self::File { path: path.display().to_string(), source }
    }

    pub(super) fn record(path: &Path, record: &str, message: impl Into<String>) -> Self {
        Self::Record { path: path.display().to_string(), record: record.into(), message: message.into() }
    }
}

/// The largest file of records, in bytes.
const LARGEST_FILE: u64 = 1 << 30;

/// Reads a JSON file.
pub(super) fn read<T: for<'de> Deserialize<'de>>(path: &Path) -> Result<T, RecordError> {
    let text = energy_files::read_text(path, LARGEST_FILE).map_err(|e| RecordError::file(path, e))?;
    serde_json::from_str(&text).map_err(|error| RecordError::Syntax {
        path: path.display().to_string(),
        line: error.line(),
        column: error.column(),
        message: error.to_string(),
    })
}

/// A record: an input of a potential.
#[derive(Clone, Debug, Deserialize)]
pub struct Record {
    /// Id of the record.
    pub id: String,
    /// Coordinates as decimal strings of exact doubles.
    pub x: Vec<String>,
    /// The same doubles as big-endian hexadecimal digits, to check `x`; optional.
    #[serde(default)]
    pub x_bits: Vec<String>,
    /// Velocities of forces, as `x`.
    #[serde(default)]
    pub v: Vec<String>,
    /// The bits of `v`; optional.
    #[serde(default)]
    pub v_bits: Vec<String>,
    /// Parameters by name: a number as a string, or a list of them.
    #[serde(default)]
    pub params: BTreeMap<String, Value>,
    /// Amplification of rounded edges, by block.
    #[serde(default)]
    pub kappa: BTreeMap<String, Option<f64>>,
    /// Whether every coordinate difference is an exact double.
    #[serde(default)]
    pub exact_edges: bool,
    /// `f64_overflow`, `f64_underflow`.
    #[serde(default)]
    pub range: Vec<String>,
}

impl Record {
    /// Returns the inputs of an element; finds its parameters and rest shape by name.
    ///
    /// # Errors
    /// If the record does not have the numbers that the element reads.
    pub fn sample(&self, mapping: &super::Mapping) -> Result<Sample, String> {
        let positions = numbers(&self.x, &self.x_bits, "x")?;
        let expected: usize = mapping.entry.declaration.points.iter().map(|p| p.size).sum();
        if positions.len() != expected {
            return Err(format!("x holds {} numbers, expected {expected}", positions.len()));
        }
        let velocities = numbers(&self.v, &self.v_bits, "v")?;
        if velocities.is_empty() && mapping.needs_velocities() {
            return Err(format!("the velocities `v` are missing: {} is a force", mapping.potential));
        }
        if !velocities.is_empty() && velocities.len() != expected {
            return Err(format!("v holds {} numbers, expected {expected}", velocities.len()));
        }
        let mut parameters = Vec::new();
        for &name in mapping.parameters {
            match name {
                "" => parameters.push(0.0),
                _ => parameters.push(self.parameter(name)?),
            }
        }
        let rest = match mapping.rest {
            None => Vec::new(),
            Some(name) => {
                let list = self.params.get(name).and_then(Value::as_array);
                let list = list.ok_or_else(|| format!("the list `{name}` is missing from params"))?;
                let rest: Result<Vec<f64>, String> = list.iter().map(value).collect();
                let rest = rest.map_err(|e| format!("{name}: {e}"))?;
                let expected: usize = mapping.entry.declaration.rest.iter().map(|r| r.size).sum();
                if rest.len() != expected {
                    return Err(format!("{name} holds {} numbers, expected {expected}", rest.len()));
                }
                rest
            }
        };
        Ok(Sample { parameters, rest, positions, velocities })
    }

    fn parameter(&self, name: &str) -> Result<f64, String> {
        let found = self.params.get(name).ok_or_else(|| format!("the parameter `{name}` is missing from params"))?;
        value(found).map_err(|e| format!("{name}: {e}"))
    }
}

/// Parses decimal strings as doubles and compares them with their bits, if given.
fn numbers(list: &[String], bits: &[String], what: &str) -> Result<Vec<f64>, String> {
    if !bits.is_empty() && bits.len() != list.len() {
        return Err(format!("{what}_bits holds {} numbers, {what} holds {}", bits.len(), list.len()));
    }
    let numbers: Vec<f64> =
        list.iter().map(|text| number(text).map_err(|e| format!("{what}: {e}"))).collect::<Result<_, _>>()?;
    for (at, (x, hexadecimal)) in numbers.iter().zip(bits).enumerate() {
        let expected = hexadecimal.strip_prefix("0x").and_then(|digits| u64::from_str_radix(digits, 16).ok());
        let expected = expected.ok_or_else(|| format!("{what}_bits[{at}]: `{hexadecimal}` is not hexadecimal"))?;
        if x.to_bits() != expected {
            return Err(format!(
                "{what}[{at}] is {x:e}, whose bits are {:#018x}; {what}_bits has {hexadecimal}",
                x.to_bits()
            ));
        }
    }
    Ok(numbers)
}

fn value(value: &Value) -> Result<f64, String> {
    match value {
        Value::String(text) => number(text),
        Value::Number(n) => n.as_f64().ok_or_else(|| format!("{n} is not a double")),
        other => Err(format!("expected a number, found {other}")),
    }
}

fn number(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(x) if x.is_finite() => Ok(x),
        Ok(x) => Err(format!("{x} is not finite")),
        Err(_) => Err(format!("`{text}` is not a number")),
    }
}
