//! The programs by SymPy. A Python script builds them, and runs them when it is their turn.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

use anyhow::Context;
use serde::Deserialize;
use serde::de::DeserializeOwned;

use super::Program;
use crate::served::Served;

/// The running script. It ends when it is dropped.
pub(super) struct Script(Served);

#[derive(Deserialize)]
struct Notes {
    notes: Vec<String>,
}

impl Script {
    /// Starts the script on a folder of inputs, and returns its notes about missing packages.
    pub fn start(python: &Path, inputs: &Path) -> anyhow::Result<(Self, Vec<String>)> {
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("scripts/symbolic_formulas.py");
        let mut command = Command::new(python);
        command.arg(&script).arg(inputs).arg("--serve");
        let mut served = Served::start("scripts/symbolic_formulas.py", &mut command)?;
        let Notes { notes } = read(&served.answer()?)?;
        Ok((Self(served), notes))
    }

    /// Builds all programs for a formula and compares their results. Returns the seconds from the formula to each
    /// program.
    pub fn prepare(&mut self, formula: &str, elements: usize) -> anyhow::Result<BTreeMap<Program, f64>> {
        self.command(&format!("prepare {formula} {elements}"))
    }

    /// Runs each program once, and returns its time in nanoseconds per element.
    pub fn run(&mut self) -> anyhow::Result<BTreeMap<Program, f64>> {
        self.command("run")
    }

    fn command<T: DeserializeOwned>(&mut self, command: &str) -> anyhow::Result<T> {
        read(&self.0.ask(command)?)
    }
}

fn read<T: DeserializeOwned>(line: &str) -> anyhow::Result<T> {
    serde_json::from_str(line).with_context(|| format!("the script printed `{}`", line.trim()))
}
