use super::typed::{Input, Source};
use crate::diagnostic::{Diagnostic, Diagnostics};
use crate::functions::Shape;
use crate::runtime::Kind;
use crate::syntax::{Declaration, InputType, Name, Section};

/// The inputs of a declaration, numbered, and the names they go by.
pub(super) struct Signature {
    pub(super) moving: Vec<Input>,
    pub(super) rest: Vec<Input>,
    pub(super) parameters: Vec<Input>,
    pub(super) names: Vec<InputName>,
}

/// A name that stands for an input.
#[derive(Clone)]
pub(super) struct InputName {
    pub(super) name: Name,
    pub(super) source: Source,
    pub(super) first: usize,
    pub(super) shape: Shape,
}

impl Signature {
    pub(super) fn of(declaration: &Declaration, diagnostics: &mut Diagnostics) -> Self {
        let mut signature = Self { moving: Vec::new(), rest: Vec::new(), parameters: Vec::new(), names: Vec::new() };
        let mut velocities = 0;
        for group in &declaration.inputs {
            let points_move = declaration.kind != Kind::Residual;
            if group.section == Section::Moving
                && points_move
                && !matches!(group.input_type, InputType::Point | InputType::Velocity)
            {
                diagnostics.push(
                    Diagnostic::new(
                        &group.type_span,
                        format!("expected Point: what an {} moves are points", declaration.kind.keyword()),
                    )
                    .help("parameters stand after the first `;`, as in (p0, p1: Point; k: Scalar)"),
                );
            }
            if group.input_type == InputType::Velocity && declaration.kind != Kind::Force {
                diagnostics.push(Diagnostic::new(
                    &group.type_span,
                    format!("a {} does not depend on velocities; declare a force", declaration.kind.keyword()),
                ));
            }
            for name in &group.names {
                signature.add(name, group.section, group.input_type, &group.unit, &mut velocities, diagnostics);
            }
        }
        if signature.moving.is_empty() {
            diagnostics.push(
                Diagnostic::new(
                    &declaration.name.span,
                    format!("expected at least one point in {}", declaration.name.text),
                )
                .help("name them first, as in (p0, p1: Point; k: Scalar)"),
            );
        }
        if velocities > signature.moving.len() {
            diagnostics.push(Diagnostic::new(
                &declaration.name.span,
                format!("{velocities} velocities for {} points: expected at most one each", signature.moving.len()),
            ));
        }
        if declaration.kind == Kind::Constraint {
            let span = declaration.name.span.clone();
            for implied in ["stiffness", "damping"] {
                let name = Name { text: implied.into(), span: span.clone() };
                signature.add(&name, Section::Parameter, InputType::Scalar, "", &mut velocities, diagnostics);
                // The formula has no use for it: it cannot be named there.
                signature.names.pop();
            }
        }
        signature
    }

    fn add(
        &mut self,
        name: &Name,
        section: Section,
        input_type: InputType,
        unit: &str,
        velocities: &mut usize,
        diagnostics: &mut Diagnostics,
    ) {
        let canonical = name.canonical();
        let clash = self.names.iter().find(|n| n.name.canonical() == canonical);
        if let Some(other) = clash {
            let message = if other.name.text == name.text {
                format!("the name `{}` is declared twice", name.text)
            } else {
                format!("the names `{}` and `{}` are spellings of the same symbol", other.name.text, name.text)
            };
            diagnostics.push(Diagnostic::new(&name.span, message).help("rename one of them"));
        }
        let stored = section != Section::Moving && input_type != InputType::Velocity;
        if stored && is_reserved(&name.text) {
            diagnostics.push(
                Diagnostic::new(&name.span, format!("`{}` cannot name an input: generated code uses it", name.text))
                    .help("rename it"),
            );
        }
        let shape = match input_type {
            InputType::Point | InputType::Velocity => Shape::Vector(3),
            InputType::Scalar => Shape::Scalar,
            InputType::Vector(n) => Shape::Vector(n),
        };
        let (source, first) = if input_type == InputType::Velocity {
            *velocities += 1;
            (Source::Velocity, 3 * (*velocities - 1))
        } else {
            let (source, list) = match section {
                Section::Moving => (Source::Position, &mut self.moving),
                Section::Rest => (Source::Rest, &mut self.rest),
                Section::Parameter => (Source::Parameter, &mut self.parameters),
            };
            let first = list.last().map_or(0, |i: &Input| i.first + i.input_type.size());
            list.push(Input { name: name.text.clone(), input_type, unit: unit.into(), first });
            (source, first)
        };
        self.names.push(InputName { name: name.clone(), source, first, shape });
    }
}

/// Names that would clash in the generated constructor, where inputs stand beside temporaries, and Rust's own words.
fn is_reserved(name: &str) -> bool {
    let temporary = name.strip_prefix('t').is_some_and(|n| !n.is_empty() && n.bytes().all(|b| b.is_ascii_digit()));
    temporary || matches!(name, "precomputed" | "sound" | "number") || syn::parse_str::<syn::Ident>(name).is_err()
}
