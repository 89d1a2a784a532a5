use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use clap::Args;
use cloth_core::run::Record;
use cloth_core::scene::Scene;
use cloth_core::view::{self, Colouring, Moment, Screenshot};
use indicatif::ProgressBar;

use super::allowed_folders::AllowedFolders;
use super::print;

#[derive(Debug, Args)]
pub struct View {
    /// Scene file, or folder of a run.
    shown: PathBuf,
    /// Quantity shown by the colours.
    #[arg(long, value_enum, default_value_t)]
    colours: Colouring,
    /// Draw the edges of triangles.
    #[arg(long)]
    wireframe: bool,
    #[command(flatten)]
    allowed: AllowedFolders,
    /// Write a picture to this PNG file.
    #[arg(long, value_name = "FILE.png", value_parser = png_file)]
    screenshot: Option<PathBuf>,
    /// With --screenshot: the frame to draw, from 0; default: the last.
    #[arg(long, requires = "screenshot", conflicts_with = "time")]
    frame: Option<usize>,
    /// With --screenshot: the time to draw, in s.
    #[arg(long, requires = "screenshot", value_parser = non_negative)]
    time: Option<f64>,
}

impl View {
    pub fn run(&self) -> Result<()> {
        match &self.screenshot {
            Some(file) => self.write_screenshot(file),
            None => anyhow::bail!(
                "the window is a program of its own: `cargo run --release --manifest-path cloth-core/window/Cargo.toml \
                 -- {}`; or write a picture with --screenshot FILE.png",
                self.shown.display()
            ),
        }
    }

    /// Checks the paths of the scene before its files are read.
    fn check_paths(&self) -> Result<()> {
        if !self.shown.is_dir() {
            return self.allowed.check(&Scene::text(&self.shown)?, &self.shown);
        }
        let record = Record::read(&self.shown)?;
        self.allowed.check(&record.scene, &record.path)
    }

    fn write_screenshot(&self, file: &Path) -> Result<()> {
        self.check_paths()?;
        let moment = match (self.frame, self.time) {
            (Some(frame), _) => Moment::Frame(frame),
            (None, Some(time)) => Moment::Time(time),
            (None, None) => Moment::End,
        };
        let progress = ProgressBar::new_spinner();
        let shot = view::screenshot(&self.shown, moment, self.colours, self.wireframe, || progress.inc(1));
        progress.finish_and_clear();
        let Screenshot { png, time, legend } = shot?;
        energy_cli::write_whole(file, &png).with_context(|| format!("cannot write {}", file.display()))?;
        print(&format!("wrote {}: t = {time:.4} s, {legend}\n", file.display()))
    }
}

fn png_file(text: &str) -> Result<PathBuf, String> {
    let is_png = Path::new(text).extension().is_some_and(|extension| extension.eq_ignore_ascii_case("png"));
    if is_png {
        Ok(PathBuf::from(text))
    } else {
        Err("pictures are PNG; expected a name that ends with .png".to_owned())
    }
}

fn non_negative(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|x: &f64| x.is_finite() && *x >= 0.0)
        .ok_or_else(|| "expected a number of at least 0".to_owned())
}
