//! What routines return.

use super::flags::Flags;
use super::real::Number;

/// A scalar routine's result without derivatives.
#[derive(Clone, Copy, Debug)]
pub struct Value<T: Number> {
    /// U.
    pub value: T,
    /// Conditions met.
    pub flags: Flags<T>,
}

/// U and ∇U.
#[derive(Clone, Copy, Debug)]
pub struct Gradient<T: Number, Points> {
    /// U.
    pub value: T,
    /// ∂U/∂x, one vector per point. The force is its negative.
    pub gradient: Points,
    /// Conditions met.
    pub flags: Flags<T>,
}

/// U, ∇U and ∇²U.
#[derive(Clone, Copy, Debug)]
pub struct Hessian<T: Number, Points, Triangle> {
    /// U.
    pub value: T,
    /// ∂U/∂x, one vector per point.
    pub gradient: Points,
    /// ∂²U/∂x², one triangle of blocks; the diagonal blocks are exactly symmetric.
    pub hessian: Triangle,
    /// Conditions met.
    pub flags: Flags<T>,
}

/// ∇²U v.
#[derive(Clone, Copy, Debug)]
pub struct HessianVector<T: Number, Points> {
    /// ∂²U/∂x² v, one vector per point.
    pub product: Points,
    /// Conditions met.
    pub flags: Flags<T>,
}

/// U, ∇U and ∇²U by the coordinates that derivatives are taken in: the differences of points through which U sees them, three
/// numbers to a difference, as [`crate::Declaration::reduced_vectors`] lists them.
#[derive(Clone, Copy, Debug)]
pub struct ReducedHessian<T: Number, Coordinates, Upper> {
    /// U.
    pub value: T,
    /// ∂U/∂q.
    pub gradient: Coordinates,
    /// ∂²U/∂q², the upper triangle row by row.
    pub hessian: Upper,
    /// Conditions met.
    pub flags: Flags<T>,
}

/// f.
#[derive(Clone, Copy, Debug)]
pub struct ForceValue<T: Number, Points> {
    /// The force on each point.
    pub force: Points,
    /// Conditions met.
    pub flags: Flags<T>,
}

/// f, ∂f/∂x and ∂f/∂v.
#[derive(Clone, Copy, Debug)]
pub struct ForceJacobians<T: Number, Points, Square> {
    /// The force on each point.
    pub force: Points,
    /// ∂f/∂x: block (i, j), at i·N + j, is the derivative of the force on point i by point j. Not symmetric in general.
    pub by_position: Square,
    /// ∂f/∂v, laid out likewise.
    pub by_velocity: Square,
    /// Conditions met.
    pub flags: Flags<T>,
}

/// C and J = ∂C/∂x.
#[derive(Clone, Copy, Debug)]
pub struct ConstraintJacobian<T: Number, Rows, Jacobian> {
    /// C.
    pub value: Rows,
    /// ∂C/∂x, row by row, one vector per point.
    pub jacobian: Jacobian,
    /// Conditions met.
    pub flags: Flags<T>,
}

/// C, J and ∂²C/∂x².
#[derive(Clone, Copy, Debug)]
pub struct ConstraintHessian<T: Number, Rows, Jacobian, Triangles> {
    /// C.
    pub value: Rows,
    /// ∂C/∂x, row by row, one vector per point.
    pub jacobian: Jacobian,
    /// ∂²C/∂x², one triangle of blocks per row of C.
    pub hessians: Triangles,
    /// Conditions met.
    pub flags: Flags<T>,
}

/// r.
#[derive(Clone, Copy, Debug)]
pub struct ResidualValue<T: Number, Rows> {
    /// The residual.
    pub value: Rows,
    /// Conditions met.
    pub flags: Flags<T>,
}

/// r and J = ∂r/∂(unknowns).
#[derive(Clone, Copy, Debug)]
pub struct ResidualJacobian<T: Number, Rows, Jacobian> {
    /// The residual.
    pub value: Rows,
    /// ∂r/∂u, row-major: row of r, then unknown in declared order.
    pub jacobian: Jacobian,
    /// Conditions met.
    pub flags: Flags<T>,
}
