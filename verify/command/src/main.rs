//! `verify`: audits derivatives on the command line.
#![forbid(unsafe_code)]

mod cli;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// Audits the derivatives of declared elements, and measures their errors against multi-precision reference values.
#[derive(Parser)]
#[command(version)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    Audit(cli::Audit),
    Reference(cli::Reference),
    Stress(cli::Stress),
    Bench(cli::Bench),
    Fuzz(cli::Fuzz),
    Show(cli::Show),
    Eval(cli::Eval),
}

impl Command {
    /// Runs the command. Returns whether every check passed.
    fn run(self) -> anyhow::Result<bool> {
        match self {
            Self::Audit(command) => command.run(),
            Self::Reference(command) => command.run(),
            Self::Stress(command) => command.run(),
            Self::Bench(command) => command.run(),
            Self::Fuzz(command) => command.run(),
            Self::Show(command) => command.run(),
            Self::Eval(command) => command.run(),
        }
    }
}

fn main() -> ExitCode {
    // A closed pipe (`| head`) ends the program without a panic.
    sigpipe::reset();
    match Arguments::parse().command.run() {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("error: {}", energy_cli::message(&error));
            ExitCode::from(2)
        }
    }
}
