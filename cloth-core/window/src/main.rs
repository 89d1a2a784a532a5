//! `cloth-window`: shows a scene while it is simulated, or plays a run, in a window.

#![forbid(unsafe_code)]

mod window;

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context, Result};
use clap::Parser;
use cloth_core::run::Record;
use cloth_core::scene::Scene;
use cloth_core::view::Colouring;

/// Shows a scene while it is simulated, or plays a run, in a window. The key h lists the other keys.
#[derive(Debug, Parser)]
#[command(name = "cloth-window", version)]
struct Arguments {
    /// Scene file, or folder of a run.
    shown: PathBuf,
    /// Quantity shown by the colours; the key c changes it.
    #[arg(long, value_enum, default_value_t)]
    colours: Colouring,
    /// Draw the edges of triangles; the key w changes it.
    #[arg(long)]
    wireframe: bool,
    /// Folder, besides its own, whose files the scene may read; may be repeated.
    #[arg(long, value_name = "FOLDER")]
    allow_path: Vec<PathBuf>,
}

fn main() -> ExitCode {
    sigpipe::reset();
    run(&Arguments::parse()).map_or_else(
        |error| {
            energy_cli::tell(&format!("error: {}", energy_cli::message(&error)));
            ExitCode::FAILURE
        },
        |()| ExitCode::SUCCESS,
    )
}

fn run(arguments: &Arguments) -> Result<()> {
    arguments.check_paths()?;
    Ok(window::open_window(&arguments.shown, arguments.colours, arguments.wireframe)?)
}

impl Arguments {
    /// Checks the paths of the scene before its files are read.
    fn check_paths(&self) -> Result<()> {
        let (text, path) = if self.shown.is_dir() {
            let record = Record::read(&self.shown)?;
            (record.scene, record.path)
        } else {
            (Scene::text(&self.shown)?, self.shown.clone())
        };
        Scene::parse(&text, &path)?.check_paths(&self.allow_path).with_context(|| path.display().to_string())
    }
}
