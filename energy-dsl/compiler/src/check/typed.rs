use crate::diagnostic::Span;
use crate::functions::{Function, Shape};
use crate::syntax::{InputType, Unit};
use energy_runtime::{Kind, Property};

/// A checked declaration.
#[derive(Clone, Debug)]
pub struct Program {
    /// Name of the type to generate.
    pub name: String,
    /// Where it is named.
    pub span: Span,
    /// Doc comment, line by line.
    pub docs: Vec<String>,
    /// `pub`, `pub(crate)` or nothing.
    pub visibility: String,
    /// Samples of the generated test, if wanted.
    pub audit_samples: Option<usize>,
    /// What it claims of itself, and where.
    pub properties: Vec<(Property, Span)>,
    /// Whether rounding errors are left uncorrected.
    pub uncompensated: bool,
    /// What it describes.
    pub kind: Kind,
    /// The declaration as text.
    pub source: String,
    /// The body as text.
    pub formula: String,
    /// Points or unknowns.
    pub moving: Vec<Input>,
    /// Rest shape.
    pub rest: Vec<Input>,
    /// Parameters; a constraint's end with stiffness and damping.
    pub parameters: Vec<Input>,
    /// Whether the body reads velocities.
    pub has_velocities: bool,
    /// Intermediate values and constants in order.
    pub bindings: Vec<Binding>,
    /// The value.
    pub result: Typed,
}

impl Program {
    /// The number of points, of a declaration whose moving inputs are points.
    #[must_use]
    pub fn points(&self) -> usize {
        self.moving.len()
    }

    /// The same without its test, which a broken declaration would fail once more.
    #[must_use]
    pub fn without_audit(self) -> Self {
        Self { audit_samples: None, properties: Vec::new(), ..self }
    }

    /// How many numbers move.
    #[must_use]
    pub fn moving_size(&self) -> usize {
        self.moving.iter().map(|i| i.input_type.size()).sum()
    }

    /// Rows of C or r, 1 for an energy, components of the forces.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.result.shape.size()
    }

    /// How many parameters there are, in numbers.
    #[must_use]
    pub fn parameters_size(&self) -> usize {
        self.parameters.iter().map(|i| i.input_type.size()).sum()
    }
}

/// A declared input.
#[derive(Clone, Debug)]
pub struct Input {
    /// As written.
    pub name: String,
    /// Its type.
    pub input_type: InputType,
    /// Its unit as written.
    pub unit: String,
    /// Where its unit or else its name is written.
    pub span: Span,
    /// The number of its first component in its section.
    pub first: usize,
}

/// An intermediate value.
#[derive(Clone, Debug)]
pub struct Binding {
    /// The value.
    pub value: Typed,
    /// Computed once for the element: it stands in the `rest` block.
    pub rest: bool,
    /// Of a constant: the unit its number is in.
    pub unit: Option<Unit>,
}

/// Which inputs a name stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// Positions or unknowns.
    Position,
    /// Velocities.
    Velocity,
    /// Rest shape.
    Rest,
    /// Parameters.
    Parameter,
}

/// An expression with its shape.
#[derive(Clone, Debug)]
pub struct Typed {
    /// What it is.
    pub kind: TypedKind,
    /// Its shape.
    pub shape: Shape,
    /// Where it is written; of a call, the function's name or the operator.
    pub span: Span,
}

/// The kinds of checked expression.
#[derive(Clone, Debug)]
pub enum TypedKind {
    /// A number.
    Constant(f64),
    /// π.
    Pi,
    /// An input: the number of its first component.
    Input(Source, usize),
    /// An intermediate value.
    Binding(usize),
    /// A function applied.
    Call(&'static Function, Vec<Typed>),
    /// One value where a comparison holds, another elsewhere.
    Select(Box<Typed>, Box<Typed>, Box<Typed>),
    /// An array, or rows, one after the other.
    Array(Vec<Typed>),
    /// The derivative of a scalar by a point.
    Gradient(Box<Typed>, usize),
}
