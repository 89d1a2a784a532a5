//! The audit of generated derivatives.
//!
//! Every block that an element returns is compared with two independent routes: hyper-dual numbers run through the
//! declaration's *textbook* form ([`dual::Hyper`], num-dual), and finite differences of the block one order below, over a sweep
//! of steps. Symmetry and the momenta that the declaration implies are checked beside. [`reference`](mod@reference) measures errors
//! against multi-precision values.
//!
//! ```
//! use energy_elements::HairBend;
//!
//! // In a test of one's own: panics and names element, block and entry if a derivative is wrong.
//! verify::assert_derivatives::<HairBend>(20);
//! ```
#![forbid(unsafe_code)]

mod atomic_file;
pub mod audit;
mod blocks;
pub mod dual;
mod eigenvalues;
mod finite_difference;
mod formula;
mod geometry;
mod listings;
pub mod multiprecision;
mod plot;
pub mod reference;
mod sample;
pub mod stress;

pub use atomic_file::write_whole;
pub use audit::assert_derivatives;
pub use blocks::{Answer, Block, BlockName, Evaluate, NoAnswer, evaluate};
pub use listings::listings;
pub use sample::Sample;
