use crate::array::Array;
use crate::element::Vector3;
use crate::numbers::{Flags, Real};
use crate::results::{
    Gradient, HessianVector, MixedGradient, MixedHessian, MixedProduct, ReducedHessian, Value, Vertex,
};

/// Sums the results of like terms.
#[doc(hidden)]
pub trait Accumulate<T: Real>: Sized {
    /// Returns the empty sum.
    fn zero() -> Self;

    /// Adds the result of a term.
    fn accumulate(&mut self, term: &Self);

    /// Returns the sum, flagged where it overflows.
    fn total(self) -> Self;
}

/// Operations on a field that is a number.
mod number {
    use crate::numbers::Real;

    #[inline(always)]
    pub(super) fn zero<T: Real>() -> T {
        T::from_f64(0.0)
    }

    #[inline(always)]
    pub(super) fn add<T: Real>(sum: &mut T, term: &T) {
        *sum = *sum + *term;
    }

    #[inline(always)]
    pub(super) fn all<T: Real>(value: &T) -> T {
        *value
    }
}

/// Operations on a field that is an array of numbers.
mod numbers {
    use super::{Array, Real};

    #[inline(always)]
    pub(super) fn zero<T: Real, A: Array<T>>() -> A {
        A::repeat(T::from_f64(0.0))
    }

    #[inline(always)]
    pub(super) fn add<T: Real, A: Array<T>>(sum: &mut A, term: &A) {
        for (sum, term) in sum.as_mut().iter_mut().zip(term.as_ref()) {
            *sum = *sum + *term;
        }
    }

    #[inline(always)]
    pub(super) fn all<T: Real, A: Array<T>>(values: &A) -> T {
        let mut sum = T::from_f64(0.0);
        for value in values.as_ref() {
            sum = sum + *value;
        }
        sum
    }
}

/// Operations on a field that is an array of vectors.
mod vectors {
    use super::{Array, Real, Vector3, numbers};

    #[inline(always)]
    pub(super) fn zero<T: Real, A: Array<Vector3<T>>>() -> A {
        A::repeat([T::from_f64(0.0); 3])
    }

    #[inline(always)]
    pub(super) fn add<T: Real, A: Array<Vector3<T>>>(sum: &mut A, term: &A) {
        for (sum, term) in sum.as_mut().iter_mut().zip(term.as_ref()) {
            numbers::add(sum, term);
        }
    }

    #[inline(always)]
    pub(super) fn all<T: Real, A: Array<Vector3<T>>>(values: &A) -> T {
        let mut sum = T::from_f64(0.0);
        for value in values.as_ref() {
            sum = sum + numbers::all::<T, _>(value);
        }
        sum
    }
}

/// Implements [`Accumulate`] field by field, each by the module for its shape.
macro_rules! accumulate {
    ($result:ident<T $(, $parameter:ident: $of:ident)*> { $($field:ident: $shape:ident),* }) => {
        impl<T: Real $(, $parameter: Array<$of<T>>)*> Accumulate<T> for $result<T $(, $parameter)*> {
            #[inline(always)]
            fn zero() -> Self {
                Self { $($field: $shape::zero(),)* flags: Flags::clear() }
            }

            #[inline(always)]
            fn accumulate(&mut self, term: &Self) {
                $($shape::add(&mut self.$field, &term.$field);)*
                self.flags = self.flags.union(term.flags);
            }

            #[inline(always)]
            fn total(mut self) -> Self {
                let mut sum = T::from_f64(0.0);
                $(sum = sum + $shape::all(&self.$field);)*
                // False for infinite numbers and NaN.
                let finite = (sum - sum).equal(T::from_f64(0.0));
                self.flags.degenerate = self.flags.degenerate | !finite;
                self
            }
        }
    };
}

/// Alias under which the macro names the shape of a scalar field.
type Number<T> = T;

accumulate!(Value<T> { value: number });
accumulate!(Gradient<T, P: Vector3> { value: number, gradient: vectors });
accumulate!(HessianVector<T, P: Vector3> { product: vectors });
accumulate!(ReducedHessian<T, Q: Number, H: Number> { value: number, gradient: numbers, hessian: numbers });
accumulate!(Vertex<T> { value: number, gradient: numbers, block: vectors });
accumulate!(MixedGradient<T, Q: Number> { value: number, gradient: numbers });
accumulate!(MixedHessian<T, Q: Number, H: Number> { value: number, gradient: numbers, hessian: numbers });
accumulate!(MixedProduct<T, Q: Number> { product: numbers });
