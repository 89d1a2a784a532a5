//! Contenders in C, which a Python script generates, compiles and times.

use std::path::Path;
use std::process::Command;

use anyhow::{Context, bail};
use serde::Deserialize;

use crate::contender::{Contender, Source};
use crate::measure::Time;

/// The contenders of the script, as notes name them.
pub(crate) const SCRIPT_TOOLS: &str = "SymPy and CasADi";

/// One tool's results for one kernel.
pub(crate) struct ScriptResult {
    /// `K1` to `K5`.
    pub kernel: String,
    pub source: Source,
    pub time: Time,
    /// Results near rest, one list of numbers per element.
    pub near_rest: Vec<Vec<f64>>,
    /// The result at coincident points.
    pub coincident: Vec<f64>,
}

pub(crate) struct ScriptOutput {
    pub results: Vec<ScriptResult>,
    /// Reasons why tools are missing.
    pub notes: Vec<String>,
}

/// The script's JSON. Numbers that are NaN or infinite are `null`.
#[derive(Deserialize)]
struct Json {
    results: Vec<JsonResult>,
    notes: Vec<String>,
}

#[derive(Deserialize)]
struct JsonResult {
    kernel: String,
    tool: String,
    nanoseconds: f64,
    least: f64,
    near_rest: Vec<Vec<Option<f64>>>,
    coincident: Vec<Option<f64>>,
}

/// Runs `scripts/symbolic_kernels.py` on a folder of inputs.
///
/// # Errors
/// Fails if Python cannot be run, if the script fails, or if its output is not the expected JSON.
pub(crate) fn run_script(python: &Path, inputs: &Path, repetitions: usize) -> anyhow::Result<ScriptOutput> {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("scripts/symbolic_kernels.py");
    let mut command = Command::new(python);
    command.arg(&script).arg(inputs).arg("--json").args(["--repetitions", &repetitions.to_string()]);
    let output = command.output().with_context(|| format!("cannot run {}", python.display()))?;
    if !output.status.success() {
        bail!("{} failed: {}", script.display(), String::from_utf8_lossy(&output.stderr).trim());
    }
    let json: Json = serde_json::from_slice(&output.stdout)
        .with_context(|| format!("{} printed unexpected output", script.display()))?;
    let results = json.results.into_iter().map(result).collect::<anyhow::Result<_>>()?;
    Ok(ScriptOutput { results, notes: json.notes })
}

fn result(json: JsonResult) -> anyhow::Result<ScriptResult> {
    let (source, contender) = match json.tool.as_str() {
        "sympy" => (Source::SymPy, Contender::SymPy),
        "casadi" => (Source::CasADi, Contender::CasADi),
        other => bail!("expected results of `sympy` or `casadi`, got `{other}`"),
    };
    let numbers = |list: Vec<Option<f64>>| list.into_iter().map(|number| number.unwrap_or(f64::NAN)).collect();
    Ok(ScriptResult {
        kernel: json.kernel,
        source,
        time: Time { contender, nanoseconds: json.nanoseconds, least: json.least },
        near_rest: json.near_rest.into_iter().map(numbers).collect(),
        coincident: numbers(json.coincident),
    })
}
