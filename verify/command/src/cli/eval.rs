use std::path::PathBuf;

use clap::Args;
use verify_command::reference::{Source, evaluate_file};

/// Evaluates the records of a file and writes them with the results of the generated code (17 digits) and flags.
#[derive(Args)]
pub struct Eval {
    /// A `potref-1` or `potref-policy-1` file.
    records: PathBuf,
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
        let count = evaluate_file(&self.records, &self.output, source)?;
        println!("{count} records evaluated, written to {}", self.output.display());
        Ok(true)
    }
}
