//! Write an energy, a constraint, a force or a residual once, as a formula. Get Rust code for its value and its exact
//! first and second derivatives.
//!
//! [`energy!`] compiles the formula while your crate compiles. The generated type implements the trait of its kind:
//! [`Potential`], [`Constraint`], [`ForceLaw`] or [`Residual`]. Many elements at once run over SIMD lanes: see
//! [`Packed`].
//!
#![doc = include_str!("../LANGUAGE.md")]
#![forbid(unsafe_code)]

pub use energy_runtime::*;

/// Declares energies, constraints, forces and residuals in the [language](crate) of this crate.
///
/// ```
/// use energy_dsl::{Potential, energy};
///
/// energy! {
///     /// A spring of rest length L.
///     pub energy Spring(p, q: Point; k: Scalar[N/m], L: Scalar[m]) = "k/2 (‖p − q‖ − L)²";
/// }
///
/// let spring: Spring = Spring::new(8.0, 1.0);
/// let at = spring.gradient(&[[0.0, 0.0, 0.0], [3.0, 0.0, 4.0]]);
/// assert_eq!(at.value, 64.0);
/// assert!((at.gradient[1][2] - 8.0 * 4.0 * 0.8).abs() < 1e-14);
/// ```
pub use energy_macros::energy;

/// Declares the contents of a file, as [`energy!`] does.
///
/// The path is relative to the root of the crate. Strings in the file are raw: a backslash is written once. Errors name
/// file, line and column.
///
/// ```
/// use energy_dsl::{Potential, include_energy};
///
/// include_energy!("tests/springs.energy");
///
/// let spring: Spring = Spring::new(8.0, 1.0);
/// assert_eq!(spring.value(&[[0.0, 0.0, 0.0], [3.0, 0.0, 4.0]]).value, 64.0);
/// ```
pub use energy_macros::include_energy;

/// Everything that code around declared elements usually needs: the macros, the traits, and what results and inputs are
/// made of.
///
/// ```
/// use energy_dsl::prelude::*;
///
/// energy! { energy Pull(p, q: Point; k: Scalar) = "k/2 ‖p − q‖²"; }
///
/// assert_eq!(Pull::new(2.0).value(&[[0.0; 3], [3.0, 0.0, 4.0]]).value, 25.0);
/// ```
pub mod prelude {
    pub use crate::{
        Constraint, Element, Flags, ForceLaw, Inputs, Potential, ReducedPotential, Residual, Vector3, energy,
        include_energy,
    };
}
