//! The passes of the compiler, in order.

use std::path::PathBuf;

use proc_macro2::{Span, TokenStream};
use quote::quote;

use crate::budget::Budget;
use crate::check::{Program, check};
use crate::diagnostic::{self, Diagnostic, Diagnostics};
use crate::emit::emit;
use crate::inspect::write_code;
use crate::lower::lower;
use crate::plan::Plan;
use crate::properties::prove;
use crate::routines::differentiate;
use crate::syntax;

/// Compiles declarations to Rust. This is all that `energy!` does.
///
/// Each error becomes a `compile_error!` at its place. A broken declaration also becomes a stub of its type, so that
/// one mistake gives one error. If the environment variable `ENERGY_DUMP_DIR` names a folder, the formatted code of
/// each declaration is also written there.
///
/// ```
/// let spring = "energy Spring(p, q: Point; k: Scalar) { k * norm_squared(p - q) }";
/// let code = energy_compiler::compile(spring.parse().unwrap());
/// assert!(code.to_string().contains("struct Spring"));
/// ```
#[must_use]
pub fn compile(declarations: TokenStream) -> TokenStream {
    let mut diagnostics = Diagnostics::default();
    let items = syntax::parse(declarations, &mut diagnostics);
    compile_items(&items, diagnostics)
}

/// Compiles the declarations in the `text` of a file.
///
/// `file` is the file's name in messages; `at` is the place in Rust code where errors are reported.
#[must_use]
pub fn compile_file(text: &str, file: &str, at: Span) -> TokenStream {
    let mut diagnostics = Diagnostics::default();
    let items = syntax::parse_file(text, file, &diagnostic::Span::of(at), &mut diagnostics);
    compile_items(&items, diagnostics)
}

/// Maximum number of stubs: they cost memory as other declarations do.
const MOST_STUBS: usize = 50;

fn compile_items(items: &[syntax::Item], mut diagnostics: Diagnostics) -> TokenStream {
    let programs = check(items, &Budget::default().trusting(), &mut diagnostics);
    let (mut code, mut stubs) = (TokenStream::new(), 0);
    for program in &programs {
        let compiled = program.budget.within(|| compile_program(program, &mut diagnostics));
        match compiled {
            Ok(items) => code.extend(items),
            Err(stop) => {
                diagnostics.push(program.stopped(stop));
                stubs += 1;
                if stubs <= MOST_STUBS {
                    code.extend(compile_program(&program.stub(), &mut diagnostics));
                }
            }
        }
    }
    let errors = diagnostics.0.iter().map(|d| syn::Error::new(d.span.token, d).to_compile_error());
    quote!(#code #(#errors)*)
}

fn compile_program(program: &Program, diagnostics: &mut Diagnostics) -> TokenStream {
    let routines = differentiate(program, lower(program));
    prove(program, &routines, program.audit_samples.is_some(), diagnostics);
    let items = emit(program, &Plan::new(program, &routines));
    if let Some(folder) = std::env::var_os("ENERGY_DUMP_DIR").map(PathBuf::from)
        && let Err(error) = write_code(&folder, &program.name, &items)
    {
        let message = format!("ENERGY_DUMP_DIR: cannot write {} to {}: {error}", program.name, folder.display());
        diagnostics.push(Diagnostic::new(&program.span, message));
    }
    items
}
