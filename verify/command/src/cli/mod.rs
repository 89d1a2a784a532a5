//! The subcommands, one file each, and their shared code.

mod audit;
mod bench;
mod emit;
mod eval;
mod language;
mod output;
mod policy;
mod reference;
mod show;
mod stress;
mod targets;

pub use audit::Audit;
pub use bench::Bench;
pub use emit::Emit;
pub use eval::Eval;
pub use reference::Reference;
pub use show::Show;
pub use stress::Stress;
