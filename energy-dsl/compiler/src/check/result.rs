//! The result that each kind of declaration must have.

use super::expression::constant;
use super::signature::{Signature, shape_of};
use super::typed::{Input, Typed, TypedKind};
use crate::diagnostic::{Diagnostic, Diagnostics, Span};
use crate::functions::Shape;
use crate::syntax::{Declaration, ElementType};
use energy_runtime::Kind;

/// Returns a zero result of the kind.
pub(super) fn stub(kind: Kind, signature: &Signature, span: &Span) -> Typed {
    if kind != Kind::Force {
        return constant(0.0, span);
    }
    no_forces(&signature.moving, span)
}

/// Returns a zero force on each unknown.
pub(super) fn no_forces(moving: &[Input], span: &Span) -> Typed {
    zeros(moving.iter().map(|input| input.input_type.element.increments()).sum(), span)
}

/// Returns rows of zeros.
pub(super) fn zeros(count: usize, span: &Span) -> Typed {
    rows(vec![constant(0.0, span); count], span)
}

/// Concatenates values.
pub(super) fn rows(values: Vec<Typed>, span: &Span) -> Typed {
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
        (Kind::Force, shape) if points == 1 && shape == force_on(&signature.moving[0]) => {
            return Some(rows(vec![result], span));
        }
        (Kind::Force, Shape::Array(n)) if usize::from(n) == points => {
            return forces(result, &signature.moving, diagnostics);
        }
        (Kind::Constraint | Kind::Residual, Shape::Array(_)) => return entries(result, diagnostics),
        (Kind::Energy, _) => {
            Some((format!("an energy must be a scalar, but this is {found}"), "take its norm or a component's square"))
        }
        (Kind::Force, _) if signature.moving.iter().all(|input| input.input_type.element == ElementType::Point) => {
            Some((
                format!("a force must be one 3-vector for each of the {points} points, but this is {found}"),
                "write [f1, f2, …], one vector for each point in declared order",
            ))
        }
        (Kind::Force, _) => Some((
            format!("a force must be one value for each of the {points} unknowns, but this is {found}"),
            "write [f1, f2, …], one for each unknown in declared order: its shape, a torque for a rotation, and both a \
             force and a torque for a motion",
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

/// Returns the shape of a force on an unknown. On a rotation it is a torque.
fn force_on(input: &Input) -> Shape {
    match input.input_type.element {
        ElementType::Rotation => Shape::Vector(3),
        element => shape_of(element),
    }
}

/// Converts the entries of an array to one force for each unknown.
fn forces(result: Typed, moving: &[Input], diagnostics: &mut Diagnostics) -> Option<Typed> {
    let TypedKind::Array(values) = result.kind else { return None };
    for (value, input) in values.iter().zip(moving) {
        let (wanted, found) = (force_on(input), value.shape);
        if wanted != found {
            let message = match wanted {
                Shape::Vector(3) => format!("each force in the list must be a 3-vector, but this is {found}"),
                _ => format!("the force on `{}` must be {wanted}, but this is {found}", input.name),
            };
            diagnostics.push(Diagnostic::new(&value.span, message));
            return None;
        }
    }
    Some(rows(values, &result.span))
}

/// Converts the entries of an array to rows.
fn entries(result: Typed, diagnostics: &mut Diagnostics) -> Option<Typed> {
    let TypedKind::Array(values) = result.kind else { return None };
    if let Some(wrong) = values.iter().find(|v| !matches!(v.shape, Shape::Scalar | Shape::Vector(_))) {
        let message = format!("each entry in the list must be a scalar or a vector, but this is {}", wrong.shape);
        diagnostics.push(Diagnostic::new(&wrong.span, message));
        return None;
    }
    Some(rows(values, &result.span))
}
