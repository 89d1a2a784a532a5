//! `verify`: audits derivatives on the command line.
#![forbid(unsafe_code)]

mod cli;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

const EXIT_STATUS: &str = "\
Exit status:
  0    every check passed
  1    a check failed
  2    an error: invalid arguments, a file that cannot be read, a text that does not compile";

/// Audits the derivatives of declared elements, and measures their errors against multi-precision reference values.
#[derive(Parser)]
#[command(version, after_help = EXIT_STATUS, after_long_help = EXIT_STATUS)]
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
    Show(cli::Show),
    Emit(cli::Emit),
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
            Self::Show(command) => command.run(),
            Self::Emit(command) => command.run(),
            Self::Eval(command) => command.run(),
        }
    }
}

fn main() -> ExitCode {
    // A closed pipe (`| head`) ends the program without a panic.
    sigpipe::reset();
    match energy_cli::report_file_limits().and_then(|()| Arguments::parse().command.run()) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            energy_cli::tell(&format!("error: {}", energy_cli::message(&error)));
            ExitCode::from(2)
        }
    }
}
