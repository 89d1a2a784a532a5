//! Views of a declaration other than its generated code, for the audit, materials read at run time, and the command
//! line. Compiling a declaration does not need them.

mod interpreted;
mod layout;
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
