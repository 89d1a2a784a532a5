//! `fusion`: renders, tracks and evaluates bodies in depth images.

#![forbid(unsafe_code)]

mod cli;

use std::process::ExitCode;

use anyhow::Result;
use clap::{Parser, Subcommand};
use cli::session::{Ended, begin};
use energy_cli::Interrupts;

/// Tracks a deforming body in depth images.
#[derive(Debug, Parser)]
#[command(version)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Audits the terms of the energy, renders a figure of tubes, tracks it with exact and with noisy bones, and
    /// evaluates both tracks.
    Demo(cli::demo::Demo),
    /// Renders a moving body as a depth camera sees it: images, model, skeleton, truth.
    Render(cli::render::Render),
    /// Poses a body frame by frame: a mesh for each, as an obstacle of cloth that deforms.
    Pose(cli::pose::Pose),
    /// Tracks a model through depth images: node motions, moved meshes, a table of frames; pictures and USD on request.
    Track(cli::track::Track),
    /// Continues a track that was stopped or killed; bit-identical to an uninterrupted one.
    Resume(cli::resume::Resume),
    /// Compares a track with the truth: table, plot, and a page with pictures.
    Evaluate(cli::evaluate::Evaluate),
}

fn main() -> ExitCode {
    // A closed pipe (`| head`) ends the program without a panic.
    sigpipe::reset();
    match energy_cli::report_file_limits().and_then(|()| obey(Arguments::parse().command)) {
        Ok(code) => code,
        Err(error) => {
            energy_cli::tell(&format!("error: {}", energy_cli::message(&error)));
            ExitCode::FAILURE
        }
    }
}

fn obey(command: Command) -> Result<ExitCode> {
    match command {
        Command::Render(render) => render.run(),
        Command::Pose(pose) => pose.run(),
        Command::Evaluate(evaluate) => evaluate.run().map(drop),
        Command::Demo(demo) => return until_signal(|interrupts| demo.run(interrupts)),
        Command::Track(track) => return until_signal(|interrupts| begin(&track, interrupts)),
        Command::Resume(resume) => return until_signal(|interrupts| resume.run(interrupts)),
    }
    .map(|()| ExitCode::SUCCESS)
}

/// Runs a command that ends early at a signal. The exit code is then 128 and the number of the signal.
fn until_signal(run: impl FnOnce(&Interrupts) -> Result<Ended>) -> Result<ExitCode> {
    let interrupts = Interrupts::listen()?;
    run(&interrupts).map(|ended| ended.exit_code(&interrupts))
}
