//! Films of the pictures of frames: animated PNG, and MP4 by the program ffmpeg.

use std::fs::OpenOptions;
use std::io::{BufReader, ErrorKind};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use energy_files::PartFile;

use super::{Run, RunError};
use crate::output::OutputFolder;

/// A film that cannot be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FilmError {
    /// A picture cannot be read.
    #[error("cannot read the picture {}: {reason}", .path.display())]
    Picture {
        /// Path of the picture.
        path: PathBuf,
        /// The error of the file system or of the decoder.
        reason: String,
    },
    /// The animated PNG cannot be encoded.
    #[error("cannot encode cloth.apng: {0}")]
    Encoding(#[from] png::EncodingError),
    /// The program ffmpeg failed.
    #[error("ffmpeg cannot write cloth.mp4: {0}")]
    Ffmpeg(String),
}

/// Whether the program ffmpeg can be started.
pub(super) fn has_ffmpeg() -> bool {
    let started = Command::new("ffmpeg").arg("-version").stdout(Stdio::null()).stderr(Stdio::null()).status();
    started.is_ok_and(|status| status.success())
}

impl Run {
    /// Writes the pictures of all frames as one animated PNG.
    pub(super) fn write_apng(&self, rate: f64) -> Result<PathBuf, RunError> {
        let count = self.frames.frames().len();
        let pictures = (0..count).map(|number| decoded(&self.folder.frame_path(number, "png")));
        let contents = animated(pictures, count, rate)?;
        Ok(self.folder.write(OutputFolder::APNG, &contents)?)
    }

    /// Lets ffmpeg write a film of the pictures of all frames.
    pub(super) fn write_film(&self, rate: f64) -> Result<PathBuf, RunError> {
        let path = self.folder.path().join(OutputFolder::FILM);
        let pictures = self.folder.path().join(OutputFolder::FRAMES).join("cloth_%04d.png");
        let failed = |reason: String| RunError::from(FilmError::Ffmpeg(reason));
        // Created here, so that ffmpeg follows no link.
        let unfinished = PartFile::create(&path).map_err(|error| failed(error.to_string()))?;
        let mut command = Command::new("ffmpeg");
        command.args(["-y", "-loglevel", "error", "-framerate", &rate.to_string(), "-i"]).arg(pictures);
        // Films need even sizes.
        command
            .args(["-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-pix_fmt", "yuv420p", "-f", "mp4"])
            .arg(unfinished.path());
        let output = command.stdin(Stdio::null()).output().map_err(|error| failed(error.to_string()))?;
        if !output.status.success() {
            return Err(failed(String::from_utf8_lossy(&output.stderr).trim().to_owned()));
        }
        unfinished.finish().map_err(|error| failed(error.to_string()))?;
        Ok(path)
    }
}

/// The largest picture, in bytes.
const LARGEST_PICTURE: u64 = 256 << 20;

/// A picture: width, height and RGBA bytes.
struct Picture {
    size: [u32; 2],
    pixels: Vec<u8>,
}

fn decoded(path: &Path) -> Result<Picture, FilmError> {
    let unreadable = |reason: String| FilmError::Picture { path: path.to_owned(), reason };
    let file = energy_files::open_state(path, LARGEST_PICTURE, OpenOptions::new().read(true));
    let file = file.map_err(|error| unreadable(error.to_string()))?;
    let mut reader =
        png::Decoder::new(BufReader::new(file)).read_info().map_err(|error| unreadable(error.to_string()))?;
    // Pictures are drawn by this program, at most this large.
    let size = reader.output_buffer_size().filter(|&size| size <= LARGEST_PICTURE as usize);
    let size = size.ok_or_else(|| unreadable("it is too large".to_owned()))?;
    let mut pixels = vec![0; size];
    let info = reader.next_frame(&mut pixels).map_err(|error| unreadable(error.to_string()))?;
    if (info.color_type, info.bit_depth) != (png::ColorType::Rgba, png::BitDepth::Eight) {
        return Err(unreadable("expected RGBA with 8 bits each".to_owned()));
    }
    pixels.truncate(info.buffer_size());
    Ok(Picture { size: [info.width, info.height], pixels })
}

/// Encodes pictures of one size as an animated PNG that repeats for ever.
fn animated(
    mut pictures: impl Iterator<Item = Result<Picture, FilmError>>,
    count: usize,
    rate: f64,
) -> Result<Vec<u8>, FilmError> {
    let Some(first) = pictures.next().transpose()? else { return Ok(Vec::new()) };
    let mut contents = Vec::new();
    let mut encoder = png::Encoder::new(&mut contents, first.size[0], first.size[1]);
    encoder.set_color(png::ColorType::Rgba);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_animated(u32::try_from(count).unwrap_or(u32::MAX), 0)?;
    // The time of a frame in ms.
    encoder.set_frame_delay((1000.0 / rate).round().clamp(1.0, 65_535.0) as u16, 1000)?;
    let mut writer = encoder.write_header()?;
    writer.write_image_data(&first.pixels)?;
    for picture in pictures {
        let picture = picture?;
        if picture.size != first.size {
            let sizes = std::io::Error::new(ErrorKind::InvalidData, "the pictures have different sizes");
            return Err(png::EncodingError::from(sizes).into());
        }
        writer.write_image_data(&picture.pixels)?;
    }
    writer.finish()?;
    Ok(contents)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_animated_png_holds_all_pictures_and_their_time() {
        let picture = |level: u8| Ok(Picture { size: [2, 1], pixels: vec![level; 8] });
        let file = animated([10, 20, 30].into_iter().map(picture), 3, 25.0).unwrap();
        let mut reader = png::Decoder::new(std::io::Cursor::new(&file)).read_info().unwrap();
        let control = reader.info().animation_control.unwrap();
        assert_eq!((control.num_frames, control.num_plays), (3, 0));
        let mut pixels = vec![0; 8];
        for level in [10, 20, 30] {
            reader.next_frame(&mut pixels).unwrap();
            assert_eq!(pixels, vec![level; 8]);
            let frame = reader.info().frame_control.unwrap();
            assert_eq!((frame.delay_num, frame.delay_den), (40, 1000));
        }
    }
}
