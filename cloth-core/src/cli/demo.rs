use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Result;
use clap::Args;
use cloth_core::run::{Run, RunOptions};
use cloth_core::{Simulation, demo};

use super::print;
use super::run::{LogChoice, simulate};

#[derive(Debug, Args)]
pub struct Demo {
    /// Output folder; replaces the files of an earlier demo.
    #[arg(short, long, default_value = "out")]
    output: PathBuf,
}

impl Demo {
    pub fn run(self) -> Result<ExitCode> {
        let scene = demo::scene()?;
        print(&format!("{}\n", demo::audit_materials(&Simulation::new(&scene)?)?))?;
        let mut options = RunOptions::default();
        options.overwrite = true;
        let run = Run::new(demo::SCENE.to_owned(), "scenes/hang.toml".as_ref(), &self.output, options)?;
        simulate(run, false, LogChoice::Text)
    }
}
