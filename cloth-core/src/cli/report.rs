use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use cloth_core::run::write_report;

use super::print;

#[derive(Debug, Args)]
pub struct Report {
    /// Folder of the run.
    folder: PathBuf,
}

impl Report {
    pub fn run(&self) -> Result<()> {
        print(&format!("wrote {}\n", write_report(&self.folder)?.display()))
    }
}
