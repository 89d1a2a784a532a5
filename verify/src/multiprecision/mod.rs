//! Truth: value, gradient and Hessian of any declaration, also one read at run time, to as many digits as are asked for.
//!
//! The declaration's textbook form is evaluated once over *jets*, numbers that carry their first and second derivatives by all
//! coordinates at once, of multi-precision numbers. Nothing of the compiler's differentiation, of its robust primitives or of its
//! rewrites takes part. The same is done at ever higher precision until two results in a row agree: cancellation, however bad,
//! costs time and no digits.
//!
//! The numbers are dashu's, which needs nothing but Rust; with the feature `rug` they are GNU MPFR's, which share no code with them.

mod big;
#[cfg(not(feature = "rug"))]
mod dashu;
mod jet;
#[cfg(feature = "rug")]
mod rug;
mod truth;

pub use big::Big;
#[cfg(not(feature = "rug"))]
use dashu::Float;
#[cfg(feature = "rug")]
use rug::Float;

pub(crate) use jet::{Jet, Order};
pub use truth::{TrueBlock, truth};
pub(crate) use truth::{truth_of_ordinary, worse};
