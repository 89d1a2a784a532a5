//! Syntax tree to typed program: names, shapes, and what each kind of declaration must yield.

mod expression;
mod signature;
mod typed;

pub use typed::{Input, Program, Source, Typed, TypedKind};

use crate::diagnostic::{Diagnostic, Diagnostics, Span};
use crate::functions::Shape;
use crate::runtime::Kind;
use crate::syntax::{Declaration, Item, UserFunction};
use expression::Checker;
use signature::Signature;

/// Checks all declarations. A broken one yields its errors and a stub with the same inputs whose value is zero, so that
/// code which uses it raises no further errors.
pub fn check(items: &[Item], diagnostics: &mut Diagnostics) -> Vec<Program> {
    let functions: Vec<&UserFunction> =
        items.iter().filter_map(|i| if let Item::Function(f) = i { Some(f) } else { None }).collect();
    items
        .iter()
        .filter_map(|item| if let Item::Declaration(d) = item { Some(d) } else { None })
        .map(|declaration| check_declaration(declaration, &functions, diagnostics))
        .collect()
}

fn check_declaration(declaration: &Declaration, functions: &[&UserFunction], diagnostics: &mut Diagnostics) -> Program {
    let signature = Signature::of(declaration, diagnostics);
    let mut own = Diagnostics::default();
    let checked = declaration.body.as_ref().and_then(|body| {
        let mut checker = Checker::new(&signature, functions, &mut own);
        let result = checker.body(body, true)?;
        checker.report_unused(&declaration.name);
        let bindings = checker.bindings;
        let has_velocities = checker.reads_velocities;
        Some((bindings, has_velocities, result))
    });
    let checked = checked.and_then(|(bindings, has_velocities, result)| {
        let body = declaration.body.as_ref()?;
        let result = expected_result(declaration, &signature, result, &body.result.span, &mut own)?;
        own.0.is_empty().then_some((bindings, has_velocities, result))
    });
    let failed = checked.is_none();
    diagnostics.0.extend(own.0);
    let (bindings, has_velocities, result) =
        checked.unwrap_or_else(|| (Vec::new(), false, stub(declaration.kind, &signature)));
    Program {
        name: declaration.name.text.clone(),
        span: declaration.name.span.clone(),
        docs: declaration.docs.clone(),
        visibility: declaration.visibility.clone(),
        audit_samples: declaration.audit_samples.filter(|_| !failed),
        kind: declaration.kind,
        source: declaration.source.clone(),
        formula: declaration.formula.clone(),
        moving: signature.moving,
        rest: signature.rest,
        parameters: signature.parameters,
        has_velocities,
        bindings,
        result,
    }
}

/// The zero of what the kind must yield.
fn stub(kind: Kind, signature: &Signature) -> Typed {
    let zero = Typed { kind: TypedKind::Constant(0.0), shape: Shape::Scalar };
    if kind != Kind::Force {
        return zero;
    }
    let vector = crate::functions::find("vector").expect("compiler bug: no function `vector`");
    let null = Typed { kind: TypedKind::Call(vector, vec![zero; 3]), shape: Shape::Vector(3) };
    let points = signature.moving.len();
    Typed { kind: TypedKind::Forces(vec![null; points]), shape: Shape::Forces(points as u8) }
}

/// The result as the kind of declaration wants it.
fn expected_result(
    declaration: &Declaration,
    signature: &Signature,
    result: Typed,
    span: &Span,
    diagnostics: &mut Diagnostics,
) -> Option<Typed> {
    let points = signature.moving.len();
    let problem = match (declaration.kind, result.shape) {
        (Kind::Energy, Shape::Scalar) | (Kind::Constraint | Kind::Residual, Shape::Scalar | Shape::Vector(_)) => None,
        (Kind::Force, Shape::Forces(n)) if usize::from(n) == points => None,
        (Kind::Force, Shape::Vector(3)) if points == 1 => {
            return Some(Typed { shape: Shape::Forces(1), kind: TypedKind::Forces(vec![result]) });
        }
        (Kind::Energy, found) => {
            Some((format!("an energy must be a scalar, but this is {found}"), "take its norm or a component's square"))
        }
        (Kind::Force, found) => Some((
            format!("a force must be one 3-vector for each of the {points} points, but this is {found}"),
            "write [f1, f2, …], one vector for each point in declared order",
        )),
        (kind, found) => Some((
            format!("a {} must be a scalar or a vector, but this is {found}", kind.keyword()),
            "split it into vectors",
        )),
    };
    match problem {
        None => Some(result),
        Some((message, help)) => {
            diagnostics.push(Diagnostic::new(span, message).help(help));
            None
        }
    }
}
