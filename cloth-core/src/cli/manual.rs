use std::path::PathBuf;

use anyhow::{Context, Result};
use clap::{Args, Command};
use clap_mangen::Man;

use super::print;

#[derive(Debug, Args)]
pub struct Manual {
    /// Writes a page for each subcommand, too, to this folder; default: prints the page of the program.
    #[arg(short, long)]
    output: Option<PathBuf>,
}

impl Manual {
    pub fn run(&self, mut command: Command) -> Result<()> {
        // Subcommands get their full names, such as `cloth-run`.
        command.build();
        let Some(folder) = &self.output else {
            return print(&String::from_utf8_lossy(&page(&command)?));
        };
        std::fs::create_dir_all(folder).with_context(|| format!("cannot create {}", folder.display()))?;
        for command in command.get_subcommands().chain([&command]) {
            let path = folder.join(format!("{}.1", name(command)));
            let page = page(command)?;
            energy_cli::write_whole(&path, &page).with_context(|| format!("cannot write {}", path.display()))?;
        }
        Ok(())
    }
}

fn name(command: &Command) -> &str {
    command.get_display_name().unwrap_or_else(|| command.get_name())
}

fn page(command: &Command) -> Result<Vec<u8>> {
    let mut page = Vec::new();
    Man::new(command.clone()).title(name(command)).render(&mut page)?;
    Ok(page)
}
