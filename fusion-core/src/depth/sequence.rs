use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::camera::Camera;
use super::image::DepthImage;
use super::png_file::{DepthFileError, read_depth, read_mask};

/// A folder that is not a sequence of depth images.
#[derive(Debug, thiserror::Error)]
pub enum SequenceError {
    /// A file cannot be read or written.
    #[error("{}", .path.display())]
    File {
        /// Path of the file.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The intrinsics are malformed.
    #[error("{}", .path.display())]
    Json {
        /// Path of the file.
        path: PathBuf,
        /// Error of the parser, with its position.
        source: serde_json::Error,
    },
    /// The intrinsics are invalid.
    #[error("{}: {fault}", .path.display())]
    Camera {
        /// Path of the file.
        path: PathBuf,
        /// Description of the error.
        fault: &'static str,
    },
    /// A line of the list of images is malformed.
    #[error("{}:{line}: expected a timestamp in s and a file, got `{found}`", .path.display())]
    List {
        /// Path of the list.
        path: PathBuf,
        /// Line number, from 1.
        line: usize,
        /// The line.
        found: String,
    },
    /// The folder contains no images.
    #[error("{}: no images; expected depth.txt (`timestamp file` on each line) or depth/*.png", .path.display())]
    Empty {
        /// Path of the folder.
        path: PathBuf,
    },
    /// An image cannot be read.
    #[error(transparent)]
    Image(#[from] DepthFileError),
    /// The size of an image or its mask differs from the camera's.
    #[error("{}: expected {expected:?} pixels as in the camera, got {found:?}", .path.display())]
    Size {
        /// Path of the image.
        path: PathBuf,
        /// Size of the camera.
        expected: [usize; 2],
        /// Size of the image.
        found: [usize; 2],
    },
}

/// Contents of a sequence's `intrinsics.json`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(from = "StoredInfo")]
pub struct SequenceInfo {
    /// The depth camera.
    #[serde(flatten)]
    pub camera: Camera,
    /// Steps of the images per metre.
    pub depth_scale: f64,
}

/// The keys of the file. Unknown ones are errors, which `flatten` would hide.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct StoredInfo {
    fx: f64,
    fy: f64,
    cx: f64,
    cy: f64,
    width: usize,
    height: usize,
    #[serde(default = "millimetres")]
    depth_scale: f64,
}

impl From<StoredInfo> for SequenceInfo {
    fn from(stored: StoredInfo) -> Self {
        let StoredInfo { fx, fy, cx, cy, width, height, depth_scale } = stored;
        Self { camera: Camera { fx, fy, cx, cy, width, height }, depth_scale }
    }
}

fn millimetres() -> f64 {
    1000.0
}

/// A folder of depth images in the layout of the TUM's RGB-D data:
///
/// * `depth.txt` with a timestamp and a file on each line, or `depth/*.png` in order;
/// * `intrinsics.json`;
/// * optionally `mask/` with an 8-bit image of the same name for each image.
#[derive(Clone, Debug)]
pub struct DepthSequence {
    folder: PathBuf,
    /// Camera and scale.
    pub info: SequenceInfo,
    images: Vec<PathBuf>,
}

impl DepthSequence {
    /// File name of the camera.
    pub const INTRINSICS: &'static str = "intrinsics.json";
    /// File name of the list of images.
    pub const LIST: &'static str = "depth.txt";

    /// Opens a folder.
    ///
    /// # Errors
    /// If it lacks intrinsics or images.
    pub fn open(folder: &Path) -> Result<Self, SequenceError> {
        let path = folder.join(Self::INTRINSICS);
        let text =
            std::fs::read_to_string(&path).map_err(|source| SequenceError::File { path: path.clone(), source })?;
        let info: SequenceInfo =
            serde_json::from_str(&text).map_err(|source| SequenceError::Json { path: path.clone(), source })?;
        let scale = (!(info.depth_scale > 0.0 && info.depth_scale.is_finite()))
            .then_some("expected a `depth_scale` greater than 0");
        if let Some(fault) = info.camera.fault().or(scale) {
            return Err(SequenceError::Camera { path, fault });
        }
        let list = folder.join(Self::LIST);
        let images = match std::fs::read_to_string(&list) {
            Ok(text) => listed(&list, &text)?,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => images_in(folder),
            Err(source) => return Err(SequenceError::File { path: list, source }),
        };
        if images.is_empty() {
            return Err(SequenceError::Empty { path: folder.to_owned() });
        }
        Ok(Self { folder: folder.to_owned(), info, images })
    }

    /// Returns the number of frames.
    #[must_use]
    pub fn len(&self) -> usize {
        self.images.len()
    }

    /// Whether the sequence is empty; always `false`.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.images.is_empty()
    }

    /// Reads an image and applies its mask, if it has one.
    ///
    /// # Errors
    /// If the image is missing, or has another format or size.
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

/// Parses a list of images. Empty lines and comments after `#` are skipped.
fn listed(path: &Path, text: &str) -> Result<Vec<PathBuf>, SequenceError> {
    let lines = text.lines().enumerate().map(|(at, line)| (at, line.trim()));
    let image = |(at, line): (usize, &str)| {
        let mut words = line.split_whitespace();
        let time = words.next().and_then(|word| word.parse::<f64>().ok()).filter(|time| time.is_finite());
        match (time, words.next()) {
            (Some(_), Some(file)) => Ok(PathBuf::from(file)),
            _ => Err(SequenceError::List { path: path.to_owned(), line: at + 1, found: line.to_owned() }),
        }
    };
    lines.filter(|(_, line)| !line.is_empty() && !line.starts_with('#')).map(image).collect()
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
