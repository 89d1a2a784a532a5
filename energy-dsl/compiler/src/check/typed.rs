use crate::budget::{Budget, Limits, Stop};
use crate::diagnostic::{Diagnostic, Span};
use crate::functions::{Function, Shape};
use crate::syntax::{AuditScope, ElementType, InputType, Unit};
use energy_runtime::{Kind, Property};

/// A checked declaration.
#[derive(Clone, Debug)]
pub struct Program {
    /// Name of the type to generate.
    pub name: String,
    /// Place of the name.
    pub span: Span,
    /// Lines of the doc comment.
    pub docs: Vec<String>,
    /// `pub`, `pub(crate)` or empty.
    pub visibility: String,
    /// Samples of the generated audit test; `None` without `#[audit]`.
    pub audit_samples: Option<usize>,
    /// Domain and tolerance of audits.
    pub audit_scope: AuditScope,
    /// Claimed properties, and where they are claimed.
    pub properties: Vec<(Property, Span)>,
    /// Whether rounding errors are not compensated.
    pub uncompensated: bool,
    /// Whether it has routines for single vertices.
    pub vertices: bool,
    /// Kind of the declaration.
    pub kind: Kind,
    /// Text of the declaration.
    pub source: String,
    /// Text of the body.
    pub formula: String,
    /// Points, or the unknowns of a residual.
    pub moving: Vec<Input>,
    /// Inputs of the rest shape.
    pub rest: Vec<Input>,
    /// Parameters, in the order of the declaration, stiffness and damping of a constraint, and the state.
    pub parameters: Vec<Input>,
    /// Number of inputs at the end of the parameters that are the state.
    pub states: usize,
    /// New values of the state, row by row; `None` without a state.
    pub next: Option<Typed>,
    /// Values of the state at rest, row by row; `None` if they are given with each element.
    pub at_rest: Option<Typed>,
    /// Whether the body reads velocities.
    pub has_velocities: bool,
    /// Intermediate values and constants, in order.
    pub bindings: Vec<Binding>,
    /// Result of the body.
    pub result: Typed,
    /// Its own limits; `None` for those of the text.
    pub limits: Option<Limits>,
    /// Pays for compiling it.
    pub budget: Budget,
}

impl Program {
    /// Returns the error of a compilation that was stopped, at the statement that grew.
    #[must_use]
    pub(crate) fn stopped(&self, stop: Stop) -> Diagnostic {
        let what = &self.name;
        let place = |binding: usize| self.bindings.get(binding).map(|binding| binding.value.span.clone());
        if let Some(span) = self.budget.binding().and_then(place) {
            return stop.diagnostic(&self.budget, &span, what);
        }
        let diagnostic = stop.diagnostic(&self.budget, &self.span, what);
        let largest = self.budget.largest().and_then(|(binding, size)| Some((size, place(binding)?)));
        match largest {
            Some((size, span)) => diagnostic.see((format!("the largest statement has {size} operations"), span)),
            None => diagnostic,
        }
    }

    /// Returns the same declaration with the value 0, and its own budget. Code that uses a declaration which was
    /// stopped then causes no further errors.
    #[must_use]
    pub(crate) fn stub(&self) -> Self {
        let zero = |span: &Span| super::expression::constant(0.0, span);
        let result = match self.kind {
            Kind::Force => super::result::no_forces(&self.moving, &self.span),
            _ => zero(&self.span),
        };
        let next = self.next.as_ref().map(|_| super::result::zeros(self.state_size(), &self.span));
        let stub = Self {
            bindings: Vec::new(),
            result,
            next,
            at_rest: None,
            budget: Budget::new(Limits::NONE),
            ..self.clone()
        };
        stub.without_audit()
    }

    /// Returns the number of points of a declaration whose moving inputs are points.
    #[must_use]
    pub fn points(&self) -> usize {
        self.moving.len()
    }

    /// Returns whether some moving inputs are shared or are not points in space; false for a residual. See
    /// [`energy_runtime::Declaration::is_mixed`].
    #[must_use]
    pub fn is_mixed(&self) -> bool {
        let is_own_point = |input: &Input| input.input_type.element == ElementType::Point && !input.shared;
        self.kind != Kind::Residual && !self.moving.iter().all(is_own_point)
    }

    /// Returns whether the input that holds a number is a rotation or a motion which nothing differentiates by its
    /// numbers: a parameter or a part of the rest shape, but not of the state.
    #[must_use]
    pub(crate) fn is_given_rotation(&self, source: Source, number: usize) -> bool {
        let list = match source {
            Source::Position | Source::Velocity => return false,
            Source::Rest => &self.rest[..],
            Source::Parameter => &self.parameters[..self.parameters.len() - self.states],
        };
        let holds = |input: &&Input| (input.first..input.first + input.input_type.size()).contains(&number);
        let element = list.iter().find(holds).map(|input| input.input_type.element);
        matches!(element, Some(ElementType::Rotation | ElementType::Motion))
    }

    /// Returns the inputs that are the state.
    #[must_use]
    pub fn state(&self) -> &[Input] {
        &self.parameters[self.parameters.len() - self.states..]
    }

    /// Returns the count of numbers of the state.
    #[must_use]
    pub fn state_size(&self) -> usize {
        self.state().iter().map(|input| input.input_type.size()).sum()
    }

    /// Returns the count of coordinates in which the moving inputs move.
    #[must_use]
    pub fn increments(&self) -> usize {
        self.moving.iter().map(|input| input.input_type.element.increments()).sum()
    }

    /// Removes the audit test, which would report a broken declaration a second time.
    #[must_use]
    pub fn without_audit(self) -> Self {
        Self { audit_samples: None, properties: Vec::new(), ..self }
    }

    /// Returns the count of moving numbers.
    #[must_use]
    pub fn moving_size(&self) -> usize {
        self.moving.iter().map(|i| i.input_type.size()).sum()
    }

    /// Returns the number of rows: those of C or r, 1 for an energy, the force components.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.result.shape.size()
    }

    /// Returns the count of parameter numbers.
    #[must_use]
    pub fn parameters_size(&self) -> usize {
        self.parameters.iter().map(|i| i.input_type.size()).sum()
    }
}

/// A declared input.
#[derive(Clone, Debug)]
pub struct Input {
    /// Name as written.
    pub name: String,
    /// Type of the input.
    pub input_type: InputType,
    /// Unit as written.
    pub unit: String,
    /// Place of the unit, or of the name without a unit.
    pub span: Span,
    /// Index of the first component within its section.
    pub first: usize,
    /// Whether it is one unknown for all elements.
    pub shared: bool,
    /// Whether it is the parameter that integrators set to the time step.
    pub is_time_step: bool,
}

/// An intermediate value.
#[derive(Clone, Debug)]
pub struct Binding {
    /// Its name in the formula, with the index of an entry of an array; empty for values without one.
    pub name: String,
    /// Value of the binding.
    pub value: Typed,
    /// Whether the binding is in the `rest` block, and so computed once for each element.
    pub rest: bool,
    /// Unit of a constant's value.
    pub unit: Option<Unit>,
    /// The number that the value equals; `None` if it is not constant.
    pub constant: Option<f64>,
    /// Number of nested expressions, through other bindings too.
    pub depth: usize,
}

/// The section of inputs that a value is read from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// Positions or unknowns.
    Position,
    /// Velocities of points.
    Velocity,
    /// Inputs of the rest shape.
    Rest,
    /// Parameters of the declaration.
    Parameter,
}

/// An expression with its shape.
#[derive(Clone, Debug)]
pub struct Typed {
    /// Kind of the expression.
    pub kind: TypedKind,
    /// Shape of the value.
    pub shape: Shape,
    /// Place of the expression. For a call, the function's name or the operator.
    pub span: Span,
}

impl Typed {
    /// Returns the parts of the expression; empty for a binding.
    pub(crate) fn parts(&self) -> Vec<&Self> {
        match &self.kind {
            TypedKind::Call(_, list) | TypedKind::Array(list) => list.iter().collect(),
            TypedKind::Select(a, b, c) => vec![&**a, &**b, &**c],
            TypedKind::Gradient(of, ..) => vec![&**of],
            TypedKind::Constant(_) | TypedKind::Pi | TypedKind::Input(..) | TypedKind::Binding(_) => Vec::new(),
        }
    }

    /// Returns the entries of an array, or the value itself.
    pub(crate) fn into_entries(self) -> Vec<Self> {
        match self.kind {
            TypedKind::Array(entries) => entries,
            _ => vec![self],
        }
    }

    /// Returns the expression with `change` applied to each of its parts.
    pub(crate) fn map_parts(&self, mut change: impl FnMut(&Self) -> Self) -> Self {
        let kind = match &self.kind {
            TypedKind::Call(function, list) => TypedKind::Call(function, list.iter().map(change).collect()),
            TypedKind::Array(list) => TypedKind::Array(list.iter().map(change).collect()),
            TypedKind::Select(a, b, c) => {
                let [a, b, c] = [a, b, c].map(|part| Box::new(change(part)));
                TypedKind::Select(a, b, c)
            }
            TypedKind::Gradient(of, source, first) => TypedKind::Gradient(Box::new(change(of)), *source, *first),
            other => other.clone(),
        };
        Self { kind, ..self.clone() }
    }
}

/// The kinds of checked expression.
#[derive(Clone, Debug)]
pub enum TypedKind {
    /// A constant number.
    Constant(f64),
    /// The number π.
    Pi,
    /// An input, by the index of its first component.
    Input(Source, usize),
    /// An intermediate value, by index.
    Binding(usize),
    /// A function with its arguments.
    Call(&'static Function, Vec<Typed>),
    /// Condition, value where it holds, value elsewhere.
    Select(Box<Typed>, Box<Typed>, Box<Typed>),
    /// Concatenated entries of an array, or rows.
    Array(Vec<Typed>),
    /// The derivative of a scalar with respect to a point or a parameter, by the section and the index of its first
    /// component. It has the shape of that input.
    Gradient(Box<Typed>, Source, usize),
}
