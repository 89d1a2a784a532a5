use anyhow::Result;
use clap::{Args, Command};
use clap_complete::Shell;

use super::print;

#[derive(Debug, Args)]
pub struct Completions {
    /// Shell to write the script for.
    shell: Shell,
}

impl Completions {
    /// Prints the script that completes the command.
    pub fn run(&self, mut command: Command) -> Result<()> {
        let mut script = Vec::new();
        clap_complete::generate(self.shell, &mut command, "cloth", &mut script);
        print(&String::from_utf8_lossy(&script))
    }
}
