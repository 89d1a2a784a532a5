use std::path::Path;
use std::process::Command;

use anyhow::{Context, bail};

use crate::contender::Contender;
use crate::measure::Time;

/// Runs `scripts/symbolic_kernels.py` on a folder of inputs; the times by kernel.
///
/// # Errors
/// When Python or one of its packages is missing, or the script fails.
pub fn run_script(python: &Path, inputs: &Path, repetitions: usize) -> anyhow::Result<Vec<(String, Time)>> {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("scripts/symbolic_kernels.py");
    let mut command = Command::new(python);
    command.arg(&script).arg(inputs).arg("--json").args(["--repetitions", &repetitions.to_string()]);
    let output = command.output().with_context(|| format!("cannot run {}", python.display()))?;
    if !output.status.success() {
        bail!("{} failed: {}", script.display(), String::from_utf8_lossy(&output.stderr).trim());
    }
    #[derive(serde::Deserialize)]
    struct Line {
        kernel: String,
        tool: String,
        nanoseconds: f64,
        least: f64,
    }
    let lines: Vec<Line> = serde_json::from_slice(&output.stdout).context("the script's output is not as expected")?;
    let time = |line: Line| {
        let contender = match line.tool.as_str() {
            "sympy" => Contender::SymPy,
            "casadi" => Contender::CasADi,
            other => bail!("the script measured an unknown tool, {other}"),
        };
        Ok((line.kernel, Time { contender, nanoseconds: line.nanoseconds, least: line.least }))
    };
    lines.into_iter().map(time).collect()
}
