//! The checkpoint of a track: its options, its frames so far, and the state of the tracker.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use energy_cli::tell;
use energy_files::sealed::{self, Seal};
use energy_files::{AppendFile, InputFile};
use fusion_core::tracker::{Tracker, TrackerState};
use fusion_core::twist::Twist;
use serde::{Deserialize, Serialize};

use super::folder::{CHECKPOINT, JOURNAL};
use super::frame::Line;
use super::track::Track;

const SEAL: Seal = Seal { keyword: "fusion-track", version: 1 };
/// The largest checkpoint, in bytes. The frames are in a file of their own.
const LARGEST_FILE: u64 = 1 << 30;

/// A frame in the journal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Done {
    pub line: Line,
    /// Twists of the nodes.
    pub twists: Vec<Twist>,
}

/// The contents of a checkpoint.
#[derive(Serialize, Deserialize)]
struct Stored {
    /// Options with absolute paths.
    track: Track,
    /// The inputs as they were when the track began.
    inputs: Vec<InputFile>,
    /// Length of the journal, in bytes, and its CRC-32.
    length: u64,
    checksum: u32,
    /// `None` before the first frame.
    tracker: Option<TrackerState>,
}

/// Frames in an append-only file, and a checkpoint that tells how many of them count.
#[derive(Debug)]
pub struct Journal {
    track: Track,
    inputs: Vec<InputFile>,
    file: AppendFile,
}

/// A track that continues.
pub struct Resumed {
    pub track: Track,
    pub journal: Journal,
    pub done: Vec<Done>,
    /// `None` before the first frame.
    pub tracker: Option<TrackerState>,
}

impl Journal {
    /// Begins a journal in an empty folder. Paths are absolute.
    pub fn create(track: &Track) -> Result<Self> {
        let path = track.output.join(JOURNAL);
        let file = AppendFile::create(&path).with_context(|| format!("cannot write {}", path.display()))?;
        let inputs = track.input_files().iter().filter_map(|path| InputFile::of(path)).collect();
        let journal = Self { track: track.clone(), inputs, file };
        journal.write(None)?;
        Ok(journal)
    }

    /// Opens the journal of a folder at its last checkpoint, or at the one before it if the last one is damaged.
    pub fn reopen(folder: &Path, accept_edited: bool) -> Result<Resumed> {
        let last = folder.join(CHECKPOINT);
        let previous = sealed::previous(&last);
        match Self::reopen_at(&last, folder, accept_edited) {
            Err(Unusable::Damaged(error)) if previous.symlink_metadata().is_ok() => {
                let resumed = Self::reopen_at(&previous, folder, accept_edited).map_err(Unusable::into_inner)?;
                sealed::restore_generation(&last).with_context(|| format!("cannot write {}", last.display()))?;
                let reason = energy_cli::message(&error);
                tell(&format!("note: {reason}; the track continues from the checkpoint before it"));
                Ok(resumed)
            }
            resumed => resumed.map_err(Unusable::into_inner),
        }
    }

    fn reopen_at(checkpoint: &Path, folder: &Path, accept_edited: bool) -> Result<Resumed, Unusable> {
        let unreadable = || format!("cannot read the checkpoint {}; is the track complete?", checkpoint.display());
        let file =
            energy_files::read_state(checkpoint, LARGEST_FILE).with_context(unreadable).map_err(Unusable::Damaged)?;
        let damaged = || format!("the checkpoint {}", checkpoint.display());
        let contents = SEAL.open(&file).with_context(damaged).map_err(Unusable::Damaged)?;
        let stored: Stored = serde_json::from_slice(contents).with_context(damaged).map_err(Unusable::Damaged)?;
        let Stored { mut track, inputs, length, checksum, tracker } = stored;
        if let Some(input) = inputs.iter().find(|input| input.is_edited()).filter(|_| !accept_edited) {
            return Err(Unusable::Other(anyhow::anyhow!(
                "{} was edited since the track began; restore it, start the track again, or pass --accept-edited",
                input.path.display()
            )));
        }
        track.output = folder.to_owned();
        let path = folder.join(JOURNAL);
        let damaged = || format!("the frames {}", path.display());
        let (file, frames) =
            AppendFile::reopen(&path, length, checksum).with_context(damaged).map_err(Unusable::Damaged)?;
        let done = serde_json::Deserializer::from_slice(&frames).into_iter().collect::<Result<Vec<Done>, _>>();
        let done = done.with_context(damaged).map_err(Unusable::Damaged)?;
        if done.is_empty() != tracker.is_none() {
            return Err(Unusable::Damaged(anyhow::anyhow!("{}: the state and the frames differ", damaged())));
        }
        Ok(Resumed { track: track.clone(), journal: Self { track, inputs, file }, done, tracker })
    }

    /// Adds a frame.
    pub fn add(&mut self, done: &Done) -> Result<()> {
        let mut line = serde_json::to_vec(done)?;
        line.push(b'\n');
        self.file.append(&line).with_context(|| format!("cannot write {}", self.file.path().display()))
    }

    /// Writes a checkpoint of all frames so far.
    pub fn save(&self, tracker: &Tracker) -> Result<()> {
        self.file.sync().with_context(|| format!("cannot write {}", self.file.path().display()))?;
        self.write((!self.file.is_empty()).then(|| tracker.state()))
    }

    fn write(&self, tracker: Option<TrackerState>) -> Result<()> {
        let stored = Stored {
            track: self.track.clone(),
            inputs: self.inputs.clone(),
            length: self.file.len(),
            checksum: self.file.checksum(),
            tracker,
        };
        let path = self.track.output.join(CHECKPOINT);
        sealed::write_generation(&path, &SEAL.close(&serde_json::to_vec(&stored)?))
            .with_context(|| format!("cannot write {}", path.display()))
    }

    /// Path of the frames.
    pub fn path(&self) -> &Path {
        self.file.path()
    }

    /// Removes the checkpoint of a complete track.
    pub fn remove(self) -> Result<()> {
        let last = self.track.output.join(CHECKPOINT);
        // The checkpoint first: without it, the frames mean nothing.
        let files: [PathBuf; 3] = [last.clone(), sealed::previous(&last), self.file.path().to_owned()];
        for path in files.iter().filter(|path| path.symlink_metadata().is_ok()) {
            energy_files::remove_file(path).with_context(|| format!("cannot remove {}", path.display()))?;
        }
        Ok(())
    }
}

/// Why a checkpoint cannot be used.
enum Unusable {
    /// The file is at fault; an older one may be whole.
    Damaged(anyhow::Error),
    /// Something else is at fault.
    Other(anyhow::Error),
}

impl Unusable {
    fn into_inner(self) -> anyhow::Error {
        match self {
            Self::Damaged(error) | Self::Other(error) => error,
        }
    }
}
