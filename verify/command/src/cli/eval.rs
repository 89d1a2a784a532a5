use std::path::PathBuf;

use clap::Args;
use energy_cli::print;
use verify_command::reference::{Source, evaluate_file, evaluate_inputs};

use super::targets::targets;

/// Evaluates the records of a file and writes them with the results of the generated code (17 digits) and flags.
#[derive(Args)]
pub struct Eval {
    /// A `potref-1` or `potref-policy-1` file, or families of body tracking; with `--file`, inputs in the form that
    /// `verify audit --at` reads.
    records: PathBuf,
    /// Evaluate the declarations of this file (`.energy`).
    #[arg(long, value_name = "FILE")]
    file: Option<PathBuf>,
    /// The file to write.
    #[arg(short, long)]
    output: PathBuf,
    /// Write the formula's results in multi-precision instead, with this many digits.
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=500))]
    digits: Option<u16>,
}

impl Eval {
    pub fn run(self) -> anyhow::Result<bool> {
        let source = self.digits.map_or(Source::GeneratedCode, |digits| Source::Truth { digits: digits.into() });
        let count = match self.file {
            None => evaluate_file(&self.records, &self.output, source)?,
            Some(file) => evaluate_inputs(&targets(&[], Some(&file))?, &self.records, &self.output, source)?,
        };
        print(&format!("{count} records evaluated, written to {}\n", self.output.display()))?;
        Ok(true)
    }
}
