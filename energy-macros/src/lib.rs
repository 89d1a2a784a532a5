//! The macros of `energy-dsl`. They hand their tokens to the crate `energy-compiler`; `energy-dsl` re-exports and
//! documents them.
#![forbid(unsafe_code)]

mod include;

use proc_macro::TokenStream;

/// Declares energies, constraints, forces and residuals. See `energy_dsl::energy`.
#[proc_macro]
pub fn energy(declarations: TokenStream) -> TokenStream {
    energy_compiler::compile(declarations.into()).into()
}

/// Declares the contents of a file. See `energy_dsl::include_energy`.
#[proc_macro]
pub fn include_energy(path: TokenStream) -> TokenStream {
    include::expand(path.into()).into()
}
