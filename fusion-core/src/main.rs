//! `fusion`: renders, tracks and evaluates bodies in depth images.

#![forbid(unsafe_code)]

mod cli;

use std::process::ExitCode;

use anyhow::Result;
use clap::{Parser, Subcommand};

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
    /// Compares a track with the truth: table, plot, and a page with pictures.
    Evaluate(cli::evaluate::Evaluate),
}

fn main() -> ExitCode {
    // A closed pipe (`| head`) ends the program without a panic.
    sigpipe::reset();
    match obey(Arguments::parse().command) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {}", energy_cli::message(&error));
            ExitCode::FAILURE
        }
    }
}

fn obey(command: Command) -> Result<()> {
    match command {
        Command::Demo(demo) => demo.run(),
        Command::Render(render) => render.run(),
        Command::Pose(pose) => pose.run(),
        Command::Track(track) => track.run(),
        Command::Evaluate(evaluate) => evaluate.run().map(drop),
    }
}
