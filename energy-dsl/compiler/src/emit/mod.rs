//! Renders plans as Rust.

mod declaration;
mod items;
mod methods;
mod mixed;
mod repeated;
mod spelling;
mod statements;
mod traits;

use proc_macro2::{Ident, TokenStream};
use quote::format_ident;

use crate::budget::Phase;
use crate::check::Program;
use crate::plan::Plan;
use spelling::Spellings;

/// Bytes of the tokens that any declaration has.
const DECLARATION_BYTES: u64 = 600_000;

/// A declaration that is being written.
struct Emitter<'a> {
    /// Name of the generated type.
    name: Ident,
    program: &'a Program,
    plan: &'a Plan,
    spellings: Spellings,
}

/// Emits the type, its constructor, its traits, and the audit test if requested.
#[must_use]
pub fn emit(program: &Program, plan: &Plan) -> TokenStream {
    program.budget.enter(Phase::Writing);
    program.budget.spend(1000, DECLARATION_BYTES);
    let name = format_ident!("{}", program.name, span = program.span.token);
    Emitter { name, program, plan, spellings: Spellings::default() }.items()
}
