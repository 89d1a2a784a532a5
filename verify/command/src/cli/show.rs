use anyhow::Context;
use clap::Args;
use energy_cli::print;

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
}

impl Show {
    pub fn run(self) -> anyhow::Result<bool> {
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
