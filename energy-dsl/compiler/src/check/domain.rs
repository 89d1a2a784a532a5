//! The domain that `#[audit(domain(…))]` states: each range belongs to an input, to the size of the points, or to their
//! deformation.

use super::signature::Signature;
use super::typed::{Input, Source};
use crate::diagnostic::{Diagnostic, Diagnostics};
use crate::syntax::{AuditRange, Declaration, ElementType};
use energy_runtime::Kind;

/// Reports ranges of names that are not drawn at random, and of sizes that are not positive.
pub(super) fn check(declaration: &Declaration, signature: &Signature, diagnostics: &mut Diagnostics) {
    for range in &declaration.audit_scope.ranges {
        if let Err(error) = check_range(range, declaration.kind, signature) {
            diagnostics.push(*error);
        }
    }
}

fn check_range(range: &AuditRange, kind: Kind, signature: &Signature) -> Result<(), Box<Diagnostic>> {
    let name = &range.name;
    let fail = |message: String, help: &str| Err(Box::new(Diagnostic::new(&name.span, message).help(help.to_owned())));
    let is_point = |input: &Input| input.input_type.element == ElementType::Point;
    let has_points = kind != Kind::Residual && signature.moving.iter().all(is_point);
    if let Some(input) = signature.names.iter().find(|input| input.name.text == name.text) {
        return match input.source {
            Source::Position | Source::Velocity if has_points => {
                fail(format!("`{}` has no range", name.text), "state the size of all points: scale = 0.1..1")
            }
            Source::Rest if rest_points(signature).is_some() => {
                fail(format!("`{}` has no range", name.text), "state the size of the rest shape: scale = 0.1..1")
            }
            _ => Ok(()),
        };
    }
    match name.text.as_str() {
        "scale" | "strain" if !has_points => fail(
            format!("only an element whose unknowns are points has a {}", name.text),
            "state the range of an unknown or a parameter by its name",
        ),
        "strain" if rest_points(signature) != Some(signature.moving.len()) => fail(
            "strain needs a rest shape with one point for each point".into(),
            "declare the rest shape as in `rest u0, u1, u2: Vec2`, or state a scale",
        ),
        "scale" | "strain" if range.low <= 0.0 => fail(
            format!("a {} is greater than 0", name.text),
            "state ratios of lengths, as in strain = 0.5..2.0; 1 is the rest shape",
        ),
        "scale" | "strain" => Ok(()),
        _ => fail(
            format!("`{}` is not an input", name.text),
            "a domain has ranges of parameters, of scale (size of the points) and of strain (ratio of deformed to rest \
             lengths)",
        ),
    }
}

/// Returns the number of points in the plane or in space that the rest shape consists of; `None` if it has other inputs.
fn rest_points(signature: &Signature) -> Option<usize> {
    let dimension = |input: &Input| input.input_type.element.size();
    let first = signature.rest.first().map(dimension).filter(|size| (2..=3).contains(size))?;
    let are_points = signature.rest.iter().all(|input| dimension(input) == first);
    are_points.then(|| signature.rest.iter().map(|input| input.input_type.length.unwrap_or(1)).sum())
}
