use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::camera::Camera;
use super::image::DepthImage;
use super::png_file::{DepthFileError, read_depth, read_mask};

/// A folder that is no sequence.
#[derive(Debug, thiserror::Error)]
pub enum SequenceError {
    /// A file cannot be read or written.
    #[error("{}", .path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The intrinsics are malformed.
    #[error("{}", .path.display())]
    Json {
        /// The file.
        path: PathBuf,
        /// What the parser found, and where.
        source: serde_json::Error,
    },
    /// The intrinsics make no camera.
    #[error("{}: {fault}", .path.display())]
    Camera {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        fault: &'static str,
    },
    /// There are no images.
    #[error("{}: no images; expected depth.txt (`timestamp file` on each line) or depth/*.png", .path.display())]
    Empty {
        /// The folder.
        path: PathBuf,
    },
    /// An image cannot be used.
    #[error(transparent)]
    Image(#[from] DepthFileError),
    /// An image, or its mask, is of another size.
    #[error("{}: {found:?} pixels, but the camera has {expected:?}", .path.display())]
    Size {
        /// The image.
        path: PathBuf,
        /// The camera's.
        expected: [usize; 2],
        /// The image's.
        found: [usize; 2],
    },
}

/// What a sequence's `intrinsics.json` says.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SequenceInfo {
    /// The camera.
    #[serde(flatten)]
    pub camera: Camera,
    /// Steps of the images to a metre.
    #[serde(default = "millimetres")]
    pub depth_scale: f64,
}

fn millimetres() -> f64 {
    1000.0
}

/// A folder of depth images as the TUM's RGB-D data lays them out: `depth.txt` with a timestamp and a file on each line (or all of
/// `depth/*.png` in order), `intrinsics.json` beside it, and perhaps `mask/` with an 8-bit image of the same name for each.
#[derive(Clone, Debug)]
pub struct DepthSequence {
    folder: PathBuf,
    /// Camera and scale.
    pub info: SequenceInfo,
    images: Vec<PathBuf>,
}

impl DepthSequence {
    /// The file with the camera.
    pub const INTRINSICS: &'static str = "intrinsics.json";
    /// The list of images.
    pub const LIST: &'static str = "depth.txt";

    /// Opens a folder.
    ///
    /// # Errors
    /// When it lacks intrinsics or images.
    pub fn open(folder: &Path) -> Result<Self, SequenceError> {
        let path = folder.join(Self::INTRINSICS);
        let text =
            std::fs::read_to_string(&path).map_err(|source| SequenceError::File { path: path.clone(), source })?;
        let info: SequenceInfo =
            serde_json::from_str(&text).map_err(|source| SequenceError::Json { path: path.clone(), source })?;
        let scale = (info.depth_scale.is_nan() || info.depth_scale <= 0.0).then_some("depth_scale must be above 0");
        if let Some(fault) = info.camera.fault().or(scale) {
            return Err(SequenceError::Camera { path, fault });
        }
        let images = match std::fs::read_to_string(folder.join(Self::LIST)) {
            Ok(list) => list
                .lines()
                .filter(|line| !line.trim_start().starts_with('#'))
                .filter_map(|line| line.split_whitespace().nth(1).map(PathBuf::from))
                .collect(),
            Err(_) => images_in(folder),
        };
        if images.is_empty() {
            return Err(SequenceError::Empty { path: folder.to_owned() });
        }
        Ok(Self { folder: folder.to_owned(), info, images })
    }

    /// Frames.
    #[must_use]
    pub fn len(&self) -> usize {
        self.images.len()
    }

    /// Whether there are none; never, for an opened one.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.images.is_empty()
    }

    /// Reads an image, with its mask applied if it has one.
    ///
    /// # Errors
    /// When it is missing, of another kind, or of another size.
    pub fn image(&self, frame: usize) -> Result<DepthImage, SequenceError> {
        let path = self.folder.join(&self.images[frame]);
        let mut image = read_depth(&path, self.info.depth_scale)?;
        let expected = [self.info.camera.width, self.info.camera.height];
        let check = |path: &Path, found: [usize; 2]| {
            let path = path.to_owned();
            if found == expected { Ok(()) } else { Err(SequenceError::Size { path, expected, found }) }
        };
        check(&path, [image.width, image.height])?;
        let mask = self.folder.join("mask").join(self.images[frame].file_name().unwrap_or_default());
        if mask.exists() {
            let (width, height, pixels) = read_mask(&mask)?;
            check(&mask, [width, height])?;
            image.mask(&pixels);
        }
        Ok(image)
    }
}

fn images_in(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder.join("depth")).into_iter().flatten().filter_map(Result::ok);
    let mut images: Vec<PathBuf> = entries
        .map(|entry| Path::new("depth").join(entry.file_name()))
        .filter(|path| path.extension().is_some_and(|extension| extension == "png"))
        .collect();
    images.sort();
    images
}
