//! True values: value, gradient and Hessian of any declaration, also one read at run time, to any number of digits.
//!
//! The declaration's textbook form is evaluated once over *jets* of multi-precision numbers, which carry their first
//! and second derivatives by all coordinates. This uses neither the compiler's differentiation nor its robust
//! primitives or rewrites. The precision is raised until two consecutive results agree, so cancellation costs time but
//! no digits.
//!
//! The numbers are dashu's, in pure Rust. With the feature `rug` they are GNU MPFR's, an independent implementation.

mod big;
#[cfg(not(feature = "rug"))]
mod dashu;
#[cfg(feature = "rug")]
mod rug;
mod truth;

pub use big::Big;
pub(crate) use big::with_precision as at_precision;
#[cfg(not(feature = "rug"))]
use dashu::Float;
#[cfg(feature = "rug")]
use rug::Float;

pub use truth::worse;
pub use truth::{TrueBlock, truth, truth_beside};
pub(crate) use truth::{Truth, truth_of_extreme, truth_of_ordinary};
