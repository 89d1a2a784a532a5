//! Calls of routines as kernels: the plain methods of generated elements run the levelled ones through these.

use super::cpu::{Kernel, Level};
use super::element::{Constraint, ForceLaw, Potential, ReducedPotential, Residual};
use super::real::Real;
use super::results::{
    ConstraintHessian, ConstraintJacobian, ForceJacobians, ForceValue, Gradient, Hessian, HessianVector,
    ReducedHessian, ResidualJacobian, ResidualValue, Value,
};

/// A call with its element and arguments.
macro_rules! call {
    ($name:ident: $element:ident, $routine:ident($($argument:tt $points:ty),+) -> $output:ty) => {
        #[doc(hidden)]
        pub struct $name<'a, T: Real, E: $element<T>>(pub &'a E, $(pub &'a $points),+);

        impl<T: Real, E: $element<T>> Kernel for $name<'_, T, E> {
            type Output = $output;

            #[inline(always)]
            fn run<L: Level>(self) -> Self::Output {
                self.0.$routine::<L>($(self.$argument),+)
            }
        }
    };
}

type Points<E, T> = <E as Potential<T>>::Points;

call!(ValueCall: Potential, value_at(1 E::Points) -> Value<T>);
call!(GradientCall: Potential, gradient_at(1 E::Points) -> Gradient<T, E::Points>);
call!(HessianCall: Potential, hessian_at(1 E::Points) -> Hessian<T, E::Points, E::Triangle>);
call!(HessianVectorCall: Potential, hessian_vector_at(1 E::Points, 2 E::Points) -> HessianVector<T, E::Points>);
call!(ReducedHessianCall: ReducedPotential,
    reduced_hessian_at(1 E::Points) -> ReducedHessian<T, E::Coordinates, E::Upper>);
call!(ForceCall: ForceLaw, force_at(1 E::Points, 2 E::Points) -> ForceValue<T, E::Points>);
call!(JacobiansCall: ForceLaw, jacobians_at(1 E::Points, 2 E::Points) -> ForceJacobians<T, E::Points, E::Square>);
call!(ConstraintJacobianCall: Constraint,
    constraint_jacobian_at(1 Points<E, T>) -> ConstraintJacobian<T, E::Rows, E::Jacobian>);
call!(ConstraintHessianCall: Constraint,
    constraint_hessian_at(1 Points<E, T>) -> ConstraintHessian<T, E::Rows, E::Jacobian, E::Triangles>);
call!(GaussNewtonCall: Constraint, gauss_newton_at(1 Points<E, T>) -> Hessian<T, Points<E, T>, E::Triangle>);
call!(ResidualCall: Residual, residual_at(1 E::Unknowns) -> ResidualValue<T, E::Rows>);
call!(ResidualJacobianCall: Residual, jacobian_at(1 E::Unknowns) -> ResidualJacobian<T, E::Rows, E::Jacobian>);

/// The Hessian, written in place.
pub(super) struct HessianInto<'a, T: Real, E: Potential<T>>(
    pub &'a E,
    pub &'a E::Points,
    pub &'a mut Hessian<T, E::Points, E::Triangle>,
);

impl<T: Real, E: Potential<T>> Kernel for HessianInto<'_, T, E> {
    type Output = ();

    #[inline(always)]
    fn run<L: Level>(self) {
        *self.2 = self.0.hessian_at::<L>(self.1);
    }
}
