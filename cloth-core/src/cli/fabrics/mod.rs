mod plot;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, anyhow};
use clap::Args;
use clap::builder::PossibleValuesParser;
use cloth_core::physics::fabric::{LIBRARY, LibraryFabric, in_library};
use cloth_core::scene::arcsim;

use super::print;

#[derive(Debug, Args)]
pub struct Fabrics {
    /// Fabrics whose tables to print, or to plot; default: list the names of all, or plot all.
    #[arg(value_parser = PossibleValuesParser::new(LIBRARY.iter().map(|fabric| fabric.name)))]
    names: Vec<String>,
    /// Plot tension over strain, shear force over shear, and moment over curvature of each fabric, as SVG.
    #[arg(long)]
    plot: bool,
    /// With --plot: output folder.
    #[arg(short, long, requires = "plot", default_value = "out/fabrics")]
    output: PathBuf,
    /// Print a fabric file of the program ARCSim (JSON) as a table for scene files. The files that come with ARCSim
    /// are licensed for education and research without profit.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["names", "plot"])]
    from_arcsim: Option<PathBuf>,
}

impl Fabrics {
    pub fn run(&self) -> Result<()> {
        if let Some(path) = &self.from_arcsim {
            return print(&arcsim_table(path)?);
        }
        let named = self.names.iter().map(|name| in_library(name));
        let mut chosen: Vec<&LibraryFabric> = named.collect::<Result<_, _>>()?;
        if self.plot {
            if chosen.is_empty() {
                chosen = LIBRARY.iter().collect();
            }
            return self.write_plots(&chosen);
        }
        if chosen.is_empty() { print(&list()) } else { print(&tables(&chosen)) }
    }

    fn write_plots(&self, chosen: &[&LibraryFabric]) -> Result<()> {
        energy_files::create_folder(&self.output)
            .with_context(|| format!("cannot create {}", self.output.display()))?;
        let mut names = String::new();
        for fabric in chosen {
            for (quantity, svg) in plot::plots(fabric)? {
                let path = self.output.join(format!("{}-{quantity}.svg", fabric.name));
                energy_cli::write_whole(&path, svg.as_bytes())
                    .with_context(|| format!("cannot write {}", path.display()))?;
                writeln!(names, "{}", path.display())?;
            }
        }
        print(&names)
    }
}

/// Returns the name and the title of each fabric, one per line.
fn list() -> String {
    let width = LIBRARY.iter().map(|fabric| fabric.name.len()).max().unwrap_or(0);
    LIBRARY.iter().map(|fabric| format!("{:width$}  {}\n", fabric.name, fabric.title())).collect()
}

fn tables(chosen: &[&LibraryFabric]) -> String {
    chosen.iter().map(|fabric| fabric.table).collect::<Vec<_>>().join("\n")
}

fn arcsim_table(path: &Path) -> Result<String> {
    let cannot = || format!("cannot read {}", path.display());
    let text = energy_files::read_text(path, arcsim::LARGEST_FILE).with_context(cannot)?;
    let name = path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
    let fabric = arcsim::Fabric::parse(&text).map_err(|error| anyhow!(error)).with_context(cannot)?;
    Ok(fabric.table(&name))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_fabric_has_a_line_and_a_table() {
        let list = list();
        assert_eq!(list.lines().count(), LIBRARY.len());
        for fabric in LIBRARY {
            let line = list.lines().find(|line| line.starts_with(&format!("{} ", fabric.name))).unwrap();
            assert!(line.ends_with(fabric.title()) && !fabric.title().is_empty(), "{line}");
        }
        let both = tables(&[&LIBRARY[0], &LIBRARY[1]]);
        assert_eq!(both.matches("[fabric]\n").count(), 2);
    }
}
