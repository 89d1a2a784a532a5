//! Programs of their own that run when it is their turn: a line asks, a line answers.

use std::io::{BufRead, BufReader, Write};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use anyhow::{Context, bail};

/// A running program. It ends when it is dropped.
pub(crate) struct Served {
    name: String,
    process: Child,
    /// `None` only while it is dropped.
    questions: Option<ChildStdin>,
    answers: BufReader<ChildStdout>,
}

impl Served {
    /// Starts a program. `name` stands in errors.
    pub(crate) fn start(name: &str, command: &mut Command) -> anyhow::Result<Self> {
        let started = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn();
        let mut process = started.with_context(|| format!("cannot run {}", command.get_program().display()))?;
        let (Some(questions), Some(answers)) = (process.stdin.take(), process.stdout.take()) else {
            bail!("no pipes to {name}");
        };
        let answers = BufReader::new(answers);
        Ok(Self { name: name.to_owned(), process, questions: Some(questions), answers })
    }

    /// Asks, and returns the answer.
    pub(crate) fn ask(&mut self, question: &str) -> anyhow::Result<String> {
        // If the program has ended, its answer says so.
        if let Some(questions) = &mut self.questions {
            let _ = writeln!(questions, "{question}").and_then(|()| questions.flush());
        }
        self.answer()
    }

    /// Returns the next line that the program writes.
    pub(crate) fn answer(&mut self) -> anyhow::Result<String> {
        let mut line = String::new();
        self.answers.read_line(&mut line).with_context(|| format!("{} cannot be read", self.name))?;
        if line.is_empty() {
            bail!("{} ended: {}; its message stands above", self.name, self.process.wait()?);
        }
        Ok(line)
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        // At the end of its questions, the program removes its files and ends.
        self.questions = None;
        let _ = self.process.wait();
    }
}
