//! The programs by SymPy. A Python script builds them, and runs them when it is their turn.

use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use anyhow::{Context, bail};
use serde::Deserialize;
use serde::de::DeserializeOwned;

use super::Program;

/// The running script. It ends when it is dropped.
pub(super) struct Script {
    process: Child,
    /// `None` only while it is dropped.
    commands: Option<ChildStdin>,
    answers: BufReader<ChildStdout>,
}

#[derive(Deserialize)]
struct Notes {
    notes: Vec<String>,
}

impl Script {
    /// Starts the script on a folder of inputs, and returns its notes about missing packages.
    pub fn start(python: &Path, inputs: &Path) -> anyhow::Result<(Self, Vec<String>)> {
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("scripts/symbolic_formulas.py");
        let mut process = Command::new(python)
            .arg(&script)
            .arg(inputs)
            .arg("--serve")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .with_context(|| format!("cannot run {}", python.display()))?;
        let (Some(commands), Some(answers)) = (process.stdin.take(), process.stdout.take()) else {
            bail!("no pipes to {}", python.display());
        };
        let mut script = Self { process, commands: Some(commands), answers: BufReader::new(answers) };
        let Notes { notes } = script.answer()?;
        Ok((script, notes))
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
        // If the script has ended, its answer says so.
        if let Some(commands) = &mut self.commands {
            let _ = writeln!(commands, "{command}").and_then(|()| commands.flush());
        }
        self.answer()
    }

    fn answer<T: DeserializeOwned>(&mut self) -> anyhow::Result<T> {
        let mut line = String::new();
        self.answers.read_line(&mut line).context("the script cannot be read")?;
        if line.is_empty() {
            bail!("scripts/symbolic_formulas.py ended: {}; its message stands above", self.process.wait()?);
        }
        serde_json::from_str(&line).with_context(|| format!("the script printed `{}`", line.trim()))
    }
}

impl Drop for Script {
    fn drop(&mut self) {
        // At the end of its commands, the script removes its files and ends.
        self.commands = None;
        let _ = self.process.wait();
    }
}
