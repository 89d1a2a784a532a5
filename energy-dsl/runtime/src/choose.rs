use crate::array::Array;
use crate::element::{Block, Vector3};
use crate::numbers::Flags;
use crate::numbers::Real;
use crate::results::{
    ConstraintHessian, ConstraintJacobian, ForceJacobians, ForceValue, Gradient, Hessian, HessianVector,
    MixedConstraintHessian, MixedConstraintJacobian, MixedForceValue, MixedGradient, MixedHessian, MixedJacobians,
    MixedProduct, NextJacobians, NextState, ReducedHessian, ResidualJacobian, ResidualValue, StateJacobian, Value,
    Vertex,
};

/// Selects between two results, lane by lane.
#[doc(hidden)]
pub trait Choose<T: Real>: Sized {
    /// Returns `yes` where the mask holds, `no` elsewhere.
    fn choose(mask: T::Mask, yes: &Self, no: &Self) -> Self;
}

impl<T: Real> Choose<T> for Flags<T> {
    fn choose(mask: T::Mask, yes: &Self, no: &Self) -> Self {
        let pick = |yes: T::Mask, no: T::Mask| (mask & yes) | (!mask & no);
        Self { degenerate: pick(yes.degenerate, no.degenerate), kink: pick(yes.kink, no.kink) }
    }
}

fn numbers<T: Real, A: Array<T>>(mask: T::Mask, yes: &A, no: &A) -> A {
    A::from_fn(|i| T::select(mask, yes.as_ref()[i], no.as_ref()[i]))
}

fn vectors<T: Real, A: Array<Vector3<T>>>(mask: T::Mask, yes: &A, no: &A) -> A {
    A::from_fn(|i| numbers(mask, &yes.as_ref()[i], &no.as_ref()[i]))
}

fn blocks<T: Real, A: Array<Block<T>>>(mask: T::Mask, yes: &A, no: &A) -> A {
    A::from_fn(|i| vectors(mask, &yes.as_ref()[i], &no.as_ref()[i]))
}

/// Implements [`Choose`] field by field, each by the function for its shape.
macro_rules! choose {
    ($result:ident<T $(, $parameter:ident: $of:ident)*> { $($field:ident: $shape:ident),* }) => {
        impl<T: Real $(, $parameter: Array<$of<T>>)*> Choose<T> for $result<T $(, $parameter)*> {
            fn choose(mask: T::Mask, yes: &Self, no: &Self) -> Self {
                Self {
                    $($field: $shape(mask, &yes.$field, &no.$field),)*
                    flags: Flags::choose(mask, &yes.flags, &no.flags),
                }
            }
        }
    };
}

/// Alias under which the macro names the shape of a scalar field.
type Number<T> = T;

fn number<T: Real>(mask: T::Mask, yes: &T, no: &T) -> T {
    T::select(mask, *yes, *no)
}

choose!(Value<T> { value: number });
choose!(Gradient<T, P: Vector3> { value: number, gradient: vectors });
choose!(Hessian<T, P: Vector3, H: Block> { value: number, gradient: vectors, hessian: blocks });
choose!(HessianVector<T, P: Vector3> { product: vectors });
choose!(ReducedHessian<T, Q: Number, H: Number> { value: number, gradient: numbers, hessian: numbers });
choose!(ForceValue<T, P: Vector3> { force: vectors });
choose!(ForceJacobians<T, P: Vector3, S: Block> { force: vectors, by_position: blocks, by_velocity: blocks });
choose!(ConstraintJacobian<T, R: Number, J: Vector3> { value: numbers, jacobian: vectors });
choose!(ConstraintHessian<T, R: Number, J: Vector3, H: Block> { value: numbers, jacobian: vectors, hessians: blocks });
choose!(Vertex<T> { value: number, gradient: numbers, block: vectors });
choose!(ResidualValue<T, R: Number> { value: numbers });
choose!(ResidualJacobian<T, R: Number, J: Number> { value: numbers, jacobian: numbers });
choose!(MixedGradient<T, Q: Number> { value: number, gradient: numbers });
choose!(MixedHessian<T, Q: Number, H: Number> { value: number, gradient: numbers, hessian: numbers });
choose!(MixedProduct<T, Q: Number> { product: numbers });
choose!(MixedForceValue<T, Q: Number> { force: numbers });
choose!(MixedJacobians<T, Q: Number, S: Number> { force: numbers, by_position: numbers, by_velocity: numbers });
choose!(MixedConstraintJacobian<T, R: Number, J: Number> { value: numbers, jacobian: numbers });
choose!(MixedConstraintHessian<T, R: Number, J: Number, H: Number> {
    value: numbers, jacobian: numbers, hessians: numbers
});
choose!(NextState<T, S: Number> { state: numbers });
choose!(NextJacobians<T, S: Number, U: Number, B: Number> { state: numbers, by_unknowns: numbers, by_state: numbers });
choose!(StateJacobian<T, Q: Number, B: Number> { gradient: numbers, by_state: numbers });
