use std::path::{Component, Path, PathBuf};

use energy_files::excerpt;

use super::image::DepthImage;
use super::intrinsics::{GivenCamera, SequenceInfo};
use super::png_file::{DepthFileError, read_depth, read_mask};
use crate::json_file::{JsonFileError, read_json};

/// The largest list of images, in bytes.
const LARGEST_LIST: u64 = 64 << 20;

/// A folder that is not a sequence of depth images.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SequenceError {
    /// The list of images cannot be read.
    #[error("{}", .path.display())]
    File {
        /// Path of the file.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The intrinsics cannot be read or are malformed.
    #[error(transparent)]
    Json(#[from] JsonFileError),
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
        /// Text of the line.
        found: String,
    },
    /// Timestamps do not increase.
    #[error("{}:{line}: expected a timestamp after {last} s, got {found} s; sort the list", .path.display())]
    Order {
        /// Path of the list.
        path: PathBuf,
        /// Line number, from 1.
        line: usize,
        /// Timestamp of the previous image.
        last: f64,
        /// Timestamp of the line.
        found: f64,
    },
    /// Neither a file nor the caller describes the camera.
    #[error(
        "{} does not exist; add it, or give the camera: `fx,fy,cx,cy` in pixels, or freiburg1, freiburg2 or freiburg3",
        .path.display()
    )]
    NoCamera {
        /// Path of the missing file.
        path: PathBuf,
    },
    /// Both a file and the caller describe the camera.
    #[error("{} exists, and a camera is given; remove one of them", .path.display())]
    TwoCameras {
        /// Path of the file.
        path: PathBuf,
    },
    /// No image can be read, so that the size of the camera's image is unknown.
    #[error("no image of {} can be read", .path.display())]
    NoReadableImage {
        /// Path of the folder.
        path: PathBuf,
        /// Error of the first image.
        source: DepthFileError,
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
    /// A line of the list of images names a file outside the folder.
    #[error("{}:{line}: expected a path inside the folder, got `{found}`", .path.display())]
    Outside {
        /// Path of the list.
        path: PathBuf,
        /// Line number, from 1.
        line: usize,
        /// Path in the list.
        found: String,
    },
}

/// A folder of depth images in the layout of the TUM's RGB-D data:
///
/// * `depth.txt` with a timestamp in s and a file on each line, or `depth/*.png` in order;
/// * `intrinsics.json`, unless the caller gives the camera;
/// * optionally `mask/` with an 8-bit image of the same name for each image.
#[derive(Clone, Debug)]
pub struct DepthSequence {
    folder: PathBuf,
    /// Camera and scale.
    pub info: SequenceInfo,
    images: Vec<PathBuf>,
    /// Timestamps in s; `None` without a list.
    times: Option<Vec<f64>>,
}

impl DepthSequence {
    /// File name of the camera.
    pub const INTRINSICS: &'static str = "intrinsics.json";
    /// File name of the list of images.
    pub const LIST: &'static str = "depth.txt";

    /// Opens a folder with `intrinsics.json`.
    ///
    /// # Errors
    /// Fails as [`Self::open_with`] does.
    pub fn open(folder: &Path) -> Result<Self, SequenceError> {
        Self::open_with(folder, None)
    }

    /// Opens a folder. A camera is given if, and only if, the folder has no `intrinsics.json`.
    ///
    /// # Errors
    /// If the folder has no images, a list whose timestamps do not increase, or not exactly one valid camera.
    pub fn open_with(folder: &Path, given: Option<GivenCamera>) -> Result<Self, SequenceError> {
        let path = folder.join(Self::INTRINSICS);
        let stored = path.exists().then(|| read_json::<SequenceInfo>(&path)).transpose()?;
        if stored.is_some() && given.is_some() {
            return Err(SequenceError::TwoCameras { path });
        }
        let list = folder.join(Self::LIST);
        let (images, times) = match energy_files::read_text(&list, LARGEST_LIST) {
            Ok(text) => {
                let (times, images) = listed(&list, &text)?.into_iter().unzip();
                (images, Some(times))
            }
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => (images_in(folder), None),
            Err(source) => return Err(SequenceError::File { path: list, source }),
        };
        let info = match (stored, given) {
            (Some(info), _) => info,
            (None, None) => return Err(SequenceError::NoCamera { path }),
            (None, Some(given)) => sized(folder, &images, given)?,
        };
        if let Some(fault) = info.fault() {
            return Err(SequenceError::Camera { path, fault });
        }
        if images.is_empty() {
            return Err(SequenceError::Empty { path: folder.to_owned() });
        }
        Ok(Self { folder: folder.to_owned(), info, images, times })
    }

    /// Returns the timestamps of the images in s, in increasing order; `None` without a list.
    #[must_use]
    pub fn times(&self) -> Option<&[f64]> {
        self.times.as_deref()
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
        let size = [self.info.camera.width, self.info.camera.height];
        let mut image = read_depth(&path, self.info.depth_scale, Some(size))?;
        let mask = self.folder.join("mask").join(self.images[frame].file_name().unwrap_or_default());
        if mask.exists() {
            image.mask(&read_mask(&mask, size)?);
        }
        Ok(image)
    }
}

/// Returns the camera for images of the size of the first one that can be read.
fn sized(folder: &Path, images: &[PathBuf], given: GivenCamera) -> Result<SequenceInfo, SequenceError> {
    let mut first = None;
    for image in images {
        match read_depth(&folder.join(image), given.depth_scale, None) {
            Ok(image) => return Ok(given.with_size(image.width, image.height)),
            Err(error) => first = first.or(Some(error)),
        }
    }
    let path = folder.to_owned();
    Err(first
        .map_or(SequenceError::Empty { path: path.clone() }, |source| SequenceError::NoReadableImage { path, source }))
}

/// Parses a list of images. Empty lines and comments after `#` are skipped.
fn listed(path: &Path, text: &str) -> Result<Vec<(f64, PathBuf)>, SequenceError> {
    let mut all: Vec<(f64, PathBuf)> = Vec::new();
    for (at, line) in text.lines().enumerate() {
        let line = line.split('#').next().unwrap_or_default().trim();
        if line.is_empty() {
            continue;
        }
        let mut words = line.split_whitespace();
        let time = words.next().and_then(|word| word.parse::<f64>().ok()).filter(|time| time.is_finite());
        let (Some(found), Some(file)) = (time, words.next()) else {
            return Err(SequenceError::List { path: path.to_owned(), line: at + 1, found: excerpt(line).into() });
        };
        if !Path::new(file).components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir)) {
            return Err(SequenceError::Outside { path: path.to_owned(), line: at + 1, found: excerpt(file).into() });
        }
        if let Some(&(last, _)) = all.last().filter(|(last, _)| *last >= found) {
            return Err(SequenceError::Order { path: path.to_owned(), line: at + 1, last, found });
        }
        all.push((found, file.into()));
    }
    Ok(all)
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
