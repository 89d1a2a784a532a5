//! Kernels that call one routine. The plain methods of generated elements run `*_at::<L>` through them.
//!
//! A caller has often just stored the points one number at a time. A vector load of them would stall until these stores
//! retire (failed store forwarding), so the points are read one number at a time, too.

use crate::array::Array;
use crate::element::{
    Constraint, ForceLaw, MixedConstraint, MixedForce, MixedPotential, Potential, ReducedPotential, Residual,
    StateSensitivity, Stateful, Vector3, VertexPotential,
};
use crate::numbers::Real;
use crate::numbers::{Kernel, Level, read_alone};
use crate::results::{
    ConstraintHessian, ConstraintJacobian, ForceJacobians, ForceValue, Gradient, Hessian, HessianVector,
    MixedConstraintHessian, MixedConstraintJacobian, MixedForceValue, MixedGradient, MixedHessian, MixedJacobians,
    MixedProduct, NextJacobians, NextState, ReducedHessian, ResidualJacobian, ResidualValue, StateJacobian, Value,
    Vertex,
};

/// Declares a kernel that holds an element and the arguments of one routine.
macro_rules! call {
    ($name:ident: $element:ident, $routine:ident($($argument:tt $read:ident $points:ty),+) -> $output:ty) => {
        #[doc(hidden)]
        pub struct $name<'a, T: Real, E: $element<T>>(pub &'a E, $(pub &'a $points),+);

        impl<T: Real, E: $element<T>> Kernel for $name<'_, T, E> {
            type Output = $output;

            #[inline(always)]
            fn run<L: Level>(self) -> Self::Output {
                self.0.$routine::<L>($(&$read(self.$argument)),+)
            }
        }
    };
}

type Points<E, T> = <E as Potential<T>>::Points;

/// Copies vectors, one scalar load each.
#[inline(always)]
fn vectors<T: Real, A: Array<Vector3<T>>>(vectors: &A) -> A {
    let mut read = A::repeat([T::from_f64(0.0); 3]);
    for i in 0..A::LEN {
        for axis in 0..3 {
            read.as_mut()[i][axis] = read_alone(&vectors.as_ref()[i][axis]);
        }
    }
    read
}

/// Copies numbers, one scalar load each.
#[inline(always)]
fn numbers<T: Real, A: Array<T>>(numbers: &A) -> A {
    let mut read = A::repeat(T::from_f64(0.0));
    for i in 0..A::LEN {
        read.as_mut()[i] = read_alone(&numbers.as_ref()[i]);
    }
    read
}

call!(ValueCall: Potential, value_at(1 vectors E::Points) -> Value<T>);
call!(GradientCall: Potential, gradient_at(1 vectors E::Points) -> Gradient<T, E::Points>);
call!(HessianCall: Potential, hessian_at(1 vectors E::Points) -> Hessian<T, E::Points, E::Triangle>);
call!(HessianVectorCall: Potential,
    hessian_vector_at(1 vectors E::Points, 2 vectors E::Points) -> HessianVector<T, E::Points>);
call!(ReducedHessianCall: ReducedPotential,
    reduced_hessian_at(1 vectors E::Points) -> ReducedHessian<T, E::Coordinates, E::Upper>);
call!(ForceCall: ForceLaw, force_at(1 vectors E::Points, 2 vectors E::Points) -> ForceValue<T, E::Points>);
call!(JacobiansCall: ForceLaw,
    jacobians_at(1 vectors E::Points, 2 vectors E::Points) -> ForceJacobians<T, E::Points, E::Square>);
call!(ConstraintJacobianCall: Constraint,
    constraint_jacobian_at(1 vectors Points<E, T>) -> ConstraintJacobian<T, E::Rows, E::Jacobian>);
call!(ConstraintHessianCall: Constraint,
    constraint_hessian_at(1 vectors Points<E, T>) -> ConstraintHessian<T, E::Rows, E::Jacobian, E::Triangles>);
call!(GaussNewtonCall: Constraint, gauss_newton_at(1 vectors Points<E, T>) -> Hessian<T, Points<E, T>, E::Triangle>);
call!(ResidualCall: Residual, residual_at(1 numbers E::Unknowns) -> ResidualValue<T, E::Rows>);
call!(ResidualJacobianCall: Residual, jacobian_at(1 numbers E::Unknowns) -> ResidualJacobian<T, E::Rows, E::Jacobian>);
type Unknowns<E, T> = <E as MixedPotential<T>>::Unknowns;
type Increments<E, T> = <E as MixedPotential<T>>::Increments;

call!(MixedValueCall: MixedPotential, value_at(1 numbers E::Unknowns) -> Value<T>);
call!(MixedGradientCall: MixedPotential, gradient_at(1 numbers E::Unknowns) -> MixedGradient<T, E::Increments>);
call!(MixedHessianCall: MixedPotential,
    hessian_at(1 numbers E::Unknowns) -> MixedHessian<T, E::Increments, E::Upper>);
call!(MixedProductCall: MixedPotential,
    hessian_vector_at(1 numbers E::Unknowns, 2 numbers E::Increments) -> MixedProduct<T, E::Increments>);
call!(MixedForceCall: MixedForce,
    force_at(1 numbers E::Unknowns, 2 numbers E::Increments) -> MixedForceValue<T, E::Increments>);
call!(MixedJacobiansCall: MixedForce,
    jacobians_at(1 numbers E::Unknowns, 2 numbers E::Increments) -> MixedJacobians<T, E::Increments, E::Square>);
call!(MixedConstraintJacobianCall: MixedConstraint,
    constraint_jacobian_at(1 numbers Unknowns<E, T>) -> MixedConstraintJacobian<T, E::Rows, E::Jacobian>);
call!(MixedConstraintHessianCall: MixedConstraint,
    constraint_hessian_at(1 numbers Unknowns<E, T>) -> MixedConstraintHessian<T, E::Rows, E::Jacobian, E::Triangles>);
call!(MixedGaussNewtonCall: MixedConstraint,
    gauss_newton_at(1 numbers Unknowns<E, T>) -> MixedHessian<T, Increments<E, T>, E::Upper>);
call!(NextCall: Stateful, next_at(1 numbers E::Unknowns) -> NextState<T, E::State>);
call!(NextJacobiansCall: Stateful,
    next_jacobians_at(1 numbers E::Unknowns) -> NextJacobians<T, E::State, E::ByUnknowns, E::ByState>);
call!(StateJacobianCall: StateSensitivity,
    state_jacobian_at(1 numbers E::Unknowns) -> StateJacobian<T, E::Slopes, E::SlopesByState>);

/// Calls the routine of one vertex.
#[doc(hidden)]
pub struct VertexCall<'a, T: Real, E: VertexPotential<T>>(pub &'a E, pub usize, pub &'a E::Points);

impl<T: Real, E: VertexPotential<T>> Kernel for VertexCall<'_, T, E> {
    type Output = Vertex<T>;

    #[inline(always)]
    fn run<L: Level>(self) -> Vertex<T> {
        self.0.vertex_at::<L>(self.1, &vectors(self.2))
    }
}

/// Runs another kernel and writes its output to the referenced place.
pub(super) struct WrittenTo<'a, K: Kernel>(pub K, pub &'a mut K::Output);

impl<K: Kernel> Kernel for WrittenTo<'_, K> {
    type Output = ();

    #[inline(always)]
    fn run<L: Level>(self) {
        *self.1 = self.0.run::<L>();
    }
}
