use std::ops::Range;

use super::constant::Globals;
use super::expression::Checker;
use super::typed::{Input, Source};
use crate::diagnostic::{Diagnostic, Diagnostics};
use crate::functions::Shape;
use crate::syntax::{Declaration, ElementType, InputGroup, InputType, Name, Section};
use energy_runtime::Kind;

/// The numbered inputs of a declaration, and their names.
pub(super) struct Signature {
    pub(super) moving: Vec<Input>,
    pub(super) rest: Vec<Input>,
    /// Parameters, and then the state.
    pub(super) parameters: Vec<Input>,
    /// Number of inputs at the end of the parameters that are the state.
    pub(super) states: usize,
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
    /// Numbers among the unknowns, or among the velocities, which belong to the unknowns in order.
    pub(super) numbers: Range<usize>,
    /// Whether it is part of the state.
    pub(super) is_state: bool,
}

/// An unknown that has a velocity.
struct Owner {
    name: String,
    /// Number of its first increment.
    increment: usize,
    /// Shape of its velocity.
    shape: Shape,
}

impl Signature {
    /// Creates a signature without inputs.
    pub(super) fn empty() -> Self {
        Self { moving: Vec::new(), rest: Vec::new(), parameters: Vec::new(), states: 0, names: Vec::new() }
    }

    /// Returns whether the unknown that begins with this number is a rotation.
    pub(super) fn is_rotation(&self, first: usize) -> bool {
        self.moving.iter().any(|input| input.first == first && input.input_type.element.is_rotation())
    }

    /// Returns whether the parameter that begins with this number is part of the state.
    pub(super) fn is_state(&self, first: usize) -> bool {
        let own = self.parameters.len() - self.states;
        self.parameters.get(own).is_some_and(|state| first >= state.first)
    }

    pub(super) fn of(declaration: &Declaration, globals: &Globals, diagnostics: &mut Diagnostics) -> Self {
        let mut signature = Self::empty();
        let groups = |state: bool| declaration.inputs.iter().filter(move |g| (g.section == Section::State) == state);
        for group in groups(false) {
            check_group(declaration, group, diagnostics);
            signature.add_group(declaration, group, globals, diagnostics);
        }
        if declaration.kind == Kind::Constraint {
            signature.add_implied(declaration);
        }
        let own = signature.parameters.len();
        for group in groups(true) {
            check_group(declaration, group, diagnostics);
            signature.add_group(declaration, group, globals, diagnostics);
        }
        signature.states = signature.parameters.len() - own;
        signature.assign_velocities(diagnostics);
        signature.mark_time_step(declaration, diagnostics);
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
        signature
    }

    /// Returns the type of a group of inputs. An array with an invalid length gets length one. Lengths may be those of
    /// other arrays.
    fn input_type(
        &self,
        group: &InputGroup,
        declaration: &str,
        globals: &Globals,
        diagnostics: &mut Diagnostics,
    ) -> InputType {
        let length = group.length.as_ref().map(|length| {
            let signature = Self { names: self.names.clone(), ..Self::empty() };
            let mut checker = Checker::new(&signature, globals, &[], &globals.budget, diagnostics);
            checker.declaration = declaration;
            checker.array_length(&group.names[0], length).unwrap_or(1)
        });
        InputType { element: group.element, length }
    }

    fn add_group(
        &mut self,
        declaration: &Declaration,
        group: &InputGroup,
        globals: &Globals,
        diagnostics: &mut Diagnostics,
    ) {
        let input_type = self.input_type(group, &declaration.name.text, globals, diagnostics);
        // Each has at least one number, so that this error is certain.
        for name in group.names.iter().take(MOST_NUMBERS + 1 - self.names.len().min(MOST_NUMBERS)) {
            self.add(name, group, input_type, diagnostics);
        }
    }

    /// Gives each velocity to the unknown with its number, and as many components as its increment has. Velocities are
    /// numbered by increments.
    fn assign_velocities(&mut self, diagnostics: &mut Diagnostics) {
        let (owners, velocities) = (self.owners_of_velocities(), self.count(Source::Velocity));
        for name in self.names.iter_mut().filter(|name| name.source == Source::Velocity) {
            let Range { start, end } = name.numbers;
            let given = &owners[owners.len().min(start)..owners.len().min(end)];
            if given.len() < end - start {
                let message =
                    format!("{velocities} velocities for {} unknowns: expected at most one each", owners.len());
                diagnostics.push(Diagnostic::new(&name.name.span, message));
                return;
            }
            let Some(first) = given.first() else { continue };
            if let Some(other) = given.iter().find(|other| other.shape != first.shape) {
                let (of, other) = (&first.name, &other.name);
                let message = format!("`{}` would have velocities of `{of}` and of `{other}`", name.name.text);
                let help =
                    "velocities belong to the unknowns in declared order; an array of them to unknowns of one size";
                diagnostics.push(Diagnostic::new(&name.name.span, message).help(help));
                return;
            }
            (name.first, name.shape) = (first.increment, first.shape);
        }
    }

    /// Returns the number of inputs of a kind, entry by entry.
    fn count(&self, source: Source) -> usize {
        self.names.iter().rfind(|name| name.source == source).map_or(0, |name| name.numbers.end)
    }

    /// Lists the unknowns that velocities belong to, in declared order.
    fn owners_of_velocities(&self) -> Vec<Owner> {
        let (mut moving, mut increment) = (self.moving.iter(), 0);
        let declared = self.names.iter().filter(|name| name.source == Source::Position);
        let entries = declared.flat_map(|name| vec![name; name.length.unwrap_or(1)]);
        let owner = |declared: &InputName| {
            let unknown = moving.next()?;
            let first = increment;
            let shape = if declared.shape == Shape::Motion {
                // Its position, then its rotation.
                moving.next();
                increment += 6;
                Shape::Twist
            } else {
                let increments = unknown.input_type.element.increments();
                increment += increments;
                if increments == 1 { Shape::Scalar } else { Shape::Vector(u8::try_from(increments).ok()?) }
            };
            Some(Owner { name: unknown.name.clone(), increment: first, shape })
        };
        entries.map_while(owner).collect()
    }

    /// Marks the parameter that `#[time_step(…)]` names.
    fn mark_time_step(&mut self, declaration: &Declaration, diagnostics: &mut Diagnostics) {
        let Some(name) = &declaration.time_step else { return };
        let own = self.parameters.len() - self.states;
        let canonical = name.canonical();
        let is_scalar = |input: &Input| input.input_type == InputType { element: ElementType::Scalar, length: None };
        let found = self.names.iter().find(|input| input.canonical == canonical && input.source == Source::Parameter);
        let parameter =
            found.and_then(|found| self.parameters[..own].iter_mut().find(|input| input.first == found.first));
        match parameter.filter(|input| is_scalar(input)) {
            Some(_) if self.states == 0 => {
                let message = format!("{} has a time step and no state", declaration.name.text);
                let help = "what depends on a step remembers its start: declare a state, or remove #[time_step]";
                diagnostics.push(Diagnostic::new(&name.span, message).help(help));
            }
            Some(parameter) => parameter.is_time_step = true,
            None => {
                let message = format!("`{}` is not a scalar parameter of {}", name.text, declaration.name.text);
                let help = format!("declare it after a `;`, as in {}: Scalar[s]", name.text);
                diagnostics.push(Diagnostic::new(&name.span, message).help(help));
            }
        }
    }

    /// Returns whether the parameter that begins with this number is the time step.
    pub(super) fn is_time_step(&self, first: usize) -> bool {
        self.parameters.iter().any(|input| input.first == first && input.is_time_step)
    }

    /// Adds the stiffness and the damping of a constraint. The formula cannot use them, so they have no names there.
    fn add_implied(&mut self, declaration: &Declaration) {
        for implied in ["stiffness", "damping"] {
            let first = self.parameters.last().map_or(0, |i: &Input| i.first + i.input_type.size());
            self.parameters.push(Input {
                name: implied.into(),
                input_type: InputType { element: ElementType::Scalar, length: None },
                unit: String::new(),
                span: declaration.name.span.clone(),
                first,
                shared: false,
                is_time_step: false,
            });
        }
    }

    fn add(&mut self, name: &Name, group: &InputGroup, input_type: InputType, diagnostics: &mut Diagnostics) {
        let InputGroup { section, shared, unit, .. } = group;
        let section = *section;
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
        let (shape, length) = (shape_of(input_type.element), input_type.length);
        let (source, first) = if is_velocity {
            (Source::Velocity, 0)
        } else {
            let (source, list) = match section {
                Section::Moving => (Source::Position, &mut self.moving),
                Section::Rest => (Source::Rest, &mut self.rest),
                Section::Parameter | Section::State => (Source::Parameter, &mut self.parameters),
            };
            let first = list.last().map_or(0, |i: &Input| i.first + i.input_type.size());
            let span = unit.span.as_ref().unwrap_or(&name.span).clone();
            // The stub of a broken declaration must be valid Rust.
            let suffix = if stored && reserved(&name.text).is_some() { "_" } else { "" };
            let (name, unit, shared) = (format!("{}{suffix}", name.text), unit.text.clone(), *shared);
            let input = Input { name, input_type, unit, span, first, shared, is_time_step: false };
            if section == Section::Moving {
                // Moving inputs are listed entry by entry, and motions part by part.
                let entries: Vec<Input> = match length {
                    Some(length) => (0..length).map(|i| entry(&input, i)).collect(),
                    None => vec![input],
                };
                list.extend(entries.into_iter().flat_map(unknowns));
            } else {
                list.push(input);
            }
            (source, first)
        };
        let is_state = section == Section::State;
        let number = self.count(source);
        let numbers = number..number + length.unwrap_or(1);
        self.names.push(InputName { name: name.clone(), canonical, source, first, shape, length, numbers, is_state });
    }
}

/// Checks the types of a group of inputs.
fn check_group(declaration: &Declaration, group: &InputGroup, diagnostics: &mut Diagnostics) {
    let kind = declaration.kind.keyword();
    let mut report = |message: String, help: &str| {
        diagnostics.push(Diagnostic::new(&group.type_span, message).help(help.to_owned()));
    };
    let is_unknown = group.section == Section::Moving && group.element != ElementType::Velocity;
    if group.shared && !is_unknown {
        report("only unknowns can be `shared`".into(), "put it before the first `;`, or leave out `shared`");
    }
    if group.element == ElementType::Velocity && declaration.kind != Kind::Force {
        diagnostics.push(Diagnostic::new(
            &group.type_span,
            format!("this {kind} cannot depend on velocities; declare a force"),
        ));
    }
}

/// Maximum count of numbers in an input; more are data.
const MOST_NUMBERS: usize = 4096;

/// Maximum count of coordinates of an energy, a constraint or a force, whose second derivatives have their square.
const MOST_COORDINATES: usize = 255;

/// Returns entry `number` of an array as a separate input.
fn entry(array: &Input, number: usize) -> Input {
    let input_type = InputType { element: array.input_type.element, length: None };
    let first = array.first + number * input_type.size();
    Input { name: format!("{}[{number}]", array.name), input_type, first, ..array.clone() }
}

/// Returns the unknowns that an input consists of: a motion is a point and a rotation.
fn unknowns(input: Input) -> Vec<Input> {
    if input.input_type.element != ElementType::Motion {
        return vec![input];
    }
    let part = |element: ElementType, ending: &str, offset: usize| Input {
        name: format!("{}.{ending}", input.name),
        input_type: InputType { element, length: None },
        first: input.first + offset,
        unit: String::new(),
        ..input.clone()
    };
    vec![part(ElementType::Point, "position", 0), part(ElementType::Rotation, "rotation", 3)]
}

/// Returns the shape of an input, or of the entries of an array.
pub(super) fn shape_of(element: ElementType) -> Shape {
    match element {
        ElementType::Point | ElementType::Velocity => Shape::Vector(3),
        ElementType::Point2 => Shape::Vector(2),
        ElementType::Scalar => Shape::Scalar,
        ElementType::Vector(n) => Shape::Vector(n),
        ElementType::Matrix(rows, columns) => Shape::Matrix(rows, columns),
        ElementType::Quat | ElementType::Rotation => Shape::Quat,
        ElementType::Motion => Shape::Motion,
        ElementType::DualQuat => Shape::DualQuat,
        ElementType::Twist => Shape::Twist,
    }
}

/// Returns why a name would clash in the generated constructor; `None` if it would not.
fn reserved(name: &str) -> Option<&'static str> {
    let digits = |n: &str| !n.is_empty() && n.bytes().all(|b| b.is_ascii_digit());
    let is_temporary = name.rsplit_once("__").is_some_and(|(_, number)| digits(number));
    if syn::parse_str::<syn::Ident>(name).is_err() {
        return Some("it is a word of Rust");
    }
    (is_temporary || matches!(name, "precomputed" | "sound" | "number")).then_some("generated code uses it")
}
