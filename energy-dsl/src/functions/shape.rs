use std::fmt;

use crate::graph::NodeId;

/// What a value is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Shape {
    /// A number.
    Scalar,
    /// A vector of 2, 3 or 4.
    Vector(u8),
    /// A matrix, rows × columns.
    Matrix(u8, u8),
    /// The outcome of a comparison.
    Truth,
    /// One vector per point, the body of a force.
    Forces(u8),
}

impl Shape {
    /// How many numbers it holds.
    #[must_use]
    pub fn size(self) -> usize {
        match self {
            Self::Scalar | Self::Truth => 1,
            Self::Vector(n) => n.into(),
            Self::Matrix(r, c) => usize::from(r) * usize::from(c),
            Self::Forces(n) => 3 * usize::from(n),
        }
    }
}

impl fmt::Display for Shape {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Scalar => f.write_str("a scalar"),
            Self::Vector(n) => write!(f, "a {n}-vector"),
            Self::Matrix(r, c) => write!(f, "a {r}×{c} matrix"),
            Self::Truth => f.write_str("a comparison"),
            Self::Forces(n) => write!(f, "a list of {n} vectors"),
        }
    }
}

/// A value in the graph: its shape and its numbers, row by row.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Lowered {
    /// Its shape.
    pub shape: Shape,
    /// Its numbers.
    pub parts: Vec<NodeId>,
}

impl Lowered {
    /// A scalar.
    #[must_use]
    pub fn scalar(node: NodeId) -> Self {
        Self { shape: Shape::Scalar, parts: vec![node] }
    }

    /// A truth value.
    #[must_use]
    pub fn truth(node: NodeId) -> Self {
        Self { shape: Shape::Truth, parts: vec![node] }
    }

    /// A vector.
    #[must_use]
    pub fn vector(parts: impl Into<Vec<NodeId>>) -> Self {
        let parts = parts.into();
        let n = u8::try_from(parts.len()).expect("short vectors");
        Self { shape: Shape::Vector(n), parts }
    }

    /// A matrix.
    #[must_use]
    pub fn matrix(rows: usize, columns: usize, parts: Vec<NodeId>) -> Self {
        debug_assert_eq!(parts.len(), rows * columns);
        Self { shape: Shape::Matrix(rows as u8, columns as u8), parts }
    }

    /// The only number of a scalar.
    #[must_use]
    pub fn node(&self) -> NodeId {
        debug_assert_eq!(self.parts.len(), 1);
        self.parts[0]
    }

    /// Rows and columns, a vector being a column.
    #[must_use]
    pub fn dimensions(&self) -> (usize, usize) {
        match self.shape {
            Shape::Matrix(r, c) => (r.into(), c.into()),
            _ => (self.parts.len(), 1),
        }
    }

    /// Entry (i, j).
    #[must_use]
    pub fn at(&self, i: usize, j: usize) -> NodeId {
        self.parts[i * self.dimensions().1 + j]
    }
}
