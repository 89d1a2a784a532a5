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

/// Where a run's files go: `cloth.png`, `cloth.glb`, `summary.txt` and `frames/cloth_0000.obj`, …. Each file appears under its name
/// only once it is complete.
#[derive(Clone, Debug)]
pub struct OutputFolder {
    path: PathBuf,
}

impl OutputFolder {
    /// The picture's name.
    pub const PICTURE: &'static str = "cloth.png";
    /// The animation's name.
    pub const ANIMATION: &'static str = "cloth.glb";
    /// The summary's name.
    pub const SUMMARY: &'static str = "summary.txt";
    /// The name of the folder of OBJ frames.
    pub const FRAMES: &'static str = "frames";

    /// Makes the folder and checks that it can be written to, before anything is computed. Frames of an earlier run are removed when
    /// overwriting, so that no sequence mixes two runs.
    ///
    /// # Errors
    /// When the folder cannot be made or written to, or holds results that are not to be overwritten.
    pub fn open(path: &Path, overwrite: bool) -> Result<Self, OutputError> {
        let folder = Self { path: path.to_owned() };
        let unusable = |source| OutputError::Folder { path: path.to_owned(), source };
        std::fs::create_dir_all(folder.frames()).map_err(unusable)?;
        for probed in [path.to_owned(), folder.frames()] {
            let probe = probed.join(".cloth-write-probe");
            std::fs::write(&probe, []).and_then(|()| std::fs::remove_file(&probe)).map_err(unusable)?;
        }
        let results = [Self::PICTURE, Self::ANIMATION, Self::SUMMARY].map(|name| path.join(name));
        let old_frames = folder.existing_frames().map_err(unusable)?;
        if !overwrite && let Some(path) = results.iter().chain(&old_frames).find(|path| path.exists()) {
            return Err(OutputError::Exists { path: path.clone() });
        }
        old_frames.iter().try_for_each(std::fs::remove_file).map_err(unusable)?;
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

    /// Writes frame `number` as OBJ.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn write_frame(&self, number: usize, obj: &str) -> Result<PathBuf, OutputError> {
        self.write(&format!("{}/cloth_{number:04}.obj", Self::FRAMES), obj.as_bytes())
    }

    fn frames(&self) -> PathBuf {
        self.path.join(Self::FRAMES)
    }

    fn existing_frames(&self) -> std::io::Result<Vec<PathBuf>> {
        let mut frames = Vec::new();
        for entry in std::fs::read_dir(self.frames())? {
            let path = entry?.path();
            let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
            let number = name.strip_prefix("cloth_").and_then(|rest| rest.strip_suffix(".obj"));
            if number.is_some_and(|number| number.len() >= 4 && number.bytes().all(|byte| byte.is_ascii_digit())) {
                frames.push(path);
            }
        }
        frames.sort();
        Ok(frames)
    }
}
