use super::name::Name;
use super::specialise::Specialisation;
use crate::diagnostic::Span;
use energy_runtime::{Kind, Property};

/// A declaration, a function or a constant.
#[derive(Clone, Debug)]
pub enum Item {
    /// `energy Name(…) { … }` and its kin.
    Declaration(Declaration),
    /// `fn name(a, b) { … }`.
    Function(UserFunction),
    /// `const name: Scalar = value;`.
    Constant(Constant),
    /// `energy Name = Other(k = 100);`, while parsing: it becomes a declaration.
    Specialisation(Box<Specialisation>),
}

/// A declared energy, constraint, force or residual.
#[derive(Clone, Debug)]
pub struct Declaration {
    /// Lines of its doc comment.
    pub docs: Vec<String>,
    /// `pub`, `pub(crate)`, or nothing.
    pub visibility: String,
    /// Samples of the generated audit test, if one was asked for by `#[audit]`.
    pub audit_samples: Option<usize>,
    /// What it claims of itself, and where.
    pub properties: Vec<(Property, Span)>,
    /// Whether `#[uncompensated]` stands above it.
    pub uncompensated: bool,
    /// What it describes.
    pub kind: Kind,
    /// Its name.
    pub name: Name,
    /// Its inputs.
    pub inputs: Vec<InputGroup>,
    /// Its formula; nothing if it could not be parsed.
    pub body: Option<Body>,
    /// The declaration as text, without documentation and visibility.
    pub source: String,
    /// The body as text.
    pub formula: String,
}

/// Where in the signature inputs stand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Section {
    /// Before the first semicolon, unless marked.
    Moving,
    /// Marked `rest`.
    Rest,
    /// After the first semicolon, unless marked.
    Parameter,
}

/// The declared type of an input, or of the entries of an array.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ElementType {
    /// A point of space.
    Point,
    /// The velocity of the point with the same number.
    Velocity,
    /// A number.
    Scalar,
    /// A vector of 2, 3 or 4.
    Vector(u8),
    /// A matrix, rows × columns.
    Matrix(u8, u8),
    /// A quaternion: w, x, y, z.
    Quat,
    /// A dual quaternion: the real part, then the dual one, each w, x, y, z.
    DualQuat,
    /// A rotation vector θ, then a translation t.
    Twist,
}

impl ElementType {
    /// How the numbers are nested in an array of the generated code, outermost first; nothing for a scalar.
    #[must_use]
    pub fn dimensions(self) -> Vec<usize> {
        match self {
            Self::Point | Self::Velocity => vec![3],
            Self::Scalar => vec![],
            Self::Vector(n) => vec![n.into()],
            Self::Matrix(rows, columns) => vec![rows.into(), columns.into()],
            Self::Quat => vec![4],
            Self::DualQuat => vec![8],
            Self::Twist => vec![6],
        }
    }

    /// How many numbers.
    #[must_use]
    pub fn size(self) -> usize {
        self.dimensions().into_iter().product()
    }
}

/// The type of an input: `Type` or `[Type; length]`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InputType {
    /// Of one, or of each entry.
    pub element: ElementType,
    /// How many, if it is an array.
    pub length: Option<usize>,
}

impl InputType {
    /// How the numbers are nested, outermost first; nothing for a scalar.
    #[must_use]
    pub fn dimensions(self) -> Vec<usize> {
        self.length.into_iter().chain(self.element.dimensions()).collect()
    }

    /// How many numbers.
    #[must_use]
    pub fn size(self) -> usize {
        self.dimensions().into_iter().product()
    }
}

/// `a, b: Type[unit]`.
#[derive(Clone, Debug)]
pub struct InputGroup {
    /// Where it stands.
    pub section: Section,
    /// The names.
    pub names: Vec<Name>,
    /// The type, or that of the entries.
    pub element: ElementType,
    /// The length of an array as written.
    pub length: Option<Expression>,
    /// Where the type is written.
    pub type_span: Span,
    /// The unit as written, or empty.
    pub unit: Unit,
}

/// A unit as written.
#[derive(Clone, Debug, Default)]
pub struct Unit {
    /// The text; empty if there is none.
    pub text: String,
    /// Where.
    pub span: Option<Span>,
}

/// `const name: Scalar[unit] = value;`.
#[derive(Clone, Debug)]
pub struct Constant {
    /// Its name.
    pub name: Name,
    /// Its unit.
    pub unit: Unit,
    /// Its value.
    pub value: Expression,
    /// The declaration as text.
    pub source: String,
}

/// A function of the user's.
#[derive(Clone, Debug)]
pub struct UserFunction {
    /// Its name.
    pub name: Name,
    /// Its parameters.
    pub parameters: Vec<Name>,
    /// What it returns.
    pub body: Body,
    /// The declaration as text.
    pub source: String,
}

/// `let`s and functions, then the result.
#[derive(Clone, Debug)]
pub struct Body {
    /// Constants, visible in the whole body.
    pub constants: Vec<Constant>,
    /// Functions, visible in the whole body.
    pub functions: Vec<UserFunction>,
    /// In order.
    pub lets: Vec<Let>,
    /// The value.
    pub result: Box<Expression>,
}

/// `let name = value;`, in a `rest` block or not.
#[derive(Clone, Debug)]
pub struct Let {
    /// The name.
    pub name: Name,
    /// The value.
    pub value: Expression,
    /// Whether it stands in the `rest` block.
    pub rest: bool,
}

impl Body {
    /// A body that is its result alone.
    #[must_use]
    pub fn of(result: Expression) -> Self {
        Self { constants: Vec::new(), functions: Vec::new(), lets: Vec::new(), result: Box::new(result) }
    }
}

/// An expression.
#[derive(Clone, Debug)]
pub struct Expression {
    /// What it is.
    pub kind: ExpressionKind,
    /// Where.
    pub span: Span,
}

/// The kinds of expression. Operators are calls.
#[derive(Clone, Debug)]
pub enum ExpressionKind {
    /// A literal.
    Number(f64),
    /// A name.
    Name(Name),
    /// A function or operator applied.
    Call(Name, Vec<Expression>),
    /// `if condition { } else { }`.
    If(Box<Expression>, Box<Body>, Box<Body>),
    /// `[a, b, …]`, an array.
    List(Vec<Expression>),
    /// `a[i]`.
    Index(Box<Expression>, Box<Expression>),
    /// `v.x`.
    Component(Box<Expression>, Name),
    /// `sum(j in first..end, term)`.
    Sum(Box<Sum>),
    /// A body in braces, or in a string.
    Body(Box<Body>),
}

/// `sum(index in first..end, term)`.
#[derive(Clone, Debug)]
pub struct Sum {
    /// What counts.
    pub index: Name,
    /// From.
    pub first: Expression,
    /// Up to, exclusive.
    pub end: Expression,
    /// What is summed.
    pub term: Expression,
}
