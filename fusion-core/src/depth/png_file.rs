use std::io::BufReader;
use std::path::{Path, PathBuf};

use super::camera::MOST_PIXELS;
use super::image::DepthImage;

/// An image that cannot be read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DepthFileError {
    /// The file cannot be read or written.
    #[error("{}", .path.display())]
    File {
        /// Path of the file.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The file is not a PNG image, or is damaged.
    #[error("{}", .path.display())]
    Png {
        /// Path of the file.
        path: PathBuf,
        /// Error of the decoder.
        source: png::DecodingError,
    },
    /// The image has another format.
    #[error("{}: expected {expected}, found {found}", .path.display())]
    Format {
        /// Path of the file.
        path: PathBuf,
        /// Expected format.
        expected: &'static str,
        /// Actual format.
        found: String,
    },
    /// The image has another size.
    #[error(
        "{}: expected {}, got {found:?}", .path.display(),
        .expected.map_or(format!("at most {MOST_PIXELS} pixels"), |size| format!("{size:?} pixels as in the camera"))
    )]
    Size {
        /// Path of the file.
        path: PathBuf,
        /// Width and height that were expected; `None` if any size up to [`MOST_PIXELS`] was.
        expected: Option<[usize; 2]>,
        /// Width and height of the image.
        found: [usize; 2],
    },
    /// The image cannot be encoded.
    #[error("{}", .path.display())]
    Encode {
        /// Path of the file.
        path: PathBuf,
        /// Error of the encoder.
        source: png::EncodingError,
    },
}

struct Grey {
    width: usize,
    height: usize,
    bytes: Vec<u8>,
}

/// The largest file of an image, in bytes.
const LARGEST_FILE: u64 = 64 << 20;

/// A format of images.
struct Format {
    name: &'static str,
    depth: png::BitDepth,
    /// Width and height, in pixels; `None` for any that a camera may have.
    size: Option<[usize; 2]>,
}

/// Reads an image, after its header has been compared with the format.
fn read_grey(path: &Path, format: &Format) -> Result<Grey, DepthFileError> {
    let file = energy_files::open(path, LARGEST_FILE);
    let file = file.map_err(|source| DepthFileError::File { path: path.into(), source })?;
    let broken = |source| DepthFileError::Png { path: path.into(), source };
    let mut reader = png::Decoder::new(BufReader::new(file)).read_info().map_err(broken)?;
    let header = reader.info();
    let found = [header.width as usize, header.height as usize];
    let fits = match format.size {
        Some(size) => found == size,
        None => found[0].saturating_mul(found[1]) <= MOST_PIXELS,
    };
    if !fits {
        return Err(DepthFileError::Size { path: path.into(), expected: format.size, found });
    }
    let (colour, bits) = reader.output_color_type();
    let size = reader.output_buffer_size().unwrap_or(0);
    if (colour, bits) != (png::ColorType::Grayscale, format.depth) || size == 0 {
        let found = format!("{colour:?} of {} bits", bits as u8);
        return Err(DepthFileError::Format { path: path.into(), expected: format.name, found });
    }
    let mut bytes = vec![0; size];
    let info = reader.next_frame(&mut bytes).map_err(broken)?;
    bytes.truncate(info.buffer_size());
    Ok(Grey { width: info.width as usize, height: info.height as usize, bytes })
}

/// Reads a depth image: 16-bit grey, `per_metre` steps per metre (1000 for millimetres, 5000 in the TUM's data), 0
/// without a measurement. `size` has the expected width and height, which are compared before anything is decoded;
/// `None` accepts any size of up to [`MOST_PIXELS`].
///
/// # Errors
/// If the file cannot be read, or has another format or size.
pub fn read_depth(path: &Path, per_metre: f64, size: Option<[usize; 2]>) -> Result<DepthImage, DepthFileError> {
    let format = Format { name: "16-bit grey depth", depth: png::BitDepth::Sixteen, size };
    let Grey { width, height, bytes } = read_grey(path, &format)?;
    let steps = bytes.chunks_exact(2).map(|pair| u16::from_be_bytes([pair[0], pair[1]]));
    let depth = steps.map(|step| (f64::from(step) / per_metre) as f32).collect();
    Ok(DepthImage { width, height, depth })
}

/// Reads the pixels of a mask of this width and height: 8-bit grey, 0 where depths are ignored.
///
/// # Errors
/// If the file cannot be read, or has another format or size.
pub fn read_mask(path: &Path, size: [usize; 2]) -> Result<Vec<u8>, DepthFileError> {
    let format = Format { name: "an 8-bit grey mask", depth: png::BitDepth::Eight, size: Some(size) };
    Ok(read_grey(path, &format)?.bytes)
}

/// Writes a depth image completely or not at all. Depths are rounded to steps; depths beyond the largest step become 0.
///
/// # Errors
/// If the file cannot be written.
pub fn write_depth(path: &Path, image: &DepthImage, per_metre: f64) -> Result<(), DepthFileError> {
    let failed = |source| DepthFileError::Encode { path: path.into(), source };
    let mut bytes = Vec::with_capacity(2 * image.depth.len());
    for &depth in &image.depth {
        let step = (f64::from(depth) * per_metre).round();
        let step = if step >= 1.0 && step <= f64::from(u16::MAX) { step as u16 } else { 0 };
        bytes.extend(step.to_be_bytes());
    }
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, image.width as u32, image.height as u32);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::Sixteen);
    let mut writer = encoder.write_header().map_err(failed)?;
    writer.write_image_data(&bytes).map_err(failed)?;
    writer.finish().map_err(failed)?;
    energy_files::write_whole(path, &file).map_err(|source| DepthFileError::File { path: path.into(), source })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn depths_survive_a_file_up_to_rounding() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("d.png");
        let image = DepthImage { width: 3, height: 2, depth: vec![0.0, 1.0, 2.5004, f32::NAN, -1.0, 70.0] };
        write_depth(&path, &image, 1000.0).unwrap();
        let read = read_depth(&path, 1000.0, None).unwrap();
        assert_eq!(read.depth, [0.0, 1.0, 2.5, 0.0, 0.0, 0.0]);
        assert_eq!((read.width, read.height, read.valid()), (3, 2, 2));
        let error = read_mask(&path, [3, 2]).unwrap_err().to_string();
        assert!(error.contains("expected an 8-bit grey mask, found Grayscale of 16 bits"), "{error}");
        std::fs::write(&path, b"no image").unwrap();
        assert!(matches!(read_depth(&path, 1000.0, None), Err(DepthFileError::Png { .. })));
    }
}
