//! `cloth`: simulates scenes, shows results and validates the simulator.

#![forbid(unsafe_code)]

mod cli;

use std::process::ExitCode;

use anyhow::Result;
use clap::{CommandFactory, Parser, Subcommand};

const EXIT_STATUS: &str = "\
Exit status:
  0    everything was done
  1    an error: an invalid scene, a step that failed, a file that cannot be written, a missed answer of `validate`
  2    invalid arguments
  129, 130, 143    a run was ended by SIGHUP, Ctrl-C or SIGTERM; its results so far are written";

/// Simulates cloth and hair with audited derivatives.
#[derive(Debug, Parser)]
#[command(name = "cloth", version, after_help = EXIT_STATUS, after_long_help = EXIT_STATUS)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Audit the materials of a sheet hung by two corners, simulate it, and write a picture and animations.
    Demo(cli::demo::Demo),
    /// Simulate a scene, and write a picture, animations and frames.
    Run(cli::run::RunScene),
    /// Resume an interrupted run from its last checkpoint; bit-identical to an uninterrupted run.
    Resume(cli::resume::Resume),
    /// Run a scene with all combinations of some values; one folder for each run, one index of all.
    Sweep(cli::sweep::Sweep),
    /// Measure a finished run, a scene or a mesh: drape coefficient and nodes, strain, extension against force.
    Measure(cli::measure::Measure),
    /// Test a fabric as a lab does (KES tensile, shear and bending, Cusick's drape), and compare with the declared
    /// material.
    Test(cli::test::Test),
    /// Write report.html of a finished run: picture, energies, times, evaluation counts, audit of its elements.
    Report(cli::report::Report),
    /// Write a picture of a scene or a run, without a display (`--screenshot`). `cloth-window` shows them in a window.
    View(cli::view::View),
    /// Print the JSON schema of scene files, for editors.
    Schema,
    /// List the declared elements: formula, parameters with units, operations per routine.
    Materials,
    /// Compare simulations with exact results for strips, sheets and motions; exit status 1 if one differs too much.
    Validate(cli::validate::Validate),
    /// Time the steps of a hanging sheet, 1 m × 1 m: implicit Euler by Newton's method, steps of 10 ms. Or measure the
    /// error of integrators, or of the steps of a scene.
    Bench(cli::bench::Bench),
    /// List the fabrics of the library, print them as tables for scene files, plot them, or read those of ARCSim.
    Fabrics(cli::fabrics::Fabrics),
    /// Print a script that completes this command in a shell.
    Completions(cli::completions::Completions),
    /// Print the manual page, or write those of all subcommands.
    Man(cli::manual::Manual),
}

fn main() -> ExitCode {
    // Exit quietly if the reader closes the pipe (`| head`).
    sigpipe::reset();
    energy_cli::report_file_limits().and_then(|()| run(Arguments::parse().command)).unwrap_or_else(|error| {
        energy_cli::tell(&format!("error: {}", energy_cli::message(&error)));
        ExitCode::FAILURE
    })
}

fn run(command: Command) -> Result<ExitCode> {
    match command {
        Command::Demo(demo) => return demo.run(),
        Command::Run(scene) => return scene.run(),
        Command::Resume(resume) => return resume.run(),
        Command::Sweep(sweep) => return sweep.run(),
        Command::Measure(measure) => return measure.run(),
        Command::Test(test) => return test.run(),
        Command::Bench(bench) => return bench.run(),
        Command::Report(report) => report.run(),
        Command::View(view) => view.run(),
        Command::Schema => cli::schema::run(),
        Command::Materials => cli::materials::run(),
        Command::Validate(validate) => validate.run(),
        Command::Fabrics(fabrics) => fabrics.run(),
        Command::Completions(completions) => completions.run(Arguments::command()),
        Command::Man(manual) => manual.run(Arguments::command()),
    }
    .map(|()| ExitCode::SUCCESS)
}
