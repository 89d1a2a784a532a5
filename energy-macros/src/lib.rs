//! `energy!`: declarations in, Rust code out. All of the compiler is in the crate `energy-dsl`; this one hands tokens over.
#![forbid(unsafe_code)]

use proc_macro::TokenStream;

/// Declares energies, constraints, forces and residuals; see the crate `energy-dsl` for the language and for the traits that
/// the generated types implement.
///
/// ```
/// use energy_dsl::Potential;
/// use energy_macros::energy;
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
#[proc_macro]
pub fn energy(declarations: TokenStream) -> TokenStream {
    energy_dsl::compile(declarations.into()).into()
}
