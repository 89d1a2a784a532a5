//! Conversions from and to types of nalgebra (feature `nalgebra`).
//!
//! Elements take and return plain arrays: `[T; 3]` for a point, `[[T; 3]; N]` for the points of an element. nalgebra
//! converts single vectors: `Vector3::from([x, y, z])` and `<[f64; 3]>::from(vector)`. This module converts what
//! elements take and return.
//!
//! ```
//! use energy_runtime::interop::{points_from, points_to};
//! use nalgebra::{Point3, Vector3};
//!
//! let x = points_from(&[Point3::new(0.0, 1.0, 2.0), Point3::origin()]);
//! assert_eq!(x, [[0.0, 1.0, 2.0], [0.0; 3]]);
//! assert_eq!(points_to::<Vector3<f64>, _, 2>(&x)[0], Vector3::new(0.0, 1.0, 2.0));
//! ```

use nalgebra::{DMatrix, DVector, Quaternion, Scalar, UnitQuaternion};

use crate::array::Array;
use crate::element::{Block, Vector3, triangle_index};
use crate::numbers::Number;
use crate::results::{ForceJacobians, Gradient, Hessian, ResidualJacobian, ResidualValue};

/// Returns the points of an element from points or vectors of nalgebra.
pub fn points_from<P: Clone + Into<[T; 3]>, T, const N: usize>(points: &[P; N]) -> [Vector3<T>; N] {
    std::array::from_fn(|i| points[i].clone().into())
}

/// Returns points or vectors of nalgebra from those of an element: from points, gradients or forces.
pub fn points_to<P: From<[T; 3]>, T: Copy, const N: usize>(points: &[Vector3<T>; N]) -> [P; N] {
    std::array::from_fn(|i| P::from(points[i]))
}

/// Returns the numbers of an input `Quat`, (w, x, y, z), from a unit quaternion of nalgebra, which stores w last.
#[must_use]
pub fn quaternion_from<T: Scalar>(rotation: &UnitQuaternion<T>) -> [T; 4] {
    let [[x, y, z, w]] = rotation.coords.data.0.clone();
    [w, x, y, z]
}

/// Returns a quaternion of nalgebra from the numbers of a `Quat`, (w, x, y, z). It is not normalised.
pub fn quaternion_to<T: Scalar + nalgebra::SimdValue>([w, x, y, z]: [T; 4]) -> Quaternion<T> {
    Quaternion { coords: nalgebra::Vector4::new(x, y, z, w) }
}

/// The vector of all components, point by point.
fn stacked<T: Scalar>(vectors: &[Vector3<T>]) -> DVector<T> {
    DVector::from_iterator(3 * vectors.len(), vectors.as_flattened().iter().cloned())
}

/// The matrix with all N×N blocks of a square.
fn square<T: Scalar>(points: usize, blocks: &[Block<T>]) -> DMatrix<T> {
    DMatrix::from_fn(3 * points, 3 * points, |i, j| blocks[i / 3 * points + j / 3][i % 3][j % 3].clone())
}

impl<T: Number + Scalar, Points: Array<Vector3<T>>> Gradient<T, Points> {
    /// Returns ∂U/∂x as a vector of 3 N numbers, point by point.
    #[must_use]
    pub fn gradient_vector(&self) -> DVector<T> {
        stacked(self.gradient.as_ref())
    }
}

impl<T: Number + Scalar, Points: Array<Vector3<T>>, Triangle: Array<Block<T>>> Hessian<T, Points, Triangle> {
    /// Returns ∂U/∂x as a vector of 3 N numbers, point by point.
    #[must_use]
    pub fn gradient_vector(&self) -> DVector<T> {
        stacked(self.gradient.as_ref())
    }

    /// Returns ∂²U/∂x² as a full symmetric matrix of 3 N rows.
    #[must_use]
    pub fn hessian_matrix(&self) -> DMatrix<T> {
        let (n, triangle) = (Points::LEN, self.hessian.as_ref());
        DMatrix::from_fn(3 * n, 3 * n, |row, column| {
            let (i, j) = (row / 3, column / 3);
            if i <= j {
                triangle[triangle_index(n, i, j)][row % 3][column % 3].clone()
            } else {
                triangle[triangle_index(n, j, i)][column % 3][row % 3].clone()
            }
        })
    }
}

impl<T: Number + Scalar, Points: Array<Vector3<T>>, Square: Array<Block<T>>> ForceJacobians<T, Points, Square> {
    /// Returns f as a vector of 3 N numbers, point by point.
    #[must_use]
    pub fn force_vector(&self) -> DVector<T> {
        stacked(self.force.as_ref())
    }

    /// Returns ∂f/∂x as a matrix of 3 N rows.
    #[must_use]
    pub fn by_position_matrix(&self) -> DMatrix<T> {
        square(Points::LEN, self.by_position.as_ref())
    }

    /// Returns ∂f/∂v as a matrix of 3 N rows.
    #[must_use]
    pub fn by_velocity_matrix(&self) -> DMatrix<T> {
        square(Points::LEN, self.by_velocity.as_ref())
    }
}

impl<T: Number + Scalar, Rows: Array<T>> ResidualValue<T, Rows> {
    /// Returns r as a vector.
    #[must_use]
    pub fn residual_vector(&self) -> DVector<T> {
        DVector::from_column_slice(self.value.as_ref())
    }
}

impl<T: Number + Scalar, Rows: Array<T>, Jacobian: Array<T>> ResidualJacobian<T, Rows, Jacobian> {
    /// Returns r as a vector.
    #[must_use]
    pub fn residual_vector(&self) -> DVector<T> {
        DVector::from_column_slice(self.value.as_ref())
    }

    /// Returns ∂r/∂u as a matrix: one row per number of r, one column per unknown.
    #[must_use]
    pub fn jacobian_matrix(&self) -> DMatrix<T> {
        let rows = Rows::LEN;
        DMatrix::from_row_slice(rows, self.jacobian.as_ref().len() / rows, self.jacobian.as_ref())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numbers::Flags;

    #[test]
    fn entries_keep_their_places() {
        // Numbers tell point, other point, row and column.
        let block = |i: usize, j: usize| [0, 1, 2].map(|r| [0, 1, 2].map(|c| (1000 * i + 100 * j + 10 * r + c) as f64));
        let blocks = [block(0, 0), block(0, 1), block(1, 0), block(1, 1)];
        let (force, flags) = ([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]], Flags::clear());
        let by_velocity = blocks.map(|block| block.map(|row| row.map(|x: f64| -x)));
        let jacobians = ForceJacobians { force, by_position: blocks, by_velocity, flags };
        let expected = |row: usize, column: usize| block(row / 3, column / 3)[row % 3][column % 3];
        assert_eq!(jacobians.by_position_matrix(), DMatrix::from_fn(6, 6, expected));
        assert_eq!(jacobians.by_velocity_matrix(), -DMatrix::from_fn(6, 6, expected));
        assert_eq!(jacobians.force_vector(), DVector::from_iterator(6, (1..=6).map(f64::from)));
        let triangle = [block(0, 0), block(0, 1), block(1, 1)];
        let hessian = Hessian { value: 0.0, gradient: force, hessian: triangle, flags };
        let below = |row: usize, column: usize| {
            if row / 3 > column / 3 { expected(column, row) } else { expected(row, column) }
        };
        assert_eq!(hessian.hessian_matrix(), DMatrix::from_fn(6, 6, below));
        assert_eq!(hessian.gradient_vector(), jacobians.force_vector());
        let residual = ResidualJacobian { value: [1.0, 2.0], jacobian: [1.0, 2.0, 3.0, 4.0, 5.0, 6.0], flags };
        assert_eq!(residual.jacobian_matrix(), DMatrix::from_row_slice(2, 3, &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]));
        assert_eq!(residual.residual_vector().as_slice(), [1.0, 2.0]);
    }
}
