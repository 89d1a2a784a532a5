/// Terms, bodies or vectors that do not fit each other, or an evaluation that is not finite.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MixedError {
    /// The numbers of stencils and elements differ.
    #[error("{term}: expected one stencil per element, got {stencils} stencils for {elements} elements")]
    CountMismatch {
        /// Name of the term.
        term: String,
        /// Number of elements.
        elements: usize,
        /// Number of stencils.
        stencils: usize,
    },
    /// A stencil has too few or too many unknowns for the element's declared ones.
    #[error(
        "{term}: element {element} has {numbers} numbers in {declared} declared unknowns, and its stencil lists {found} \
         unknowns that do not have as many"
    )]
    WrongCount {
        /// Name of the term.
        term: String,
        /// Index of the element.
        element: usize,
        /// Number of declared unknowns.
        declared: usize,
        /// Numbers of the declared unknowns. Several unknowns of the body may make up one, as three vectors a matrix.
        numbers: usize,
        /// Number of unknowns in the stencil.
        found: usize,
    },
    /// An unknown is not of the kind that the element declares.
    #[error("{term}: element {element} declares {field} as {expected}, but unknown {unknown} is a {found}")]
    WrongKind {
        /// Name of the term.
        term: String,
        /// Index of the element.
        element: usize,
        /// Name of the declared unknown.
        field: String,
        /// Description of the expected kind: "a rotation", or "3 numbers".
        expected: String,
        /// Index of the body's unknown.
        unknown: usize,
        /// Description of the unknown's kind.
        found: String,
    },
    /// A stencil names an unknown that does not exist.
    #[error("{term}: element {element} names {which} {unknown}, but there are only {count}")]
    Missing {
        /// Name of the term.
        term: String,
        /// Index of the element.
        element: usize,
        /// "unknown" or "shared unknown".
        which: &'static str,
        /// Index of the missing unknown.
        unknown: usize,
        /// Number of such unknowns of the body.
        count: usize,
    },
    /// A stencil names an unknown twice.
    #[error("{term}: element {element} names unknown {unknown} twice")]
    Repeated {
        /// Name of the term.
        term: String,
        /// Index of the element.
        element: usize,
        /// Index of the unknown.
        unknown: usize,
    },
    /// A body has no unknown of this index.
    #[error("the body has {count} unknowns, so there is none with index {unknown}")]
    NoSuchUnknown {
        /// Requested index.
        unknown: usize,
        /// Number of unknowns.
        count: usize,
    },
    /// A scale is not positive. That of a shared unknown may be 0.
    #[error("expected a scale greater than 0 for unknown {unknown}, got {scale}; shared unknowns are counted last")]
    WrongScale {
        /// Index of the unknown, or, counted on from the own ones, of the shared unknown.
        unknown: usize,
        /// The scale, in m per unit.
        scale: f64,
    },
    /// A vector does not have the length that the body needs.
    #[error("the body needs {expected} {what}, but {found} were given")]
    WrongLength {
        /// Content of the vector.
        what: &'static str,
        /// Length that the body needs.
        expected: usize,
        /// Length of the vector.
        found: usize,
    },
    /// A mass or inertia that is negative or not finite, or of another kind than its unknown.
    #[error("expected {expected} for unknown {unknown}, got {found}")]
    WrongInertia {
        /// Index of the unknown.
        unknown: usize,
        /// Description of the expected inertia.
        expected: &'static str,
        /// The given inertia.
        found: String,
    },
    /// A number is infinite or NaN.
    #[error("{what} {index} is not finite: {value}")]
    NonFinite {
        /// Content of the vector.
        what: &'static str,
        /// Index within the vector.
        index: usize,
        /// The infinite number or NaN.
        value: f64,
    },
    /// A rotation is further than 1e-6 from unit length.
    #[error("the quaternion of unknown {unknown} has length {norm}, expected 1")]
    NotUnit {
        /// Index of the unknown.
        unknown: usize,
        /// Norm of the quaternion.
        norm: f64,
    },
    /// A derivative of an element, or its next state, is infinite or NaN.
    #[error("{term}: element {element} has a non-finite {what} at finite unknowns")]
    NonFiniteElement {
        /// Name of the term.
        term: String,
        /// Index of the element.
        element: usize,
        /// "gradient", "Hessian" or "next state".
        what: &'static str,
    },
    /// Saved states do not fit the system's terms.
    #[error("{term} has {expected} numbers of state, but {found} were saved")]
    WrongStates {
        /// Name of the term.
        term: String,
        /// Numbers of state of the term.
        expected: usize,
        /// Numbers that were saved.
        found: usize,
    },
}
