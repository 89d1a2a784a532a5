//! Checks claims of a declaration. Translation invariance is proved on the graph; claims for the audit require an
//! audit.

use crate::check::Program;
use crate::diagnostic::{Diagnostic, Diagnostics};
use crate::graph::{Graph, Input, NodeId, Op};
use crate::routines::Routines;
use crate::syntax::ElementType;
use energy_runtime::{FieldKind, Kind, Property};

/// Reports claims that are wrong, or that nothing would check: all but translation invariance need an audit.
pub fn prove(program: &Program, routines: &Routines, audited: bool, diagnostics: &mut Diagnostics) {
    for (property, span) in &program.properties {
        let problem = match property {
            Property::TranslationInvariant => translation(program, routines),
            Property::RotationInvariant if program.kind == Kind::Residual => Some((
                "a residual's unknowns need not be points, so it has no invariance of points".into(),
                "remove the claim",
            )),
            Property::ZeroForceAtRest => rest_state(program),
            Property::RotationInvariant | Property::Even => None,
        };
        let audited = audited || *property == Property::TranslationInvariant;
        let problem = problem.or_else(|| {
            (!audited).then(|| {
                (format!("nothing checks the claim `{}`", property.attribute()), "the audit does: add #[audit]")
            })
        });
        if let Some((message, help)) = problem {
            diagnostics.push(Diagnostic::new(span, message).help(help));
        }
    }
}

fn translation(program: &Program, routines: &Routines) -> Option<(String, &'static str)> {
    if program.kind == Kind::Residual {
        let message = "a residual's unknowns need not be points, so it has no invariance of points";
        return Some((message.into(), "remove the claim"));
    }
    if routines.translation_invariant {
        return None;
    }
    let values = routines.list.first().and_then(|r| r.groups.first()).cloned().unwrap_or_default();
    let by_itself = used_by_itself(program, &routines.graph, &values);
    let name = by_itself.and_then(|point| program.moving.get(point)).map_or("a point", |input| input.name.as_str());
    let message =
        format!("translation invariance cannot be proved: `{name}` is used on its own, not in a difference of points");
    Some((message, "form the difference first, as in dot(n, p - q) for dot(n, p) - dot(n, q)"))
}

/// Returns the first point that is used outside of a difference of two points.
fn used_by_itself(program: &Program, graph: &Graph, outputs: &[NodeId]) -> Option<usize> {
    let coordinate = |node: NodeId| match graph.op(node) {
        Op::Input(Input::Position(c)) => {
            let point = program.moving.partition_point(|input| input.first <= usize::from(c)) - 1;
            let input = &program.moving[point];
            let is_point = input.input_type.element.field_kind() == FieldKind::Point;
            is_point.then(|| (point, usize::from(c) - input.first))
        }
        _ => None,
    };
    let mut seen = std::collections::BTreeSet::new();
    let mut found = None;
    let mut stack = outputs.to_vec();
    while let Some(node) = stack.pop() {
        if !seen.insert(node) {
            continue;
        }
        if let Some((point, _)) = coordinate(node) {
            found = Some(found.map_or(point, |other: usize| other.min(point)));
            continue;
        }
        match graph.op(node) {
            Op::Sub(a, b) if matches!((coordinate(a), coordinate(b)), (Some((_, i)), Some((_, j))) if i == j) => {}
            op => match graph.rule(node) {
                Some(rule) => stack.extend(&rule.arguments),
                None => stack.extend(op.operands()),
            },
        }
    }
    found
}

/// Checks that the rest shape has one place for each point.
fn rest_state(program: &Program) -> Option<(String, &'static str)> {
    let places = program.rest.iter().filter(|input| {
        let element = input.input_type.element;
        matches!(element, ElementType::Point | ElementType::Vector(2 | 3))
    });
    let count: usize = places.map(|input| input.input_type.length.unwrap_or(1)).sum();
    let all: usize = program.rest.iter().map(|input| input.input_type.length.unwrap_or(1)).sum();
    (count != program.points() || all != count || program.kind == Kind::Residual).then(|| {
        let message = "the rest shape does not say where each point rests".into();
        (message, "declare one rest Point, Vec3 or Vec2 for each point, in the same order")
    })
}
