//! The result that each kind of declaration must have.

use super::expression::constant;
use super::signature::Signature;
use super::typed::{Typed, TypedKind};
use crate::diagnostic::{Diagnostic, Diagnostics, Span};
use crate::functions::{self, Shape};
use crate::syntax::Declaration;
use energy_runtime::Kind;

/// Returns a zero result of the kind.
pub(super) fn stub(kind: Kind, signature: &Signature, span: &Span) -> Typed {
    if kind != Kind::Force {
        return constant(0.0, span);
    }
    no_forces(signature.moving.len(), span)
}

/// Returns a zero force on each point.
pub(super) fn no_forces(points: usize, span: &Span) -> Typed {
    let zero = constant(0.0, span);
    let vector = functions::find("vector").expect("compiler bug: no function `vector`");
    let shape = Shape::Vector(3);
    let null = Typed { kind: TypedKind::Call(vector, vec![zero; 3]), shape, span: span.clone() };
    rows(vec![null; points], span)
}

/// Concatenates values.
fn rows(values: Vec<Typed>, span: &Span) -> Typed {
    let count = values.iter().map(|v| v.shape.size()).sum::<usize>();
    let shape = Shape::Rows(u16::try_from(count).unwrap_or(u16::MAX));
    Typed { kind: TypedKind::Array(values), shape, span: span.clone() }
}

/// Converts the result to the form that its kind requires.
pub(super) fn expected(
    declaration: &Declaration,
    signature: &Signature,
    result: Typed,
    span: &Span,
    diagnostics: &mut Diagnostics,
) -> Option<Typed> {
    let points = signature.moving.len();
    let kind = declaration.kind;
    let found = result.shape;
    let problem = match (kind, found) {
        (Kind::Energy, Shape::Scalar) | (Kind::Constraint | Kind::Residual, Shape::Scalar | Shape::Vector(_)) => None,
        (Kind::Force, Shape::Vector(3)) if points == 1 => return Some(rows(vec![result], span)),
        (Kind::Force, Shape::Array(n)) if usize::from(n) == points => return entries(result, kind, diagnostics),
        (Kind::Constraint | Kind::Residual, Shape::Array(_)) => return entries(result, kind, diagnostics),
        (Kind::Energy, _) => {
            Some((format!("an energy must be a scalar, but this is {found}"), "take its norm or a component's square"))
        }
        (Kind::Force, _) => Some((
            format!("a force must be one 3-vector for each of the {points} points, but this is {found}"),
            "write [f1, f2, …], one vector for each point in declared order",
        )),
        _ => Some((
            format!("a {} must be a scalar or a vector, but this is {found}", kind.keyword()),
            "split it into vectors: [a, b, …] concatenates them",
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

/// Converts the entries of an array to forces or rows.
fn entries(result: Typed, kind: Kind, diagnostics: &mut Diagnostics) -> Option<Typed> {
    let TypedKind::Array(values) = result.kind else { return None };
    let wrong = values.iter().find(|v| match kind {
        Kind::Force => v.shape != Shape::Vector(3),
        _ => !matches!(v.shape, Shape::Scalar | Shape::Vector(_)),
    });
    if let Some(wrong) = wrong {
        let (what, wanted) =
            if kind == Kind::Force { ("force", "a 3-vector") } else { ("entry", "a scalar or a vector") };
        let message = format!("each {what} in the list must be {wanted}, but this is {}", wrong.shape);
        diagnostics.push(Diagnostic::new(&wrong.span, message));
        return None;
    }
    Some(rows(values, &result.span))
}
