//! Results of routines.

use crate::numbers::Flags;
use crate::numbers::Number;

/// The value of an energy.
#[derive(Clone, Copy, Debug)]
pub struct Value<T: Number> {
    /// The energy U.
    pub value: T,
    /// Flags of this evaluation.
    pub flags: Flags<T>,
}

/// Value and gradient of an energy.
#[derive(Clone, Copy, Debug)]
pub struct Gradient<T: Number, Points> {
    /// The energy U.
    pub value: T,
    /// ∂U/∂x, one vector per point. The force is its negative.
    pub gradient: Points,
    /// Flags of this evaluation.
    pub flags: Flags<T>,
}

/// Value, gradient and Hessian of an energy.
#[derive(Clone, Copy, Debug)]
pub struct Hessian<T: Number, Points, Triangle> {
    /// The energy U.
    pub value: T,
    /// ∂U/∂x, one vector per point.
    pub gradient: Points,
    /// ∂²U/∂x², one triangle of blocks. The diagonal blocks are exactly symmetric.
    pub hessian: Triangle,
    /// Flags of this evaluation.
    pub flags: Flags<T>,
}

/// Value of an energy and its derivatives by one point alone.
#[derive(Clone, Copy, Debug)]
pub struct Vertex<T: Number> {
    /// The energy U.
    pub value: T,
    /// ∂U/∂xᵢ.
    pub gradient: [T; 3],
    /// ∂²U/∂xᵢ², row by row: the diagonal block of the Hessian, exactly symmetric.
    pub block: [[T; 3]; 3],
    /// Flags of this evaluation.
    pub flags: Flags<T>,
}

/// The product of a Hessian with a vector.
#[derive(Clone, Copy, Debug)]
pub struct HessianVector<T: Number, Points> {
    /// ∂²U/∂x² v, one vector per point.
    pub product: Points,
    /// Flags of this evaluation.
    pub flags: Flags<T>,
}

/// Value, gradient and Hessian in reduced coordinates: the differences or other sums of points that the energy depends
/// on, three numbers each, listed in [`crate::Declaration::reduced_vectors`].
#[derive(Clone, Copy, Debug)]
pub struct ReducedHessian<T: Number, Coordinates, Upper> {
    /// The energy U.
    pub value: T,
    /// ∂U/∂q, one number per coordinate.
    pub gradient: Coordinates,
    /// ∂²U/∂q², the upper triangle row by row.
    pub hessian: Upper,
    /// Flags of this evaluation.
    pub flags: Flags<T>,
}

/// The value of a force law.
#[derive(Clone, Copy, Debug)]
pub struct ForceValue<T: Number, Points> {
    /// The force on each point.
    pub force: Points,
    /// Flags of this evaluation.
    pub flags: Flags<T>,
}

/// Value and Jacobians of a force law.
#[derive(Clone, Copy, Debug)]
pub struct ForceJacobians<T: Number, Points, Square> {
    /// The force on each point.
    pub force: Points,
    /// ∂f/∂x. Block (i, j) at index i·N + j is the derivative of the force on point i by point j. Not symmetric in
    /// general.
    pub by_position: Square,
    /// ∂f/∂v, with the same layout.
    pub by_velocity: Square,
    /// Flags of this evaluation.
    pub flags: Flags<T>,
}

/// Value and Jacobian of a constraint.
#[derive(Clone, Copy, Debug)]
pub struct ConstraintJacobian<T: Number, Rows, Jacobian> {
    /// The constraint C, one number per row.
    pub value: Rows,
    /// ∂C/∂x, row by row, one vector per point.
    pub jacobian: Jacobian,
    /// Flags of this evaluation.
    pub flags: Flags<T>,
}

/// Value, Jacobian and second derivatives of a constraint.
#[derive(Clone, Copy, Debug)]
pub struct ConstraintHessian<T: Number, Rows, Jacobian, Triangles> {
    /// The constraint C, one number per row.
    pub value: Rows,
    /// ∂C/∂x, row by row, one vector per point.
    pub jacobian: Jacobian,
    /// ∂²C/∂x², one triangle of blocks per row of C.
    pub hessians: Triangles,
    /// Flags of this evaluation.
    pub flags: Flags<T>,
}

/// The value of a residual.
#[derive(Clone, Copy, Debug)]
pub struct ResidualValue<T: Number, Rows> {
    /// The residual r, one number per row.
    pub value: Rows,
    /// Flags of this evaluation.
    pub flags: Flags<T>,
}

/// Value and Jacobian of a residual.
#[derive(Clone, Copy, Debug)]
pub struct ResidualJacobian<T: Number, Rows, Jacobian> {
    /// The residual r, one number per row.
    pub value: Rows,
    /// ∂r/∂u, row by row; columns are the unknowns in declared order.
    pub jacobian: Jacobian,
    /// Flags of this evaluation.
    pub flags: Flags<T>,
}

/// Value and gradient of an energy of mixed unknowns.
#[derive(Clone, Copy, Debug)]
pub struct MixedGradient<T: Number, Increments> {
    /// The energy U.
    pub value: T,
    /// ∂U/∂u, one number per increment, in declared order.
    pub gradient: Increments,
    /// Flags of this evaluation.
    pub flags: Flags<T>,
}

/// Value, gradient and Hessian of an energy of mixed unknowns.
#[derive(Clone, Copy, Debug)]
pub struct MixedHessian<T: Number, Increments, Upper> {
    /// The energy U.
    pub value: T,
    /// ∂U/∂u, one number per increment, in declared order.
    pub gradient: Increments,
    /// ∂²U/∂u², the upper triangle, row by row.
    pub hessian: Upper,
    /// Flags of this evaluation.
    pub flags: Flags<T>,
}

/// The product of a Hessian of mixed unknowns with a vector.
#[derive(Clone, Copy, Debug)]
pub struct MixedProduct<T: Number, Increments> {
    /// ∂²U/∂u² v, one number per increment.
    pub product: Increments,
    /// Flags of this evaluation.
    pub flags: Flags<T>,
}

/// The value of a force law on mixed unknowns.
#[derive(Clone, Copy, Debug)]
pub struct MixedForceValue<T: Number, Increments> {
    /// The force on each increment: a torque on a rotation.
    pub force: Increments,
    /// Flags of this evaluation.
    pub flags: Flags<T>,
}

/// Value and Jacobians of a force law on mixed unknowns.
#[derive(Clone, Copy, Debug)]
pub struct MixedJacobians<T: Number, Increments, Square> {
    /// The force on each increment: a torque on a rotation.
    pub force: Increments,
    /// ∂f/∂u, row by row: the plain derivative, which is not symmetric for rotations even if f has a potential.
    pub by_position: Square,
    /// ∂f/∂u̇, row by row.
    pub by_velocity: Square,
    /// Flags of this evaluation.
    pub flags: Flags<T>,
}

/// Value and Jacobian of a constraint on mixed unknowns.
#[derive(Clone, Copy, Debug)]
pub struct MixedConstraintJacobian<T: Number, Rows, Jacobian> {
    /// The constraint C, one number per row.
    pub value: Rows,
    /// ∂C/∂u, row by row, one number per increment.
    pub jacobian: Jacobian,
    /// Flags of this evaluation.
    pub flags: Flags<T>,
}

/// Value, Jacobian and second derivatives of a constraint on mixed unknowns.
#[derive(Clone, Copy, Debug)]
pub struct MixedConstraintHessian<T: Number, Rows, Jacobian, Triangles> {
    /// The constraint C, one number per row.
    pub value: Rows,
    /// ∂C/∂u, row by row, one number per increment.
    pub jacobian: Jacobian,
    /// ∂²C/∂u², one upper triangle per row of C, each row by row.
    pub hessians: Triangles,
    /// Flags of this evaluation.
    pub flags: Flags<T>,
}

/// The state of an element after a step.
#[derive(Clone, Copy, Debug)]
pub struct NextState<T: Number, State> {
    /// The new state, in declared order.
    pub state: State,
    /// Flags of this evaluation.
    pub flags: Flags<T>,
}

/// The state of an element after a step, and its derivatives.
#[derive(Clone, Copy, Debug)]
pub struct NextJacobians<T: Number, State, ByUnknowns, ByState> {
    /// The new state, in declared order.
    pub state: State,
    /// ∂(new state)/∂u, row by row, one number per increment of the unknowns.
    pub by_unknowns: ByUnknowns,
    /// ∂(new state)/∂(old state), row by row.
    pub by_state: ByState,
    /// Flags of this evaluation.
    pub flags: Flags<T>,
}

/// The derivatives of an energy's gradient by the state.
#[derive(Clone, Copy, Debug)]
pub struct StateJacobian<T: Number, Increments, ByState> {
    /// ∂U/∂u, one number per increment.
    pub gradient: Increments,
    /// ∂²U/∂u∂(state), row by row: one row per increment of the unknowns.
    pub by_state: ByState,
    /// Flags of this evaluation.
    pub flags: Flags<T>,
}
