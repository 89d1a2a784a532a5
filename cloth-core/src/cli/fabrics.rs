use anyhow::Result;
use clap::Args;
use clap::builder::PossibleValuesParser;
use cloth_core::physics::fabric::MEASURED;

use super::print;

#[derive(Debug, Args)]
pub struct Fabrics {
    /// Names of fabrics; default: all.
    #[arg(value_parser = PossibleValuesParser::new(MEASURED.map(|fabric| fabric.name)))]
    names: Vec<String>,
}

impl Fabrics {
    pub fn run(&self) -> Result<()> {
        let is_wanted = |name: &str| self.names.is_empty() || self.names.iter().any(|wanted| wanted == name);
        let tables = MEASURED.iter().filter(|fabric| is_wanted(fabric.name)).map(|fabric| fabric.table);
        print(&tables.collect::<Vec<_>>().join("\n"))
    }
}
