//! A small language for energies, constraints, forces and residuals of points, and its compiler.
//!
//! A declaration is a formula with typed inputs. The compiler (feature `compiler`, used by the macro `energy!` of the crate
//! `energy-macros`) turns it into Rust code for its value and its exact first and second derivatives:
//!
//! ```text
//! text ─ syntax ─► tree ─ check ─► typed program ─ lower ─► graph ─ diff ─► routines ─ emit ─► Rust
//! ```
//!
//! Without that feature the crate is the small runtime that generated code calls: number types ([`Real`]), the traits of
//! elements ([`Potential`], [`ForceLaw`], [`Constraint`], [`Residual`]) and their self-description ([`Declaration`]).
//!
#![doc = include_str!("../LANGUAGE.md")]
#![deny(unsafe_code)]

extern crate self as energy_dsl;

mod runtime;

#[cfg(feature = "compiler")]
mod check;
#[cfg(feature = "compiler")]
mod diagnostic;
#[cfg(feature = "compiler")]
mod diff;
#[cfg(feature = "compiler")]
mod emit;
#[cfg(feature = "compiler")]
mod functions;
#[cfg(feature = "compiler")]
mod graph;
#[cfg(feature = "compiler")]
mod interpret;
#[cfg(feature = "compiler")]
mod interpreted;
#[cfg(feature = "compiler")]
mod listing;
#[cfg(feature = "compiler")]
mod lower;
#[cfg(feature = "compiler")]
mod mathml;
#[cfg(feature = "compiler")]
mod mutation;
#[cfg(feature = "compiler")]
mod properties;
#[cfg(feature = "compiler")]
mod routines;
#[cfg(feature = "compiler")]
mod syntax;
#[cfg(feature = "compiler")]
mod tape;
#[cfg(feature = "compiler")]
mod textbook;
#[cfg(feature = "compiler")]
mod tower;

pub use runtime::*;

#[cfg(feature = "compiler")]
pub use check::unit_exponents;
#[cfg(feature = "compiler")]
pub use diagnostic::{Diagnostic, Diagnostics};
#[cfg(feature = "compiler")]
pub use functions::{Function, all as functions};
#[cfg(feature = "compiler")]
pub use interpreted::Interpreted;
#[cfg(feature = "compiler")]
pub use listing::{Listing, Path};
#[cfg(feature = "compiler")]
pub use mathml::mathml;
#[cfg(feature = "compiler")]
pub use mutation::{Fault, Mutation};
#[cfg(feature = "compiler")]
pub use syntax::canonical as canonical_name;
#[cfg(feature = "compiler")]
pub use textbook::Textbook;

/// Compiles declarations to Rust: the whole of what `energy!` does. Errors become `compile_error!` at their places, beside
/// stubs of what was declared. Where the environment variable `ENERGY_DUMP_DIR` names a folder, the code of each declaration is
/// also written to a file there, laid out for reading.
///
/// ```
/// let code = energy_dsl::compile("energy Spring(p, q: Point; k: Scalar) { k * norm_squared(p - q) }".parse().unwrap());
/// assert!(code.to_string().contains("struct Spring"));
/// ```
#[cfg(feature = "compiler")]
#[must_use]
pub fn compile(declarations: proc_macro2::TokenStream) -> proc_macro2::TokenStream {
    let mut diagnostics = Diagnostics::default();
    let items = syntax::parse(declarations, &mut diagnostics);
    compile_items(&items, diagnostics)
}

/// Compiles the declarations of a file, whose text this is. `file` is what messages call it, `at` the place in Rust code that
/// errors are reported at.
#[cfg(feature = "compiler")]
#[must_use]
pub fn compile_file(text: &str, file: &str, at: proc_macro2::Span) -> proc_macro2::TokenStream {
    let mut diagnostics = Diagnostics::default();
    let items = syntax::parse_file(text, file, &diagnostic::Span::of(at), &mut diagnostics);
    compile_items(&items, diagnostics)
}

#[cfg(feature = "compiler")]
fn compile_items(items: &[syntax::Item], mut diagnostics: Diagnostics) -> proc_macro2::TokenStream {
    let programs = check::check(items, &mut diagnostics);
    let folder = std::env::var_os("ENERGY_DUMP_DIR").map(std::path::PathBuf::from);
    let mut code = proc_macro2::TokenStream::new();
    for program in &programs {
        let routines = routines::differentiate(program);
        properties::prove(program, &routines, &mut diagnostics);
        let items = emit::emit(program, &routines);
        if let Some(folder) = &folder
            && let Err(error) = listing::dump(folder, &program.name, &items)
        {
            let message = format!("ENERGY_DUMP_DIR: cannot write {} to {}: {error}", program.name, folder.display());
            diagnostics.push(Diagnostic::new(&program.span, message));
        }
        code.extend(items);
    }
    let errors: proc_macro2::TokenStream =
        diagnostics.0.iter().map(|d| syn::Error::new(d.span.token, d).to_compile_error()).collect();
    quote::quote!(#code #errors)
}
