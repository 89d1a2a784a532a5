use super::constant::Globals;
use super::expression::Checker;
use super::typed::{Input, Source};
use crate::diagnostic::{Diagnostic, Diagnostics};
use crate::functions::Shape;
use crate::syntax::{Declaration, ElementType, InputGroup, InputType, Name, Section, Unit};
use energy_runtime::Kind;

/// The numbered inputs of a declaration, and their names.
pub(super) struct Signature {
    pub(super) moving: Vec<Input>,
    pub(super) rest: Vec<Input>,
    pub(super) parameters: Vec<Input>,
    pub(super) names: Vec<InputName>,
}

/// A name that denotes an input.
#[derive(Clone)]
pub(super) struct InputName {
    pub(super) name: Name,
    pub(super) canonical: String,
    pub(super) source: Source,
    pub(super) first: usize,
    /// Shape of the input, or of the entries of the array.
    pub(super) shape: Shape,
    /// Length of the array; `None` if the input is not an array.
    pub(super) length: Option<usize>,
}

impl Signature {
    /// Creates a signature without inputs.
    pub(super) fn empty() -> Self {
        Self { moving: Vec::new(), rest: Vec::new(), parameters: Vec::new(), names: Vec::new() }
    }

    pub(super) fn of(declaration: &Declaration, globals: &Globals, diagnostics: &mut Diagnostics) -> Self {
        let mut signature = Self::empty();
        let mut velocities = 0;
        for group in &declaration.inputs {
            let points_move = declaration.kind != Kind::Residual;
            if group.section == Section::Moving
                && points_move
                && !matches!(group.element, ElementType::Point | ElementType::Velocity)
            {
                diagnostics.push(
                    Diagnostic::new(
                        &group.type_span,
                        format!(
                            "expected Point: the inputs of this {} before the first `;` are \
                            points",
                            declaration.kind.keyword()
                        ),
                    )
                    .help("put parameters after the first `;`, as in (p0, p1: Point; k: Scalar)"),
                );
            }
            if group.element == ElementType::Velocity && declaration.kind != Kind::Force {
                diagnostics.push(Diagnostic::new(
                    &group.type_span,
                    format!("this {} cannot depend on velocities; declare a force", declaration.kind.keyword()),
                ));
            }
            let input_type = input_type(group, &declaration.name.text, globals, diagnostics);
            // Each has at least one number, so that this error is certain.
            for name in group.names.iter().take(MOST_NUMBERS + 1 - signature.names.len().min(MOST_NUMBERS)) {
                signature.add(name, group.section, input_type, &group.unit, &mut velocities, diagnostics);
            }
        }
        let numbers = |list: &[Input]| list.iter().map(|i| i.input_type.size()).sum::<usize>();
        if [&signature.moving, &signature.rest, &signature.parameters]
            .into_iter()
            .any(|list| numbers(list) > MOST_NUMBERS)
        {
            let message = format!("the inputs of {} have more than {MOST_NUMBERS} numbers", declaration.name.text);
            diagnostics.push(Diagnostic::new(&declaration.name.span, message).help("shorten the arrays"));
        } else if declaration.kind != Kind::Residual && numbers(&signature.moving) > MOST_COORDINATES {
            let name = &declaration.name.text;
            let message = format!(
                "{name} moves {} coordinates, and its derivatives may have {MOST_COORDINATES} rows",
                numbers(&signature.moving)
            );
            let help = "declare a term of few points, and add up its elements over the mesh";
            diagnostics.push(Diagnostic::new(&declaration.name.span, message).help(help));
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
                let scalar = InputType { element: ElementType::Scalar, length: None };
                signature.add(&name, Section::Parameter, scalar, &Unit::default(), &mut velocities, diagnostics);
                // The formula cannot use it, so it is not nameable.
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
        unit: &Unit,
        velocities: &mut usize,
        diagnostics: &mut Diagnostics,
    ) {
        let canonical = name.canonical();
        let clash = self.names.iter().find(|n| n.canonical == canonical);
        if let Some(other) = clash {
            let message = if other.name.text == name.text {
                format!("the name `{}` is declared twice", name.text)
            } else {
                format!("the names `{}` and `{}` are spellings of the same symbol", other.name.text, name.text)
            };
            diagnostics.push(Diagnostic::new(&name.span, message).help("rename one of them"));
        }
        let is_velocity = input_type.element == ElementType::Velocity;
        let stored = section != Section::Moving && !is_velocity;
        if let Some(reason) = reserved(&name.text).filter(|_| stored) {
            diagnostics.push(
                Diagnostic::new(&name.span, format!("`{}` cannot name an input: {reason}", name.text))
                    .help("rename it"),
            );
        }
        let (shape, length) = (shape(input_type.element), input_type.length);
        let (source, first) = if is_velocity {
            *velocities += length.unwrap_or(1);
            (Source::Velocity, 3 * (*velocities - length.unwrap_or(1)))
        } else {
            let (source, list) = match section {
                Section::Moving => (Source::Position, &mut self.moving),
                Section::Rest => (Source::Rest, &mut self.rest),
                Section::Parameter => (Source::Parameter, &mut self.parameters),
            };
            let first = list.last().map_or(0, |i: &Input| i.first + i.input_type.size());
            let span = unit.span.as_ref().unwrap_or(&name.span).clone();
            // The stub of a broken declaration must be valid Rust.
            let suffix = if stored && reserved(&name.text).is_some() { "_" } else { "" };
            let input =
                Input { name: format!("{}{suffix}", name.text), input_type, unit: unit.text.clone(), span, first };
            match length.filter(|_| section == Section::Moving) {
                // Moving inputs are listed entry by entry.
                Some(length) => list.extend((0..length).map(|i| entry(&input, i))),
                None => list.push(input),
            }
            (source, first)
        };
        self.names.push(InputName { name: name.clone(), canonical, source, first, shape, length });
    }
}

/// Maximum count of numbers in an input; more are data.
const MOST_NUMBERS: usize = 4096;

/// Maximum count of coordinates of an energy, a constraint or a force, whose second derivatives have their square.
const MOST_COORDINATES: usize = 255;

/// Returns the type of a group of inputs. An array with an invalid length gets length one.
fn input_type(group: &InputGroup, declaration: &str, globals: &Globals, diagnostics: &mut Diagnostics) -> InputType {
    let length = group.length.as_ref().map(|length| {
        let signature = Signature::empty();
        let mut checker = Checker::new(&signature, globals, &[], &globals.budget, diagnostics);
        checker.declaration = declaration;
        checker.array_length(&group.names[0], length).unwrap_or(1)
    });
    InputType { element: group.element, length }
}

/// Returns entry `number` of an array as a separate input.
fn entry(array: &Input, number: usize) -> Input {
    let input_type = InputType { element: array.input_type.element, length: None };
    let first = array.first + number * input_type.size();
    Input { name: format!("{}[{number}]", array.name), input_type, first, ..array.clone() }
}

fn shape(element: ElementType) -> Shape {
    match element {
        ElementType::Point | ElementType::Velocity => Shape::Vector(3),
        ElementType::Scalar => Shape::Scalar,
        ElementType::Vector(n) => Shape::Vector(n),
        ElementType::Matrix(rows, columns) => Shape::Matrix(rows, columns),
        ElementType::Quat => Shape::Quat,
        ElementType::DualQuat => Shape::DualQuat,
        ElementType::Twist => Shape::Twist,
    }
}

/// Returns why a name would clash in the generated constructor; `None` if it would not.
fn reserved(name: &str) -> Option<&'static str> {
    let is_temporary = name.strip_prefix('t').is_some_and(|n| !n.is_empty() && n.bytes().all(|b| b.is_ascii_digit()));
    if syn::parse_str::<syn::Ident>(name).is_err() {
        return Some("it is a word of Rust");
    }
    (is_temporary || matches!(name, "precomputed" | "sound" | "number")).then_some("generated code uses it")
}
