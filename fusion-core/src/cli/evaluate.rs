use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use clap::Args;
use comfy_table::{CellAlignment, Table, presets};
use energy_cli::write_file;
use fusion_core::body::{Mesh, read_body, read_vertices};
use fusion_core::depth::{DepthSequence, visible_vertices};
use fusion_core::evaluation::{ErrorSummary, FrameErrors, TrackErrors};
use fusion_core::picture::frame_picture;
use fusion_core::plot::errors_svg;
use fusion_core::skeleton::Skeleton;
use serde::Serialize;

use super::folder::{FILM, MODEL, SKELETON, mesh_file};
use super::page::{Shown, page};
use super::print;

/// Pixels of the image per pixel of a picture, along each axis.
const REDUCTION: usize = 2;

/// The largest film that the page includes, in bytes.
const LARGEST_FILM: u64 = 256 << 20;

/// Options of `fusion evaluate`.
#[derive(Debug, Args)]
pub struct Evaluate {
    /// Folder of a rendered recording.
    recording: PathBuf,
    /// Folder of its track.
    track: PathBuf,
}

#[derive(Serialize)]
struct Line {
    frame: usize,
    vertices: &'static str,
    mean_mm: f64,
    median_mm: f64,
    p95_mm: f64,
    share_below_25_mm: f64,
}

/// The errors of a track, and of the skeleton alone.
pub struct Evaluated {
    /// Errors of the track.
    pub track: TrackErrors,
    /// Errors of the skinned skeleton.
    pub skeleton: TrackErrors,
}

impl Evaluate {
    pub fn of(recording: &Path, track: &Path) -> Self {
        Self { recording: recording.to_owned(), track: track.to_owned() }
    }

    pub fn run(&self) -> Result<Evaluated> {
        let evaluated = self.measure()?;
        let [table, plot, html] = ["errors.csv", "errors.svg", "errors.html"].map(|name| self.track.join(name));
        write_file(&table, &csv(&evaluated.track)?)?;
        let picture = errors_svg(&evaluated.track).map_err(anyhow::Error::msg)?;
        write_file(&plot, picture.as_bytes())?;
        let rows = [("tracked", &evaluated.track), ("skeleton alone", &evaluated.skeleton)];
        let name = format!("Track {}", self.track.display());
        write_file(&html, page(&name, &rows, &picture, &self.pictures(&evaluated.track)?)?.as_bytes())?;
        let [table, plot, html] = [table, plot, html].map(|path| path.display().to_string());
        print(&format!("{}\nwrote {table}, {plot} and {html}\n", summary(&rows)))?;
        Ok(evaluated)
    }

    /// Draws the frames with the median and with the largest mean error, and shows the film, if the track has one.
    fn pictures(&self, errors: &TrackErrors) -> Result<Vec<Shown>> {
        let sequence = DepthSequence::open(&self.recording)?;
        let body = read_body(&self.recording.join(MODEL))?;
        let mut means: Vec<(usize, f64)> = errors
            .frames
            .iter()
            .enumerate()
            .map(|(at, one)| (at + 1, ErrorSummary::of(one.all.clone()).mean))
            .collect();
        means.sort_by(|a, b| a.1.total_cmp(&b.1));
        let mut shown = Vec::new();
        for (what, at) in [("median", means.len() / 2), ("largest", means.len() - 1)] {
            let (frame, mean) = means[at];
            let vertices = read_vertices(&mesh_file(&self.track, "meshes", frame)).context("the track")?;
            let mesh = Mesh::new(vertices, body.mesh.triangles.clone());
            let image = sequence.image(frame).ok();
            let picture = frame_picture(image.as_ref(), &mesh, &sequence.info.camera, REDUCTION);
            let caption = format!("frame {frame}, the {what} of the mean errors: {mean:.2} mm");
            shown.push(Shown { caption, png: picture.png()? });
        }
        let film = self.track.join(FILM);
        if film.exists() {
            let png = energy_files::read_state(&film, LARGEST_FILM).with_context(|| film.display().to_string())?;
            shown.push(Shown { caption: "all frames".into(), png });
        }
        Ok(shown)
    }

    /// Measures every frame except the first, which is the model's rest.
    fn measure(&self) -> Result<Evaluated> {
        let sequence = DepthSequence::open(&self.recording)?;
        let body = read_body(&self.recording.join(MODEL))?;
        let path = self.recording.join(SKELETON);
        let skeleton = Skeleton::read(&path)?.for_images(&path, sequence.len(), sequence.times())?;
        let mut evaluated = Evaluated { track: TrackErrors::default(), skeleton: TrackErrors::default() };
        for frame in 1..sequence.len() {
            let truth = read_vertices(&mesh_file(&self.recording, "truth", frame)).context("the truth")?;
            let found = read_vertices(&mesh_file(&self.track, "meshes", frame)).context("the track")?;
            ensure!(
                truth.len() == found.len(),
                "frame {frame}: the track has {} vertices, the truth {}; does the track belong to another recording?",
                found.len(),
                truth.len()
            );
            let mesh = Mesh::new(truth, body.mesh.triangles.clone());
            let visible = visible_vertices(&mesh, &sequence.info.camera);
            evaluated.track.frames.push(FrameErrors::new(&found, &mesh.vertices, &visible));
            if let Some(motions) = skeleton.motions(frame, &body.bones)? {
                let posed = body.posed(&motions).vertices;
                evaluated.skeleton.frames.push(FrameErrors::new(&posed, &mesh.vertices, &visible));
            }
        }
        ensure!(!evaluated.track.frames.is_empty(), "the recording has no frame after its first");
        Ok(evaluated)
    }
}

fn csv(errors: &TrackErrors) -> Result<Vec<u8>> {
    let mut table = csv::Writer::from_writer(Vec::new());
    for (at, frame) in errors.frames.iter().enumerate() {
        for (vertices, of) in [("all", &frame.all), ("visible", &frame.visible)] {
            let summary = ErrorSummary::of(of.clone());
            table.serialize(Line {
                frame: at + 1,
                vertices,
                mean_mm: summary.mean,
                median_mm: summary.median,
                p95_mm: summary.p95,
                share_below_25_mm: summary.share_below_25,
            })?;
        }
    }
    Ok(table.into_inner()?)
}

/// Formats end-point errors: one row per run and kind of vertices.
pub fn summary(rows: &[(&str, &TrackErrors)]) -> Table {
    let mut table = Table::new();
    let headings = ["run", "vertices", "mean, mm", "median, mm", "95 %, mm", "share < 25 mm"];
    table.load_preset(presets::NOTHING).set_header(headings);
    for column in 2..6 {
        if let Some(column) = table.column_mut(column) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    for (name, errors) in rows {
        for (vertices, one) in [("all", errors.all()), ("visible", errors.visible())] {
            table.add_row([
                (*name).to_owned(),
                vertices.to_owned(),
                format!("{:.2}", one.mean),
                format!("{:.2}", one.median),
                format!("{:.2}", one.p95),
                format!("{:.3}", one.share_below_25),
            ]);
        }
    }
    table
}
