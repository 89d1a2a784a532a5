use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Result;
use clap::Args;
use cloth_core::run::Run;

use super::allowed_folders::AllowedFolders;
use super::run::{LogChoice, limit_threads, simulate};

#[derive(Debug, Args)]
pub struct Resume {
    /// Folder of the run.
    folder: PathBuf,
    /// Continue although meshes or materials were edited since the run began.
    #[arg(long)]
    accept_edited: bool,
    #[command(flatten)]
    allowed: AllowedFolders,
    /// Print the tables of `cloth run --stats`.
    #[arg(long)]
    stats: bool,
    /// Form of progress and results: `text`, or `json`: one object per line on standard output.
    #[arg(long, value_enum, default_value_t)]
    log: LogChoice,
    /// Maximum number of threads; default: one per core.
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..))]
    threads: Option<u16>,
}

impl Resume {
    pub fn run(self) -> Result<ExitCode> {
        let run =
            Run::resume_checked(&self.folder, self.accept_edited, |scene| scene.check_paths(self.allowed.folders()))?;
        simulate(limit_threads(run, self.threads), self.stats, self.log)
    }
}
