use super::name::Name;
use super::specialise::Specialisation;
use crate::budget::Limits;
use crate::diagnostic::Span;
use energy_runtime::{FieldKind, Kind, Property};

/// A declaration, a function or a constant.
#[derive(Clone, Debug)]
pub enum Item {
    /// An energy, constraint, force or residual.
    Declaration(Declaration),
    /// `fn name(a, b) { … }`.
    Function(UserFunction),
    /// `const name: Scalar = value;`.
    Constant(Constant),
    /// `energy Name = Other(k = 100);`. Exists only while parsing; it becomes a declaration.
    Specialisation(Box<Specialisation>),
}

/// The domain and the tolerance of `#[audit(domain(…), tolerance = …)]`.
#[derive(Clone, Debug, Default)]
pub struct AuditScope {
    /// Ranges to draw inputs from.
    pub ranges: Vec<AuditRange>,
    /// Largest relative error of finite differences and dual numbers; `None` for the audit's own.
    pub tolerance: Option<f64>,
}

/// A range of an audit's domain.
#[derive(Clone, Debug)]
pub struct AuditRange {
    /// An input, `scale` or `strain`.
    pub name: Name,
    /// Lower end.
    pub low: f64,
    /// Upper end, above the lower.
    pub high: f64,
}

impl AuditScope {
    /// Returns the range of a name, if it has one.
    #[must_use]
    pub fn range(&self, name: &str) -> Option<(f64, f64)> {
        self.ranges.iter().find(|range| range.name.text == name).map(|range| (range.low, range.high))
    }

    /// Returns the attribute that states this scope, followed by a space; empty if nothing is stated.
    #[must_use]
    pub fn attribute(&self) -> String {
        let ranges: Vec<String> = self
            .ranges
            .iter()
            .map(|AuditRange { name, low, high }| format!("{} = {low:?}..{high:?}", name.text))
            .collect();
        let domain = (!ranges.is_empty()).then(|| format!("domain({})", ranges.join(", ")));
        let tolerance = self.tolerance.map(|tolerance| format!("tolerance = {tolerance:?}"));
        let parts: Vec<String> = domain.into_iter().chain(tolerance).collect();
        if parts.is_empty() { String::new() } else { format!("#[audit({})] ", parts.join(", ")) }
    }
}

/// A declared energy, constraint, force or residual.
#[derive(Clone, Debug)]
pub struct Declaration {
    /// Lines of the doc comment.
    pub docs: Vec<String>,
    /// `pub`, `pub(crate)`, or empty.
    pub visibility: String,
    /// Samples of the generated audit test; `None` without `#[audit]`.
    pub audit_samples: Option<usize>,
    /// Domain and tolerance of audits.
    pub audit_scope: AuditScope,
    /// Claimed properties, and where they are claimed.
    pub properties: Vec<(Property, Span)>,
    /// Whether the declaration has the attribute `#[uncompensated]`.
    pub uncompensated: bool,
    /// Whether the declaration has the attribute `#[vertex]`.
    pub vertices: bool,
    /// The parameter that `#[time_step(…)]` names; `None` without it.
    pub time_step: Option<Box<Name>>,
    /// Limits of `#[limits(…)]`; `None` without it.
    pub limits: Option<Limits>,
    /// Kind of the declaration.
    pub kind: Kind,
    /// Name of the generated type.
    pub name: Name,
    /// Groups of inputs in declared order.
    pub inputs: Vec<InputGroup>,
    /// Formula; `None` if it could not be parsed.
    pub body: Option<Body>,
    /// Text of the declaration, without documentation and visibility.
    pub source: String,
    /// Text of the body.
    pub formula: String,
}

/// The section of the signature that an input is declared in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Section {
    /// Before the first semicolon, without the word `rest`.
    Moving,
    /// Marked with the word `rest`.
    Rest,
    /// After the first semicolon, without the word `rest`.
    Parameter,
    /// Marked with the word `state`.
    State,
}

/// Type of an input, or of the entries of an array.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ElementType {
    /// A point in space.
    Point,
    /// A point in a plane.
    Point2,
    /// The velocity of the point with the same number.
    Velocity,
    /// A single number, without components.
    Scalar,
    /// A vector of 2, 3 or 4 numbers.
    Vector(u8),
    /// A matrix, rows × columns.
    Matrix(u8, u8),
    /// A quaternion: w, x, y, z.
    Quat,
    /// A rotation, a unit quaternion: w, x, y, z.
    Rotation,
    /// A position in space, then a rotation: x, y, z, then w, x, y, z.
    Motion,
    /// A dual quaternion: real part, then dual part, each w, x, y, z.
    DualQuat,
    /// A rotation vector θ, then a translation t.
    Twist,
}

impl ElementType {
    /// Dimensions of the array that the generated code uses, outermost first; empty for a scalar.
    #[must_use]
    pub fn dimensions(self) -> Vec<usize> {
        match self {
            Self::Point | Self::Velocity => vec![3],
            Self::Point2 => vec![2],
            Self::Scalar => vec![],
            Self::Vector(n) => vec![n.into()],
            Self::Matrix(rows, columns) => vec![rows.into(), columns.into()],
            Self::Quat | Self::Rotation => vec![4],
            Self::Motion => vec![7],
            Self::DualQuat => vec![8],
            Self::Twist => vec![6],
        }
    }

    /// Returns the count of numbers.
    #[must_use]
    pub fn size(self) -> usize {
        self.dimensions().into_iter().product()
    }

    /// Returns how an input of this type moves.
    #[must_use]
    pub const fn field_kind(self) -> FieldKind {
        match self {
            Self::Point | Self::Point2 => FieldKind::Point,
            Self::Rotation => FieldKind::Rotation,
            Self::Motion => FieldKind::Motion,
            _ => FieldKind::Numbers,
        }
    }

    /// Returns whether an unknown of this type is a rotation.
    #[must_use]
    pub fn is_rotation(self) -> bool {
        self.field_kind() == FieldKind::Rotation
    }

    /// Returns the number of coordinates in which an unknown of this type moves.
    #[must_use]
    pub fn increments(self) -> usize {
        if self == Self::Rotation { 3 } else { self.size() }
    }
}

/// Type of an input: `Type` or `[Type; length]`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InputType {
    /// Type of the input, or of the entries of the array.
    pub element: ElementType,
    /// Length of the array; `None` if the input is not an array.
    pub length: Option<usize>,
}

impl InputType {
    /// Dimensions of the generated array, outermost first; empty for a scalar.
    #[must_use]
    pub fn dimensions(self) -> Vec<usize> {
        self.length.into_iter().chain(self.element.dimensions()).collect()
    }

    /// Returns the count of numbers.
    #[must_use]
    pub fn size(self) -> usize {
        self.dimensions().into_iter().product()
    }
}

/// Inputs that share a type: `a, b: Type[unit]`.
#[derive(Clone, Debug)]
pub struct InputGroup {
    /// Section of the signature.
    pub section: Section,
    /// Whether all elements share these unknowns.
    pub shared: bool,
    /// Names of the inputs.
    pub names: Vec<Name>,
    /// Type of the inputs, or of the entries of arrays.
    pub element: ElementType,
    /// Length of the arrays, as written.
    pub length: Option<Expression>,
    /// Value at rest of a state; `None` if it is given with each element.
    pub initial: Option<Expression>,
    /// Place of the type.
    pub type_span: Span,
    /// Unit as written; empty without one.
    pub unit: Unit,
}

/// A unit, as written.
#[derive(Clone, Debug, Default)]
pub struct Unit {
    /// Text of the unit; empty without one.
    pub text: String,
    /// Place of the unit.
    pub span: Option<Span>,
}

/// `const name: Scalar[unit] = value;`.
#[derive(Clone, Debug)]
pub struct Constant {
    /// Name of the constant.
    pub name: Name,
    /// Unit of the constant.
    pub unit: Unit,
    /// Value of the constant.
    pub value: Expression,
    /// Text of the declaration.
    pub source: String,
}

/// A function defined in the text.
#[derive(Clone, Debug)]
pub struct UserFunction {
    /// Name of the function.
    pub name: Name,
    /// Names of its parameters.
    pub parameters: Vec<Name>,
    /// Expression that it returns.
    pub body: Body,
    /// Text of the function.
    pub source: String,
}

/// Statements and a result.
#[derive(Clone, Debug)]
pub struct Body {
    /// Constants, visible in the whole body.
    pub constants: Vec<Constant>,
    /// Functions, visible in the whole body.
    pub functions: Vec<UserFunction>,
    /// `let` bindings in order.
    pub lets: Vec<Let>,
    /// The block `next { … }`.
    pub next: Option<Next>,
    /// Result of the body.
    pub result: Box<Expression>,
}

/// `let name = value;`, in a `rest` block or not.
#[derive(Clone, Debug)]
pub struct Let {
    /// Name that is bound.
    pub name: Name,
    /// Value that is bound.
    pub value: Expression,
    /// Whether the binding is in the `rest` block.
    pub rest: bool,
}

/// `next { … }`: the state after an accepted step.
#[derive(Clone, Debug)]
pub struct Next {
    /// Values that only the block knows.
    pub lets: Vec<Let>,
    /// New values of the states.
    pub assignments: Vec<Assignment>,
    /// Place of the word `next`.
    pub span: Span,
}

/// `a = value;`, `a[i] = value;` or one of the latter in `for j in first..end { … }`.
#[derive(Clone, Debug)]
pub struct Assignment {
    /// Name of the state.
    pub name: Name,
    /// Index of the entry; `None` for the whole state.
    pub entry: Option<Expression>,
    /// The index of the loop, and its range.
    pub range: Option<(Name, Expression, Expression)>,
    /// New value.
    pub value: Expression,
}

impl Body {
    /// Creates a body without statements.
    #[must_use]
    pub fn of(result: Expression) -> Self {
        Self { constants: Vec::new(), functions: Vec::new(), lets: Vec::new(), next: None, result: Box::new(result) }
    }
}

/// An expression with its place.
#[derive(Clone, Debug)]
pub struct Expression {
    /// Kind of the expression.
    pub kind: ExpressionKind,
    /// Place of the expression.
    pub span: Span,
}

/// The kinds of expression. Operators are calls.
#[derive(Clone, Debug)]
pub enum ExpressionKind {
    /// A literal number.
    Number(f64),
    /// A named value.
    Name(Name),
    /// A function or operator with its arguments.
    Call(Name, Vec<Expression>),
    /// `if condition { … } else { … }`.
    If(Box<Expression>, Box<Body>, Box<Body>),
    /// `[a, b, …]`, an array.
    List(Vec<Expression>),
    /// `a[i]`.
    Index(Box<Expression>, Box<Expression>),
    /// `v.x`.
    Component(Box<Expression>, Name),
    /// `sum(j in first..end, term)`.
    Sum(Box<Sum>),
    /// `[term for j in first..end]`, the array of the terms.
    Each(Box<Sum>),
    /// A body in braces or in a string.
    Body(Box<Body>),
}

/// `sum(index in first..end, term)`, or `[term for index in first..end]`.
#[derive(Clone, Debug)]
pub struct Sum {
    /// Index variable.
    pub index: Name,
    /// First index.
    pub first: Expression,
    /// End of the range, exclusive.
    pub end: Expression,
    /// Term of the sum.
    pub term: Expression,
}
