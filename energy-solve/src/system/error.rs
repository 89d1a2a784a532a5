use energy_dsl::Vector3;

use crate::terms::term::Quantity;

/// An element that does not fit the vertices of its system.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SystemError {
    /// An element acts on a vertex that does not exist.
    #[error(
        "{term}: element {element} names vertex {vertex}, but there are only {vertex_count} vertices (0 to {})",
        .vertex_count.saturating_sub(1)
    )]
    VertexOutOfRange {
        /// Name of the term.
        term: String,
        /// Index of the element.
        element: usize,
        /// Index of the missing vertex.
        vertex: usize,
        /// Number of vertices of the system.
        vertex_count: usize,
    },
}

/// A sum that could not be evaluated.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum EvaluationError {
    /// The number of positions or velocities is not the number of vertices.
    #[error("the system has {expected} vertices, but {found} {what} were given")]
    WrongLength {
        /// "positions" or "velocities".
        what: &'static str,
        /// Number of vertices of the system.
        expected: usize,
        /// Number of vectors given.
        found: usize,
    },
    /// A position or velocity is infinite or NaN.
    #[error("vertex {vertex} has a non-finite {what}: {value:?}")]
    NonFiniteState {
        /// "position" or "velocity".
        what: &'static str,
        /// Index of the vertex.
        vertex: usize,
        /// The position or velocity.
        value: Vector3<f64>,
    },
    /// The force or energy of an element is infinite or NaN. An energy is infinite outside of its formula's domain.
    #[error(
        "{term}: element {element} on vertices {vertices:?} has a non-finite {what} at finite positions and velocities"
    )]
    NonFiniteElement {
        /// Name of the term.
        term: String,
        /// Index of the element.
        element: usize,
        /// Vertices of the element.
        vertices: Vec<usize>,
        /// Whether the energy or the force is not finite.
        what: Quantity,
    },
    /// Each element's energy or force is finite, but the sum is not.
    #[error("the {what} of each element is finite, but their sum overflows")]
    NonFiniteSum {
        /// Whether the energy or the force is not finite.
        what: Quantity,
    },
}
