//! Converts the syntax tree to typed programs: names, shapes, units, and the result that each kind of declaration
//! needs.

mod array;
mod constant;
mod expression;
mod result;
mod signature;
mod typed;
mod units;

pub use typed::{Input, Program, Source, Typed, TypedKind};
pub use units::unit_exponents;

use crate::diagnostic::Diagnostics;
use crate::syntax::{Declaration, Item, UserFunction, canonical};
use constant::Globals;
use expression::Checker;
use signature::Signature;

/// Checks all declarations. A broken one yields its errors and a stub with the same inputs and value zero, so that code
/// which uses it causes no further errors.
pub fn check(items: &[Item], diagnostics: &mut Diagnostics) -> Vec<Program> {
    let functions: Vec<&UserFunction> =
        items.iter().filter_map(|i| if let Item::Function(f) = i { Some(f) } else { None }).collect();
    let constants = items.iter().filter_map(|i| if let Item::Constant(c) = i { Some(c) } else { None });
    let globals = Globals::of(constants, diagnostics);
    items
        .iter()
        .filter_map(|item| if let Item::Declaration(d) = item { Some(d) } else { None })
        .map(|declaration| {
            let mut program = check_declaration(declaration, &functions, &globals, diagnostics);
            program.source = with_what_it_uses(&program.source, items);
            program
        })
        .collect()
}

/// Prepends the functions and constants that a declaration uses, so that its text is self-contained.
fn with_what_it_uses(source: &str, items: &[Item]) -> String {
    let others: Vec<(String, &str)> = items
        .iter()
        .filter_map(|item| match item {
            Item::Function(function) => Some((function.name.canonical(), function.source.as_str())),
            Item::Constant(constant) => Some((constant.name.canonical(), constant.source.as_str())),
            Item::Declaration(_) | Item::Specialisation(_) => None,
        })
        .collect();
    let mut named = vec![false; others.len()];
    let mut texts = vec![source];
    while let Some(text) = texts.pop() {
        let text = canonical(text);
        for (number, (name, other)) in others.iter().enumerate() {
            if !named[number] && text.contains(name) {
                named[number] = true;
                texts.push(other);
            }
        }
    }
    let used = others.iter().zip(named).filter(|(_, named)| *named).map(|((_, source), _)| *source);
    used.chain([source]).collect::<Vec<_>>().join(" ")
}

fn check_declaration(
    declaration: &Declaration,
    functions: &[&UserFunction],
    globals: &Globals,
    diagnostics: &mut Diagnostics,
) -> Program {
    let signature = Signature::of(declaration, globals, diagnostics);
    let mut own = Diagnostics::default();
    let checked = declaration.body.as_ref().and_then(|body| {
        let mut checker = Checker::new(&signature, globals, functions, &mut own);
        let result = checker.body(body, true)?;
        checker.report_unused(&declaration.name);
        let bindings = checker.bindings;
        let has_velocities = checker.reads_velocities;
        Some((bindings, has_velocities, result))
    });
    let checked = checked.and_then(|(bindings, has_velocities, result)| {
        let body = declaration.body.as_ref()?;
        let result = result::expected(declaration, &signature, result, &body.result.span, &mut own)?;
        own.0.is_empty().then_some((bindings, has_velocities, result))
    });
    let failed = checked.is_none();
    diagnostics.0.extend(own.0);
    let (bindings, has_velocities, result) = checked
        .unwrap_or_else(|| (Vec::new(), false, result::stub(declaration.kind, &signature, &declaration.name.span)));
    let program = Program {
        name: declaration.name.text.clone(),
        span: declaration.name.span.clone(),
        docs: declaration.docs.clone(),
        visibility: declaration.visibility.clone(),
        audit_samples: declaration.audit_samples,
        properties: declaration.properties.clone(),
        uncompensated: declaration.uncompensated,
        kind: declaration.kind,
        source: declaration.source.clone(),
        formula: declaration.formula.clone(),
        moving: signature.moving,
        rest: signature.rest,
        parameters: signature.parameters,
        has_velocities,
        bindings,
        result,
    };
    let mut own = Diagnostics::default();
    if !failed {
        units::check(&program, &mut own);
    }
    let failed = failed || !own.0.is_empty();
    diagnostics.0.extend(own.0);
    if failed { program.without_audit() } else { program }
}
