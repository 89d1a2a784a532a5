use std::path::{Path, PathBuf};

/// A folder or file that cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum OutputError {
    /// The folder cannot be made or written to.
    #[error("cannot write to the folder {}; choose another with -o", .path.display())]
    Folder {
        /// The folder.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// Results of an earlier run are in the way.
    #[error("{} exists; choose another folder with -o, or pass --overwrite", .path.display())]
    Exists {
        /// The file.
        path: PathBuf,
    },
    /// A file cannot be written.
    #[error("cannot write {}", .path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
}

/// Where a run's files go: `cloth.png`, `cloth.glb`, `cloth.usda`, `ledger.csv`, `ledger.svg`, `summary.txt`, `run.json`,
/// `frames/cloth_0000.obj`, … and the checkpoint. Each file appears under its name only once it is complete.
#[derive(Clone, Debug)]
pub struct OutputFolder {
    path: PathBuf,
}

impl OutputFolder {
    /// The picture's name.
    pub const PICTURE: &'static str = "cloth.png";
    /// The animation's name.
    pub const ANIMATION: &'static str = "cloth.glb";
    /// The name of the animation as USD.
    pub const USD: &'static str = "cloth.usda";
    /// The ledger's name.
    pub const LEDGER: &'static str = "ledger.csv";
    /// The name of its plot.
    pub const LEDGER_PLOT: &'static str = "ledger.svg";
    /// The name of what a run says of itself.
    pub const RECORD: &'static str = "run.json";
    /// The name of the report.
    pub const REPORT: &'static str = "report.html";
    /// The checkpoint's name.
    pub const CHECKPOINT: &'static str = "checkpoint";
    /// The name of the frames beside it.
    pub const SAVED_FRAMES: &'static str = "checkpoint.frames";
    /// The summary's name.
    pub const SUMMARY: &'static str = "summary.txt";
    /// The name of the folder of frames.
    pub const FRAMES: &'static str = "frames";

    /// All files of a run but the frames.
    const RESULTS: [&'static str; 10] = [
        Self::PICTURE,
        Self::ANIMATION,
        Self::SUMMARY,
        Self::USD,
        Self::LEDGER,
        Self::LEDGER_PLOT,
        Self::RECORD,
        Self::REPORT,
        Self::CHECKPOINT,
        Self::SAVED_FRAMES,
    ];

    /// Makes the folder and checks that it can be written to, before anything is computed. The files of an earlier run are removed when
    /// overwriting, so that nothing mixes two runs.
    ///
    /// # Errors
    /// When the folder cannot be made or written to, or holds results that are not to be overwritten.
    pub fn open(path: &Path, overwrite: bool) -> Result<Self, OutputError> {
        let folder = Self::reopen(path)?;
        let unusable = |source| OutputError::Folder { path: path.to_owned(), source };
        let results = Self::RESULTS.map(|name| path.join(name)).into_iter().filter(|path| path.exists());
        let old: Vec<PathBuf> = results.chain(folder.existing_frames().map_err(unusable)?).collect();
        match old.first() {
            Some(first) if !overwrite => Err(OutputError::Exists { path: first.clone() }),
            _ => {
                old.iter().try_for_each(std::fs::remove_file).map_err(unusable)?;
                Ok(folder)
            }
        }
    }

    /// The folder of a run that goes on, once it is known that it can be written to.
    ///
    /// # Errors
    /// When the folder cannot be made or written to.
    pub fn reopen(path: &Path) -> Result<Self, OutputError> {
        let folder = Self { path: path.to_owned() };
        let unusable = |source| OutputError::Folder { path: path.to_owned(), source };
        std::fs::create_dir_all(folder.frames()).map_err(unusable)?;
        for probed in [path.to_owned(), folder.frames()] {
            let probe = probed.join(".cloth-write-probe");
            std::fs::write(&probe, []).and_then(|()| std::fs::remove_file(&probe)).map_err(unusable)?;
        }
        Ok(folder)
    }

    /// The folder.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Writes a file, under a temporary name first.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn write(&self, name: &str, contents: &[u8]) -> Result<PathBuf, OutputError> {
        let path = self.path.join(name);
        verify::write_whole(&path, contents).map_err(|source| OutputError::File { path: path.clone(), source })?;
        Ok(path)
    }

    /// Writes frame `number` in the format of that extension.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn write_frame(&self, number: usize, extension: &str, contents: &[u8]) -> Result<PathBuf, OutputError> {
        self.write(&format!("{}/cloth_{number:04}.{extension}", Self::FRAMES), contents)
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
