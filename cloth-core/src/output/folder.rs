use std::path::{Path, PathBuf};
use std::sync::Arc;

use energy_files::{FolderLock, LockError, PartFile, create_folder, remove_file, remove_parts, subfolder};

/// A folder or file that cannot be written.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
#[non_exhaustive]
pub enum OutputError {
    /// The folder cannot be created or written to.
    #[error("cannot write to the folder {}; choose another with -o", .path.display())]
    Folder { path: PathBuf, source: std::io::Error },
    /// The folder holds the results of an earlier run.
    #[error("{} exists; choose another folder with -o, or pass --overwrite", .path.display())]
    Exists {
        /// A file of the earlier run.
        path: PathBuf,
    },
    /// Another run writes to the folder.
    #[error(transparent)]
    InUse(LockError),
    /// A file cannot be written.
    #[error("cannot write {}", .path.display())]
    File { path: PathBuf, source: std::io::Error },
}

impl From<LockError> for OutputError {
    fn from(error: LockError) -> Self {
        match error {
            LockError::File { path, source } => Self::File { path, source },
            in_use => Self::InUse(in_use),
        }
    }
}

/// File name of the lock.
const LOCK: &str = "cloth.lock";

/// Whether a path names anything, such as a symbolic link to nothing.
fn is_there(path: &Path) -> bool {
    path.symlink_metadata().is_ok()
}

/// The output folder of a run: `cloth.png`, `cloth.glb`, `cloth.usda`, `ledger.csv`, `ledger.svg`, `contact.svg`,
/// `measurements.csv`, `summary.txt`, `run.json`, `frames/cloth_0000.obj`, … and the checkpoint. Files are
/// written atomically.
#[derive(Clone, Debug)]
pub struct OutputFolder {
    path: PathBuf,
    /// Held by all clones; `None` for a report, and on file systems without locks.
    #[expect(dead_code, reason = "held until the last clone is dropped")]
    lock: Option<Arc<FolderLock>>,
}

impl OutputFolder {
    /// File name of the picture.
    pub const PICTURE: &'static str = "cloth.png";
    /// File name of the glTF animation.
    pub const ANIMATION: &'static str = "cloth.glb";
    /// File name of the animated PNG.
    pub const APNG: &'static str = "cloth.apng";
    /// File name of the film.
    pub const FILM: &'static str = "cloth.mp4";
    /// File name of the USD animation.
    pub const USD: &'static str = "cloth.usda";
    /// File name of the ledger.
    pub const LEDGER: &'static str = "ledger.csv";
    /// File name of the plot of the ledger.
    pub const LEDGER_PLOT: &'static str = "ledger.svg";
    /// Plot of the forces of contact.
    pub const CONTACT_PLOT: &'static str = "contact.svg";
    /// File name of the loads on pins and the strains of garments.
    pub const MEASUREMENTS: &'static str = "measurements.csv";
    /// File name of the machine-readable record.
    pub const RECORD: &'static str = "run.json";
    /// File name of the report.
    pub const REPORT: &'static str = "report.html";
    /// File name of the checkpoint.
    pub const CHECKPOINT: &'static str = "checkpoint";
    /// File name of the checkpoint before the last one.
    pub const PREVIOUS_CHECKPOINT: &'static str = "checkpoint.previous";
    /// File name of the frames saved with the checkpoint.
    pub const SAVED_FRAMES: &'static str = "checkpoint.frames";
    /// File name of the summary.
    pub const SUMMARY: &'static str = "summary.txt";
    /// Name of the folder of point caches.
    pub const CACHES: &'static str = "caches";
    /// Name of the folder of frames.
    pub const FRAMES: &'static str = "frames";

    /// All files of a run except the frames.
    const RESULTS: [&'static str; 15] = [
        Self::PICTURE,
        Self::ANIMATION,
        Self::SUMMARY,
        Self::USD,
        Self::APNG,
        Self::FILM,
        Self::LEDGER,
        Self::LEDGER_PLOT,
        Self::CONTACT_PLOT,
        Self::MEASUREMENTS,
        Self::RECORD,
        Self::REPORT,
        Self::CHECKPOINT,
        Self::PREVIOUS_CHECKPOINT,
        Self::SAVED_FRAMES,
    ];

    /// Creates the folder, locks it, and checks that it can be written to, before anything is computed. With
    /// `overwrite`, removes the files of an earlier run, so that two runs never mix.
    ///
    /// # Errors
    /// Returns an error if the folder cannot be created or written to, if another run writes to it, or if it holds
    /// results and `overwrite` is not set.
    pub fn open(path: &Path, overwrite: bool) -> Result<Self, OutputError> {
        let folder = Self::reopen(path)?;
        let unusable = |source| OutputError::Folder { path: path.to_owned(), source };
        let results = Self::RESULTS.map(|name| path.join(name)).into_iter().filter(|path| is_there(path));
        let frames = folder.existing_frames().map_err(unusable)?;
        let caches = folder.existing_caches().map_err(unusable)?;
        let old: Vec<PathBuf> = results.chain(frames).chain(caches).collect();
        match old.first() {
            Some(first) if !overwrite => Err(OutputError::Exists { path: first.clone() }),
            _ => {
                old.iter().try_for_each(remove_file).map_err(unusable)?;
                Ok(folder)
            }
        }
    }

    /// Opens and locks the folder of a run that is resumed, and checks that it can be written to.
    ///
    /// # Errors
    /// Returns an error if the folder cannot be written to, or if another run writes to it.
    pub fn reopen(path: &Path) -> Result<Self, OutputError> {
        let folder = Self::unlocked(path)?;
        let folder = Self { lock: FolderLock::take(path, LOCK)?.map(Arc::new), ..folder };
        // A killed run may have left unfinished files.
        let caches =
            Some(path.join(Self::CACHES)).filter(|caches| caches.symlink_metadata().is_ok_and(|it| it.is_dir()));
        let mut folders = [path.to_owned(), folder.frames()].into_iter().chain(caches);
        folders.try_for_each(|path| remove_parts(&path)).map_err(|source| {
            let path = path.to_owned();
            OutputError::Folder { path, source }
        })?;
        Ok(folder)
    }

    /// Opens the folder of a run that is reported, and checks that it can be written to. Does not lock it: the report
    /// is not a file of the run.
    ///
    /// # Errors
    /// Returns an error if the folder cannot be written to.
    pub fn unlocked(path: &Path) -> Result<Self, OutputError> {
        let folder = Self { path: path.to_owned(), lock: None };
        let unusable = |source| OutputError::Folder { path: path.to_owned(), source };
        create_folder(path).map_err(unusable)?;
        let frames = subfolder(path, Self::FRAMES).map_err(unusable)?;
        for probed in [path.to_owned(), frames] {
            PartFile::create(&probed.join("probe")).map_err(unusable)?;
        }
        Ok(folder)
    }

    /// Path of the folder.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Writes a checkpoint, and keeps the one before it.
    ///
    /// # Errors
    /// Returns an error if a file cannot be written.
    pub fn write_checkpoint(&self, contents: &[u8]) -> Result<(), OutputError> {
        let path = self.path.join(Self::CHECKPOINT);
        energy_files::sealed::write_generation(&path, contents).map_err(|source| OutputError::File { path, source })
    }

    /// Puts the checkpoint before the last one in the place of the last one, which is damaged.
    ///
    /// # Errors
    /// Returns an error if the file cannot be renamed.
    pub fn restore_checkpoint(&self) -> Result<(), OutputError> {
        let path = self.path.join(Self::CHECKPOINT);
        energy_files::sealed::restore_generation(&path).map_err(|source| OutputError::File { path, source })
    }

    /// Writes a file atomically and returns its path.
    ///
    /// # Errors
    /// Returns an error if the file cannot be written.
    pub fn write(&self, name: &str, contents: &[u8]) -> Result<PathBuf, OutputError> {
        let path = self.path.join(name);
        energy_files::write_whole(&path, contents)
            .map_err(|source| OutputError::File { path: path.clone(), source })?;
        Ok(path)
    }

    /// Writes frame `number` in the format of the extension, and returns its path.
    ///
    /// # Errors
    /// Returns an error if the file cannot be written.
    pub fn write_frame(&self, number: usize, extension: &str, contents: &[u8]) -> Result<PathBuf, OutputError> {
        self.write(&Self::frame_name(number, extension), contents)
    }

    /// Writes a point cache, and returns its path.
    ///
    /// # Errors
    /// Returns an error if the file cannot be written.
    pub fn write_cache(&self, name: &str, contents: &[u8]) -> Result<PathBuf, OutputError> {
        let unusable = |source| OutputError::Folder { path: self.path.join(Self::CACHES), source };
        subfolder(&self.path, Self::CACHES).map_err(unusable)?;
        self.write(&format!("{}/{name}", Self::CACHES), contents)
    }

    fn existing_caches(&self) -> std::io::Result<Vec<PathBuf>> {
        let folder = self.path.join(Self::CACHES);
        if !is_there(&folder) {
            return Ok(Vec::new());
        }
        subfolder(&self.path, Self::CACHES)?;
        let entries = std::fs::read_dir(folder)?.map(|entry| Ok(entry?.path()));
        let is_cache =
            |path: &PathBuf| path.extension().is_some_and(|extension| extension == "pc2" || extension == "mdd");
        let mut caches: Vec<PathBuf> = entries.collect::<std::io::Result<_>>()?;
        caches.retain(is_cache);
        caches.sort();
        Ok(caches)
    }

    /// Returns the path of frame `number` in the format of the extension.
    #[must_use]
    pub fn frame_path(&self, number: usize, extension: &str) -> PathBuf {
        self.path.join(Self::frame_name(number, extension))
    }

    fn frame_name(number: usize, extension: &str) -> String {
        format!("{}/cloth_{number:04}.{extension}", Self::FRAMES)
    }

    fn frames(&self) -> PathBuf {
        self.path.join(Self::FRAMES)
    }

    fn existing_frames(&self) -> std::io::Result<Vec<PathBuf>> {
        let mut frames = Vec::new();
        for entry in std::fs::read_dir(self.frames())? {
            let path = entry?.path();
            let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
            let number = ["obj", "ply", "png"]
                .iter()
                .find_map(|extension| name.strip_prefix("cloth_")?.strip_suffix(extension)?.strip_suffix('.'));
            if number.is_some_and(|number| number.len() >= 4 && number.bytes().all(|byte| byte.is_ascii_digit())) {
                frames.push(path);
            }
        }
        frames.sort();
        Ok(frames)
    }
}
