//! Converts the syntax tree to typed programs: names, shapes, units, and the result that each kind of declaration
//! needs.

mod array;
mod conditional;
mod constant;
mod domain;
mod equality;
mod expression;
mod names;
mod next;
mod remedy;
mod result;
mod signature;
mod typed;
mod units;
mod vanishing;

pub use typed::{Binding, Input, Program, Source, Typed, TypedKind};
pub use units::unit_exponents;

use crate::budget::{Budget, Phase};
use crate::diagnostic::{Diagnostic, Diagnostics};
use energy_runtime::Kind;

use crate::syntax::{Declaration, Item, UserFunction};
use constant::Globals;
use expression::Checker;
use names::{check_names, mentioned};
use signature::Signature;

/// Checks all declarations. A broken one yields its errors and a stub with the same inputs and value zero, so that code
/// which uses it causes no further errors.
pub fn check(items: &[Item], budget: &Budget, diagnostics: &mut Diagnostics) -> Vec<Program> {
    budget.enter(Phase::Checking);
    let unused = check_names(items, diagnostics);
    let functions: Vec<&UserFunction> =
        items.iter().filter_map(|i| if let Item::Function(f) = i { Some(f) } else { None }).collect();
    let constants = items.iter().filter_map(|i| if let Item::Constant(c) = i { Some(c) } else { None });
    let globals = Globals::of(constants, budget, diagnostics);
    let mut programs: Vec<Program> = Vec::new();
    for item in items {
        let Item::Declaration(declaration) = item else { continue };
        // A second declaration of the same name would be a second type.
        if programs.iter().any(|program| program.name == declaration.name.text) {
            continue;
        }
        let mut program = check_declaration(declaration, &functions, &globals, budget, diagnostics);
        program.source = with_what_it_uses(&program.source, item, items);
        programs.push(program);
    }
    if diagnostics.0.is_empty() {
        unused.into_iter().for_each(|unused| diagnostics.push(unused));
    }
    programs
}

/// Prepends the functions and constants that a declaration uses, so that its text is self-contained.
fn with_what_it_uses(source: &str, declaration: &Item, items: &[Item]) -> String {
    let others: Vec<(&Item, String, &str)> = items
        .iter()
        .filter_map(|item| match item {
            Item::Function(function) => Some((item, function.name.text.clone(), function.source.as_str())),
            Item::Constant(constant) => Some((item, constant.name.canonical(), constant.source.as_str())),
            Item::Declaration(_) | Item::Specialisation(_) => None,
        })
        .collect();
    let mut used = vec![false; others.len()];
    let mut open = vec![declaration];
    while let Some(item) = open.pop() {
        let mentioned = mentioned(item);
        for (number, (other, name, _)) in others.iter().enumerate() {
            if mentioned.contains(name) && !std::mem::replace(&mut used[number], true) {
                open.push(other);
            }
        }
    }
    let used = others.iter().zip(used).filter(|(_, used)| *used).map(|((_, _, source), _)| *source);
    used.chain([source]).collect::<Vec<_>>().join(" ")
}

fn check_declaration(
    declaration: &Declaration,
    functions: &[&UserFunction],
    globals: &Globals,
    budget: &Budget,
    diagnostics: &mut Diagnostics,
) -> Program {
    let budget = &budget.of_declaration(declaration.limits);
    let signature = Signature::of(declaration, globals, diagnostics);
    domain::check(declaration, &signature, diagnostics);
    let has_vertices = matches!(declaration.kind, Kind::Energy | Kind::Constraint);
    if declaration.vertices && !has_vertices {
        let message = format!("a {} has no routines of single vertices", declaration.kind.keyword());
        diagnostics.push(
            Diagnostic::new(&declaration.name.span, message)
                .help("#[vertex] is for energies and constraints; remove it"),
        );
    }
    let mut own = Diagnostics::default();
    let checked = declaration.body.as_ref().and_then(|body| {
        let mut checker = Checker::new(&signature, globals, functions, budget, &mut own);
        checker.declaration = &declaration.name.text;
        checker.initial = declaration
            .inputs
            .iter()
            .filter_map(|group| Some((group.names.as_slice(), group.initial.as_ref()?)))
            .collect();
        let result = checker.body(body, true).and_then(|result| checker.check_depth(result))?;
        checker.report_unused(&declaration.name);
        let Checker { bindings, reads_velocities, next, at_rest, .. } = checker;
        Some((bindings, reads_velocities, result, (next, at_rest)))
    });
    let checked = checked.and_then(|(bindings, has_velocities, result, memory)| {
        let body = declaration.body.as_ref()?;
        let result = result::expected(declaration, &signature, result, &body.result.span, &mut own)?;
        next::check_presence(declaration, &signature, body, &mut own);
        own.0.is_empty().then_some((bindings, has_velocities, result, memory))
    });
    let failed = checked.is_none();
    diagnostics.append(own);
    let (bindings, has_velocities, result, (next, at_rest)) = checked.unwrap_or_else(|| {
        let span = &declaration.name.span;
        let size = signature.parameters[signature.parameters.len() - signature.states..]
            .iter()
            .map(|input| input.input_type.size())
            .sum::<usize>();
        let next = (size > 0).then(|| result::zeros(size, span));
        (Vec::new(), false, result::stub(declaration.kind, &signature, span), (next, None))
    });
    let program = Program {
        name: declaration.name.text.clone(),
        span: declaration.name.span.clone(),
        docs: declaration.docs.clone(),
        visibility: declaration.visibility.clone(),
        audit_samples: declaration.audit_samples,
        audit_scope: declaration.audit_scope.clone(),
        properties: declaration.properties.clone(),
        uncompensated: declaration.uncompensated,
        vertices: declaration.vertices && has_vertices,
        kind: declaration.kind,
        source: declaration.source.clone(),
        formula: declaration.formula.clone(),
        moving: signature.moving,
        rest: signature.rest,
        parameters: signature.parameters,
        states: signature.states,
        next,
        at_rest,
        has_velocities,
        bindings,
        result,
        limits: declaration.limits,
        budget: budget.clone(),
    };
    let mut own = Diagnostics::default();
    if !failed {
        units::check(&program, &mut own);
    }
    let failed = failed || !own.0.is_empty();
    diagnostics.append(own);
    if failed { program.without_audit() } else { program }
}
