//! Pictures, film, USD and glTF of a track, on request.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use energy_cli::write_file;
use fusion_core::animation::track_glb;
use fusion_core::body::Mesh;
use fusion_core::depth::{Camera, DepthImage};
use fusion_core::picture::{Picture, film, frame_picture, write_picture};
use fusion_core::skeleton::half_interval;
use fusion_core::usd::UsdWriter;
use nalgebra::Vector3;

use super::folder::{FILM, GLTF, USD, picture_file};

/// Pixels of the image per pixel of the film, along each axis.
const REDUCTION: usize = 2;
/// Frames per second of recordings without timestamps.
const USUAL_RATE: f64 = 30.0;

/// Writers of the files that were asked for.
pub struct TrackOutput {
    folder: PathBuf,
    camera: Camera,
    triangles: Vec<[u32; 3]>,
    frames_per_second: f64,
    /// Timestamps of the images in s; `None` without timestamps.
    times: Option<Vec<f64>>,
    /// Pictures of the film; `None` without pictures.
    pictures: Option<Vec<Picture>>,
    usd: Option<UsdWriter>,
    /// Vertices of each frame so far, for glTF; `None` without glTF.
    frames: Option<Vec<Vec<Vector3<f64>>>>,
}

impl TrackOutput {
    /// Begins the files. `times` are the timestamps of the images in s.
    pub fn new(folder: &Path, camera: Camera, triangles: &[[u32; 3]], times: Option<&[f64]>) -> Self {
        let interval = 2.0 * times.map_or(f64::INFINITY, half_interval);
        // A frame rate is a whole number in most programs; clocks are less exact.
        let frames_per_second = if interval.is_finite() { (1.0 / interval).round().max(1.0) } else { USUAL_RATE };
        Self {
            folder: folder.into(),
            camera,
            triangles: triangles.to_vec(),
            frames_per_second,
            times: times.map(<[f64]>::to_vec),
            pictures: None,
            usd: None,
            frames: None,
        }
    }

    /// Asks for a picture of each frame, and a film.
    pub fn with_pictures(mut self) -> Self {
        self.pictures = Some(Vec::new());
        self
    }

    /// Asks for USD of `frames` frames.
    pub fn with_usd(mut self, frames: usize) -> Result<Self> {
        let path = self.folder.join(USD);
        let last = self.time(frames.saturating_sub(1));
        let writer = UsdWriter::create(&path, &self.triangles, self.frames_per_second, last);
        self.usd = Some(writer.with_context(|| cannot_write(&path))?);
        Ok(self)
    }

    /// Asks for glTF.
    pub fn with_gltf(mut self) -> Self {
        self.frames = Some(Vec::new());
        self
    }

    /// Adds a frame. `image` is `None` if it could not be read.
    pub fn add(&mut self, frame: usize, image: Option<&DepthImage>, vertices: &[Vector3<f64>]) -> Result<()> {
        let time = self.time(frame);
        if let Some(usd) = &mut self.usd {
            usd.frame(time, vertices).with_context(|| cannot_write(&self.folder.join(USD)))?;
        }
        if let Some(frames) = &mut self.frames {
            frames.push(vertices.to_vec());
        }
        let Some(pictures) = &mut self.pictures else { return Ok(()) };
        let mesh = Mesh { vertices: vertices.to_vec(), normals: Vec::new(), triangles: self.triangles.clone() };
        let picture = frame_picture(image, &mesh, &self.camera, 1);
        write_picture(&picture_file(&self.folder, frame), picture.png())?;
        pictures.push(frame_picture(image, &mesh, &self.camera, REDUCTION));
        Ok(())
    }

    /// Completes the film, and the files of USD and glTF.
    pub fn finish(self) -> Result<()> {
        if let Some(frames) = &self.frames {
            let times: Vec<f64> = (0..frames.len()).map(|frame| self.time(frame) / self.frames_per_second).collect();
            let glb = track_glb(frames, &self.triangles, &times).context(GLTF)?;
            write_file(&self.folder.join(GLTF), glb)?;
        }
        if let Some(pictures) = self.pictures {
            write_picture(&self.folder.join(FILM), film(&pictures, self.frames_per_second as u16))?;
        }
        self.usd.map_or(Ok(()), UsdWriter::finish).with_context(|| cannot_write(&self.folder.join(USD)))
    }

    /// Returns the time code of a frame: frames of the usual interval since the first image.
    fn time(&self, frame: usize) -> f64 {
        let since = |times: &Vec<f64>| {
            let codes = (times.get(frame)? - times.first()?) * self.frames_per_second;
            Some((1e3 * codes).round() / 1e3)
        };
        self.times.as_ref().and_then(since).unwrap_or(frame as f64)
    }
}

fn cannot_write(path: &Path) -> String {
    format!("cannot write {}", path.display())
}
