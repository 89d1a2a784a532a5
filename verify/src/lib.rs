//! Audit of generated derivatives.
//!
//! Three independent routes check each block that an element returns:
//!
//! * multi-precision numbers through the declaration's *textbook* form ([`multiprecision`]),
//! * dual numbers in double precision through the same form ([`jet::Jet`]), and
//! * finite differences of the block one order below, at the step where they vary least.
//!
//! If routes disagree, the audit names the one to suspect. It also checks the laws that a declaration implies, and
//! plants faults that must be noticed ([`audit`](mod@audit)).
//!
//! ```
//! use energy_elements::HairBend;
//!
//! // In a test. A failure names element, block and entry, the result of each route, and the input.
//! verify::assert_derivatives!(HairBend, samples = 20);
//! ```
#![forbid(unsafe_code)]

pub mod audit;
pub mod blocks;
mod chart;
mod eigenvalues;
mod finite_difference;
pub mod formula;
pub mod geometry;
pub mod jet;
pub mod multiprecision;
pub mod parallel;
pub mod sample;

pub use audit::assert_derivatives;
pub use blocks::{Answer, Block, BlockName, Evaluate, NoAnswer, evaluate};
pub use sample::Sample;

/// Audits an element in a test: `assert_derivatives!(MyMaterial)`, or with `samples = 200` random inputs. See
/// [`assert_derivatives`](fn@assert_derivatives) for the message of a failure.
///
/// ```
/// use energy_dsl::energy;
///
/// energy! { energy Pull(p, q: Point; k: Scalar[N/m]) = "k/2 ‖p − q‖²"; }
///
/// verify::assert_derivatives!(Pull);
/// verify::assert_derivatives!(Pull, samples = 20);
/// ```
#[macro_export]
macro_rules! assert_derivatives {
    ($element:ty) => {
        $crate::assert_derivatives!($element, samples = 200)
    };
    ($element:ty, samples = $samples:expr $(,)?) => {
        $crate::assert_derivatives::<$element>($samples)
    };
}
