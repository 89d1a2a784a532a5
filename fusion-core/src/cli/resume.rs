use std::path::PathBuf;

use anyhow::{Context, Result, bail};
use clap::Args;
use energy_cli::Interrupts;

use super::folder::{CHECKPOINT, lock};
use super::journal::{Journal, Resumed};
use super::session::{Ended, Session};

/// Options of `fusion resume`.
#[derive(Debug, Args)]
pub struct Resume {
    /// Folder of a track that was stopped or killed.
    folder: PathBuf,
    /// Continue although inputs were edited since the track began.
    #[arg(long)]
    accept_edited: bool,
}

impl Resume {
    /// Continues a track. Its results are bit-identical to those of an uninterrupted one, up to times.
    pub fn run(&self, interrupts: &Interrupts) -> Result<Ended> {
        // Without a checkpoint, no lock is created.
        if !self.folder.is_dir() {
            bail!("{} is not a folder of a track", self.folder.display());
        }
        let _lock = lock(&self.folder)?;
        let Resumed { track, journal, done, tracker } = Journal::reopen(&self.folder, self.accept_edited)?;
        let mut inputs = track.inputs()?;
        if let Some(state) = tracker {
            let here = || self.folder.join(CHECKPOINT).display().to_string();
            inputs.tracker.restore(&state).with_context(here)?;
        }
        let mut session = Session::new(&track, inputs, journal)?;
        session.replay(done)?;
        session.go(interrupts)
    }
}
