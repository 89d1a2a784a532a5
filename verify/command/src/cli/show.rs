use anyhow::Context;
use clap::Args;
use energy_cli::print;
use energy_compiler::sources;

use super::emit::declarations;
use super::language::{Language, Numbers};

/// Prints the code generated for an element.
#[derive(Args)]
pub struct Show {
    /// An element of the catalogue, or a file of declarations (`.energy`).
    name: String,
    /// Print one routine only: `value`, `gradient`, `hessian`, ….
    #[arg(long)]
    routine: Option<String>,
    /// Print the routes to each routine's derivatives instead: their operation counts, and which was chosen.
    #[arg(long, conflicts_with = "routine")]
    plan: bool,
    /// Print the operation counts of each routine instead, and of the Hessian with each point pinned.
    #[arg(long, conflicts_with_all = ["routine", "plan"])]
    counts: bool,
    /// Print the files that `verify emit` would write for the element in this language, without those that all elements
    /// share.
    #[arg(long, value_enum, conflicts_with_all = ["routine", "plan", "counts"])]
    lang: Option<Language>,
    /// The precision of all numbers in another language.
    #[arg(long, value_enum, default_value = "f64", requires = "lang")]
    precision: Numbers,
}

impl Show {
    pub fn run(self) -> anyhow::Result<bool> {
        if let Some(language) = self.lang {
            let files = sources(&declarations(&self.name)?, language.target(), self.precision.list())?;
            for file in files.iter().filter(|file| !file.is_shared) {
                print(&file.text)?;
            }
            return Ok(true);
        }
        for listing in verify_command::listings(&self.name)? {
            match &self.routine {
                _ if self.plan => print(&listing.plans())?,
                _ if self.counts => print(&listing.counts())?,
                None => print(&listing.code())?,
                Some(routine) => {
                    let code = listing.routine(routine).with_context(|| {
                        let known = listing.routines().join(", ");
                        format!("{} has no routine `{routine}`; it has {known}", listing.name())
                    })?;
                    print(&code)?;
                }
            }
        }
        Ok(true)
    }
}
