use std::num::NonZero;
use std::path::PathBuf;

use clap::Args;
use energy_cli::print;
use verify_command::reference::policy;
use verify_command::stress::{markdown, plots, stress};

use super::output::{create_folder, records, write_json, write_text};
use super::policy as documented;
use super::targets::targets;

/// Sweeps inputs towards every singularity, down to 1e-300, and compares the generated code with the textbook form;
/// then tries every degenerate input with a documented result. Exit status 1 on a NaN, an error beyond 8 u·κ without a
/// flag, or an undocumented result.
#[derive(Args)]
pub struct Stress {
    /// Elements of the catalogue or of the file [default: all].
    names: Vec<String>,
    /// Sweep the declarations of this file (`.energy`) instead of the catalogue's, without degenerate inputs.
    #[arg(long)]
    file: Option<PathBuf>,
    /// Threads; results do not depend on their number [default: all processors].
    #[arg(long)]
    threads: Option<NonZero<usize>>,
    /// Also write `stress.md`, `stress.json` and a plot of each sweep to this folder.
    #[arg(short, long)]
    output: Option<PathBuf>,
}

impl Stress {
    pub fn run(self) -> anyhow::Result<bool> {
        let targets = targets(&self.names, self.file.as_deref())?;
        let tracks = stress(&targets, self.threads).map_err(anyhow::Error::msg)?;
        let table = markdown(&tracks);
        print(&table)?;
        if let Some(folder) = self.output {
            create_folder(&folder)?;
            write_text(Some(&folder.join("stress.md")), || table)?;
            write_json(Some(&folder.join("stress.json")), &tracks)?;
            for (file, svg) in plots(&tracks) {
                write_text(Some(&folder.join(file)), || svg)?;
            }
        }
        let degenerate = if self.file.is_some() { Vec::new() } else { policy(&records().join("policy.json"))? };
        documented::show(&degenerate)?;
        let failed = tracks.iter().filter(|track| !track.passed()).count();
        print(&format!("\n{} blocks along sweeps, {failed} failed\n", tracks.len()))?;
        Ok(failed == 0 && documented::passed(&degenerate))
    }
}
