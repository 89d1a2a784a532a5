use std::path::PathBuf;
use std::time::Duration;

use anyhow::Context;
use clap::Args;
use energy_cli::print;
use verify::fuzz::{Budget, Finding, Summary, fuzz};
use verify_command::fuzz_targets::Target;

/// Feeds the compiler with edited inputs of a corpus. Exit status 1 on a panic, or an input that takes more than 20
/// seconds; that input is added to the corpus.
#[derive(Args)]
pub struct Fuzz {
    /// The reader of the inputs.
    target: Target,
    /// Minutes to run.
    #[arg(long, default_value_t = 1.0)]
    minutes: f64,
    /// Seed of the edits.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// A folder of inputs [default: the corpus in this repository].
    #[arg(long)]
    corpus: Option<PathBuf>,
}

impl Fuzz {
    pub fn run(self) -> anyhow::Result<bool> {
        let Self { target, minutes, seed, corpus } = self;
        let time = Duration::try_from_secs_f64(60.0 * minutes).context("--minutes")?;
        let corpus = corpus.unwrap_or_else(|| target.corpus());
        match fuzz(&corpus, target.words(), Budget::Time(time), seed, |text| target.run(text)) {
            Ok(Summary { corpus, edited, outcomes }) => {
                print(&format!(
                    "{corpus} inputs and {edited} edited ones: {outcomes} different outcomes, no panic, none slow\n"
                ))?;
                Ok(true)
            }
            Err(error) => {
                print(&format!("{}\n", error.downcast::<Finding>()?))?;
                Ok(false)
            }
        }
    }
}
