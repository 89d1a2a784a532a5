use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Result;
use clap::Args;
use cloth_core::run::Run;

use super::run::{limit_threads, simulate};

#[derive(Debug, Args)]
pub struct Resume {
    /// Folder of the run.
    folder: PathBuf,
    /// Print the tables of `cloth run --stats`.
    #[arg(long)]
    stats: bool,
    /// Maximum number of threads; default: one per core.
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..))]
    threads: Option<u16>,
}

impl Resume {
    pub fn run(self) -> Result<ExitCode> {
        simulate(limit_threads(Run::resume(&self.folder)?, self.threads), self.stats)
    }
}
