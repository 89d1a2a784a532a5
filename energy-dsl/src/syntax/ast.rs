use super::name::Name;
use crate::diagnostic::Span;
use crate::runtime::Kind;

/// A declaration or a function.
#[derive(Clone, Debug)]
pub enum Item {
    /// `energy Name(…) { … }` and its kin.
    Declaration(Declaration),
    /// `fn name(a, b) { … }`.
    Function(UserFunction),
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

/// The declared type of an input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InputType {
    /// A point of space.
    Point,
    /// The velocity of the point with the same number.
    Velocity,
    /// A number.
    Scalar,
    /// A vector of 2, 3 or 4.
    Vector(u8),
}

impl InputType {
    /// How many numbers.
    #[must_use]
    pub fn size(self) -> usize {
        match self {
            Self::Point | Self::Velocity => 3,
            Self::Scalar => 1,
            Self::Vector(n) => n.into(),
        }
    }
}

/// `a, b: Type[unit]`.
#[derive(Clone, Debug)]
pub struct InputGroup {
    /// Where it stands.
    pub section: Section,
    /// The names.
    pub names: Vec<Name>,
    /// The type.
    pub input_type: InputType,
    /// Where the type is written.
    pub type_span: Span,
    /// The unit as written, or empty.
    pub unit: String,
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
}

/// `let`s and functions, then the result.
#[derive(Clone, Debug)]
pub struct Body {
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
    /// `[f1, f2, …]`, the forces on the points.
    List(Vec<Expression>),
    /// A body in braces, or in a string.
    Body(Box<Body>),
}
