//! Views of a declaration other than its generated code, for the audit, materials read at run time, and the command
//! line. Compiling a declaration does not need them.

mod equivalence;
mod layout;
mod listing;
mod mathml;
mod mutation;
mod parts;
mod textbook;
mod tower;

pub(crate) use equivalence::is_proved_equal;
pub(crate) use listing::write_code;
pub use listing::{Listing, Path};
pub use mathml::mathml;
pub(crate) use mutation::faults;
pub use mutation::{Fault, Mutation};
pub use parts::{Part, Parts};
pub use textbook::Textbook;
pub(crate) use textbook::{file_programs, programs};
