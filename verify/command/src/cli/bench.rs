use std::path::PathBuf;

use clap::Args;
use energy_cli::print;
use verify_command::bench::{bench, bench_interpreted, csv, markdown, plots};

use super::output::{create_folder, write_text};
use super::targets::targets;

/// Times every method of computing a Hessian on one element of each family, and measures its error against
/// multi-precision.
#[derive(Args)]
pub struct Bench {
    /// Elements to time [default: all that can be timed].
    names: Vec<String>,
    /// Time the declarations of this file (`.energy`). They run as tapes, not as compiled code.
    #[arg(long, value_name = "FILE")]
    file: Option<PathBuf>,
    /// Also write `bench.md`, `bench.csv` and a plot of each element to this folder.
    #[arg(short, long)]
    output: Option<PathBuf>,
}

impl Bench {
    pub fn run(self) -> anyhow::Result<bool> {
        let list = match self.file {
            None => bench(&self.names),
            Some(file) => bench_interpreted(&targets(&self.names, Some(&file))?),
        };
        let list = list.map_err(anyhow::Error::msg)?;
        let table = markdown(&list);
        print(&table)?;
        if let Some(folder) = self.output {
            create_folder(&folder)?;
            write_text(Some(&folder.join("bench.md")), || table)?;
            write_text(Some(&folder.join("bench.csv")), || csv(&list))?;
            for (file, svg) in plots(&list) {
                write_text(Some(&folder.join(file)), || svg)?;
            }
        }
        Ok(true)
    }
}
