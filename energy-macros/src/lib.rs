//! `energy!`: declarations in, Rust code out. All of the compiler is in the crate `energy-dsl`; this one hands tokens over.
#![forbid(unsafe_code)]

mod include;

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

/// Declares what a file says, as `energy!` does. The path is from the root of the crate; in the file a string stands as it is,
/// without escapes. An error in it is reported with file, line and column.
///
/// ```
/// use energy_dsl::Potential;
/// use energy_macros::include_energy;
///
/// include_energy!("tests/springs.energy");
///
/// let spring: Spring = Spring::new(8.0, 1.0);
/// assert_eq!(spring.value(&[[0.0, 0.0, 0.0], [3.0, 0.0, 4.0]]).value, 64.0);
/// ```
#[proc_macro]
pub fn include_energy(path: TokenStream) -> TokenStream {
    include::expand(path.into()).into()
}
