//! The traits of elements whose unknowns are not only points in space: scalars, vectors, points of a plane, rotations,
//! and unknowns that elements share.
//!
//! Unknowns are one flat array in declared order. Derivatives are by *increments*: those of numbers and points are
//! added, and a rotation q, a unit quaternion (w, x, y, z), moves to exp(δ) q, which turns it by |δ| about δ. So it has
//! four numbers and three increments. Its derivatives are those at δ = 0. There the second derivatives of U(exp(δ) q)
//! are symmetric; *differences of gradients* along exp are not: they differ by half of the torque's cross-product
//! matrix.

use super::Element;
use crate::array::Array;
use crate::numbers::{Level, Real};
use crate::results::{
    MixedConstraintHessian, MixedConstraintJacobian, MixedForceValue, MixedGradient, MixedHessian, MixedJacobians,
    MixedProduct, NextJacobians, NextState, StateJacobian, Value,
};

/// A potential energy U(u) of mixed unknowns.
///
/// Outside of the formula's domain, U is +∞, its derivatives are 0, and it is flagged, as for a
/// [`Potential`](super::Potential).
pub trait MixedPotential<T: Real>: Element {
    /// The unknowns: `[T; U]`.
    type Unknowns: Array<T>;
    /// One number per increment: `[T; D]`.
    type Increments: Array<T>;
    /// The upper triangle, row by row: `[T; D (D + 1) / 2]`.
    type Upper: Array<T>;

    /// Returns U.
    fn value(&self, u: &Self::Unknowns) -> Value<T>;
    /// [`Self::value`] for callers that run at SIMD level `L`.
    fn value_at<L: Level>(&self, u: &Self::Unknowns) -> Value<T>;
    /// Returns U and ∂U/∂u.
    fn gradient(&self, u: &Self::Unknowns) -> MixedGradient<T, Self::Increments>;
    /// [`Self::gradient`] for callers that run at SIMD level `L`.
    fn gradient_at<L: Level>(&self, u: &Self::Unknowns) -> MixedGradient<T, Self::Increments>;
    /// Returns U, ∂U/∂u and ∂²U/∂u².
    fn hessian(&self, u: &Self::Unknowns) -> MixedHessian<T, Self::Increments, Self::Upper>;
    /// [`Self::hessian`] for callers that run at SIMD level `L`.
    fn hessian_at<L: Level>(&self, u: &Self::Unknowns) -> MixedHessian<T, Self::Increments, Self::Upper>;
    /// Returns ∂²U/∂u² v.
    fn hessian_vector(&self, u: &Self::Unknowns, v: &Self::Increments) -> MixedProduct<T, Self::Increments>;
    /// [`Self::hessian_vector`] for callers that run at SIMD level `L`.
    fn hessian_vector_at<L: Level>(
        &self,
        u: &Self::Unknowns,
        v: &Self::Increments,
    ) -> MixedProduct<T, Self::Increments>;
}

/// A force f(u, u̇) on mixed unknowns: one number per increment, in N on points, in N m on rotations.
pub trait MixedForce<T: Real>: Element {
    /// The unknowns: `[T; U]`.
    type Unknowns: Array<T>;
    /// One number per increment: `[T; D]`.
    type Increments: Array<T>;
    /// A matrix, row by row: `[T; D * D]`.
    type Square: Array<T>;

    /// Returns f. `v` has the rates of the unknowns; that of a rotation is its angular velocity in space.
    fn force(&self, u: &Self::Unknowns, v: &Self::Increments) -> MixedForceValue<T, Self::Increments>;
    /// [`Self::force`] for callers that run at SIMD level `L`.
    fn force_at<L: Level>(&self, u: &Self::Unknowns, v: &Self::Increments) -> MixedForceValue<T, Self::Increments>;
    /// Returns f, ∂f/∂u and ∂f/∂u̇.
    fn jacobians(&self, u: &Self::Unknowns, v: &Self::Increments) -> MixedJacobians<T, Self::Increments, Self::Square>;
    /// [`Self::jacobians`] for callers that run at SIMD level `L`.
    fn jacobians_at<L: Level>(
        &self,
        u: &Self::Unknowns,
        v: &Self::Increments,
    ) -> MixedJacobians<T, Self::Increments, Self::Square>;
}

/// A constraint C(u) on mixed unknowns and its compliant forms, as a [`Constraint`](super::Constraint) on points.
pub trait MixedConstraint<T: Real>: MixedPotential<T> + MixedForce<T> {
    /// One number per row of C: `[T; M]`.
    type Rows: Array<T>;
    /// A matrix, row by row: `[T; M * D]`.
    type Jacobian: Array<T>;
    /// One upper triangle per row: `[T; M * D (D + 1) / 2]`.
    type Triangles: Array<T>;

    /// Returns C and J.
    fn constraint_jacobian(
        &self,
        u: &<Self as MixedPotential<T>>::Unknowns,
    ) -> MixedConstraintJacobian<T, Self::Rows, Self::Jacobian>;
    /// [`Self::constraint_jacobian`] for callers that run at SIMD level `L`.
    fn constraint_jacobian_at<L: Level>(
        &self,
        u: &<Self as MixedPotential<T>>::Unknowns,
    ) -> MixedConstraintJacobian<T, Self::Rows, Self::Jacobian>;
    /// Returns C, J and ∂²C.
    fn constraint_hessian(
        &self,
        u: &<Self as MixedPotential<T>>::Unknowns,
    ) -> MixedConstraintHessian<T, Self::Rows, Self::Jacobian, Self::Triangles>;
    /// [`Self::constraint_hessian`] for callers that run at SIMD level `L`.
    fn constraint_hessian_at<L: Level>(
        &self,
        u: &<Self as MixedPotential<T>>::Unknowns,
    ) -> MixedConstraintHessian<T, Self::Rows, Self::Jacobian, Self::Triangles>;
    /// Returns value, gradient and the Gauss–Newton Hessian k_s JᵀJ of ½ k_s CᵀC.
    fn gauss_newton(
        &self,
        u: &<Self as MixedPotential<T>>::Unknowns,
    ) -> MixedHessian<T, <Self as MixedPotential<T>>::Increments, <Self as MixedPotential<T>>::Upper>;
    /// [`Self::gauss_newton`] for callers that run at SIMD level `L`.
    fn gauss_newton_at<L: Level>(
        &self,
        u: &<Self as MixedPotential<T>>::Unknowns,
    ) -> MixedHessian<T, <Self as MixedPotential<T>>::Increments, <Self as MixedPotential<T>>::Upper>;
}

/// An element with memory: a state that stays fixed while a step is solved, and that `next` advances once the step is
/// accepted.
pub trait Stateful<T: Real>: Element {
    /// The unknowns: `[T; U]`, flat also for points.
    type Unknowns: Array<T>;
    /// The state: `[T; S]`.
    type State: Array<T>;
    /// A matrix, row by row: `[T; S * D]`.
    type ByUnknowns: Array<T>;
    /// A matrix, row by row: `[T; S * S]`.
    type ByState: Array<T>;

    /// Returns the state, in declared order.
    fn state(&self) -> Self::State;
    /// Replaces the state.
    fn set_state(&mut self, state: &Self::State);
    /// Sets the parameter that `#[time_step(…)]` names to the length of the next step; elements without one ignore it.
    fn set_time_step(&mut self, _h: T) {}
    /// Returns the state after a step that ends at u.
    fn next(&self, u: &Self::Unknowns) -> NextState<T, Self::State>;
    /// [`Self::next`] for callers that run at SIMD level `L`.
    fn next_at<L: Level>(&self, u: &Self::Unknowns) -> NextState<T, Self::State>;
    /// Returns the state after a step that ends at u, and its derivatives by u and by the present state.
    fn next_jacobians(&self, u: &Self::Unknowns) -> NextJacobians<T, Self::State, Self::ByUnknowns, Self::ByState>;
    /// [`Self::next_jacobians`] for callers that run at SIMD level `L`.
    fn next_jacobians_at<L: Level>(
        &self,
        u: &Self::Unknowns,
    ) -> NextJacobians<T, Self::State, Self::ByUnknowns, Self::ByState>;
}

/// How the first derivatives of an element with memory depend on its state, for derivatives through time.
pub trait StateSensitivity<T: Real>: Stateful<T> {
    /// One number per increment, or per row of a residual: `[T; D]`.
    type Slopes: Array<T>;
    /// A matrix, row by row: `[T; D * S]`.
    type SlopesByState: Array<T>;

    /// Returns ∂U/∂u and ∂²U/∂u∂(state) of an energy or of a constraint's ½ k_s CᵀC, or r and ∂r/∂(state) of a
    /// residual.
    fn state_jacobian(&self, u: &Self::Unknowns) -> StateJacobian<T, Self::Slopes, Self::SlopesByState>;
    /// [`Self::state_jacobian`] for callers that run at SIMD level `L`.
    fn state_jacobian_at<L: Level>(&self, u: &Self::Unknowns) -> StateJacobian<T, Self::Slopes, Self::SlopesByState>;
}
