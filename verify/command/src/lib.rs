//! Measurements of the program `verify` beyond the audit of [`verify`].
//!
//! * [`reference`](mod@reference) compares the elements with recorded multi-precision values.
//! * [`stress`](mod@stress) sweeps towards every singularity.
//! * [`bench`](mod@bench) times every way to a Hessian and measures its error.
//! * [`catalogue`] has all elements by name.
//! * [`audit_page`](fn@audit_page) formats the report of an audit as a web page.
//! * [`read_inputs`] reads the inputs to audit.
#![forbid(unsafe_code)]

mod audit_page;
pub mod bench;
pub mod catalogue;
mod complex;
mod inputs;
mod listings;
pub mod reference;
pub mod stress;

pub use audit_page::audit_page;
pub use inputs::read_inputs;
pub use listings::{catalogue_source, listings};
