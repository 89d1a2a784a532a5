use std::fmt;

use crate::graph::NodeId;

/// The shape of a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Shape {
    /// A single number, without components.
    Scalar,
    /// A vector of 2, 3 or 4 numbers.
    Vector(u8),
    /// A matrix, rows × columns.
    Matrix(u8, u8),
    /// A quaternion: w, x, y, z.
    Quat,
    /// A position, then a rotation as a quaternion.
    Motion,
    /// A dual quaternion: real part, then dual part.
    DualQuat,
    /// A twist: rotation vector, then translation.
    Twist,
    /// A truth value: the outcome of a comparison.
    Truth,
    /// An array of this many values. No function takes one; its entries are values of their own.
    Array(u16),
    /// One vector per point, the result of a force; or the rows of a constraint or residual.
    Rows(u16),
}

impl Shape {
    /// Returns the count of numbers.
    #[must_use]
    pub fn size(self) -> usize {
        match self {
            Self::Scalar | Self::Truth => 1,
            Self::Vector(n) => n.into(),
            Self::Matrix(r, c) => usize::from(r) * usize::from(c),
            Self::Quat => 4,
            Self::Motion => 7,
            Self::DualQuat => 8,
            Self::Twist => 6,
            Self::Array(n) | Self::Rows(n) => usize::from(n),
        }
    }

    /// Returns the index of each number, as formulas write it: nothing, `[i]`, or `[row][column]`.
    pub(crate) fn indices(self) -> Vec<String> {
        match self {
            Self::Scalar | Self::Truth => vec![String::new()],
            Self::Matrix(rows, columns) => {
                (0..rows).flat_map(|row| (0..columns).map(move |column| format!("[{row}][{column}]"))).collect()
            }
            _ => (0..self.size()).map(|i| format!("[{i}]")).collect(),
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
            Self::Quat => f.write_str("a quaternion"),
            Self::Motion => f.write_str("a motion"),
            Self::DualQuat => f.write_str("a dual quaternion"),
            Self::Twist => f.write_str("a twist"),
            Self::Array(n) => write!(f, "an array of {n}"),
            Self::Rows(n) => write!(f, "{n} rows"),
        }
    }
}

/// A lowered value: its shape, and its numbers row by row.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Lowered {
    /// Shape of the value.
    pub shape: Shape,
    /// Nodes of its numbers.
    pub parts: Vec<NodeId>,
}

impl Lowered {
    /// Creates a scalar.
    #[must_use]
    pub fn scalar(node: NodeId) -> Self {
        Self { shape: Shape::Scalar, parts: vec![node] }
    }

    /// Creates a truth value.
    #[must_use]
    pub fn truth(node: NodeId) -> Self {
        Self { shape: Shape::Truth, parts: vec![node] }
    }

    /// Creates a vector.
    #[must_use]
    pub fn vector(parts: impl Into<Vec<NodeId>>) -> Self {
        let parts = parts.into();
        let n = u8::try_from(parts.len()).expect("short vectors");
        Self { shape: Shape::Vector(n), parts }
    }

    /// Creates a matrix.
    ///
    /// # Panics
    /// If there are not `rows · columns` parts.
    #[must_use]
    pub fn matrix(rows: usize, columns: usize, parts: Vec<NodeId>) -> Self {
        assert_eq!(parts.len(), rows * columns);
        Self { shape: Shape::Matrix(rows as u8, columns as u8), parts }
    }

    /// Returns the node of a scalar.
    ///
    /// # Panics
    /// If this is not a scalar.
    #[must_use]
    pub fn node(&self) -> NodeId {
        assert_eq!(self.parts.len(), 1);
        self.parts[0]
    }

    /// Returns rows and columns. A vector is a column.
    #[must_use]
    pub fn dimensions(&self) -> (usize, usize) {
        match self.shape {
            Shape::Matrix(r, c) => (r.into(), c.into()),
            _ => (self.parts.len(), 1),
        }
    }

    /// Returns entry (i, j).
    #[must_use]
    pub fn at(&self, i: usize, j: usize) -> NodeId {
        self.parts[i * self.dimensions().1 + j]
    }
}
