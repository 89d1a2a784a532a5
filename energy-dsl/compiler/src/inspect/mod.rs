//! Ways to look at a declaration other than its generated code. The audit, the simulator's run-time materials and the
//! command line use them; compiling a declaration does not.

mod interpret;
mod interpreted;
mod listing;
mod mathml;
mod mutation;
mod tape;
mod textbook;
mod tower;

pub use interpreted::Interpreted;
pub(crate) use listing::write_code;
pub use listing::{Listing, Path};
pub use mathml::mathml;
pub use mutation::{Fault, Mutation};
pub use textbook::Textbook;
