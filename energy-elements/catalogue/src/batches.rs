//! Compiled elements with bound parameters, behind one interface for all types.

use energy_dsl::{BatchError, Flagged, Float};

/// A routine of many elements: what is written for each.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BatchRoutine {
    /// Energies U.
    Value,
    /// U and ∂U/∂x.
    Gradient,
    /// U, ∂U/∂x and ∂²U/∂x², row by row.
    Hessian,
    /// (∂²U/∂x²) v.
    HessianVector,
    /// f(x, v).
    Force,
    /// f, ∂f/∂x and ∂f/∂v, row by row.
    ForceJacobians,
    /// C and ∂C/∂x.
    Constraint,
    /// r(u).
    Residual,
    /// r and ∂r/∂u, row by row.
    Jacobian,
}

/// Elements of one type with bound parameters. Element i reads the i-th numbers of `x` and `v`: three coordinates for
/// each point, or its unknowns.
pub trait CompiledBatch<S>: Send + Sync {
    /// Writes the results of a routine for all elements. `v` may be empty if the routine does not read it.
    /// `None` if the routine is not compiled: products of Hessians and
    /// vectors, and constraints as such with their forces.
    fn evaluate(
        &self,
        routine: BatchRoutine,
        x: &[S],
        v: &[S],
        results: &mut [&mut [S]],
    ) -> Option<Result<Flagged, BatchError>>;
}

/// Binds `count` compiled elements to their numbers: `numbers(i)` returns parameters and stored numbers of element i,
/// as [`energy_dsl::Stored`] lists them.
///
/// The result is `None` without the feature `batches`, for an unknown name, and for elements whose largest routine has
/// more than 475 operations (100 in `f32`). These take too long to compile, and too much space. It is also `None` if
/// coordinates cannot be indexed by `u32`.
///
/// ```
/// # #[cfg(feature = "batches")] {
/// use energy_catalogue::{BatchRoutine, bind};
///
/// // HookeSpring(p, q; k, L): U = k/2 (‖p − q‖ − L)².
/// let springs = bind::<f64>("HookeSpring", 2, |_| vec![100.0, 1.0]).unwrap();
/// let x = [0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0];
/// let mut energies = [0.0; 2];
/// springs.evaluate(BatchRoutine::Value, &x, &[], &mut [&mut energies]).unwrap().unwrap();
/// assert_eq!(energies, [50.0, 0.0]);
/// # }
/// ```
#[must_use]
pub fn bind<S: Scalar>(
    name: &str,
    count: usize,
    numbers: impl Fn(usize) -> Vec<S>,
) -> Option<Box<dyn CompiledBatch<S>>> {
    let (_, bind) = S::table().iter().find(|(element, _)| *element == name)?;
    (*bind)?(count, &numbers)
}

/// Binds elements of one type.
#[doc(hidden)]
pub type Bind<S> = fn(usize, &dyn Fn(usize) -> Vec<S>) -> Option<Box<dyn CompiledBatch<S>>>;

/// `f32` or `f64`.
pub trait Scalar: Float + Send + Sync + 'static {
    /// Names of the elements, and how to bind them. Empty without the feature `batches`.
    #[doc(hidden)]
    fn table() -> &'static [(&'static str, Option<Bind<Self>>)];
}

#[cfg(not(feature = "batches"))]
impl Scalar for f64 {
    fn table() -> &'static [(&'static str, Option<Bind<Self>>)] {
        &[]
    }
}

#[cfg(not(feature = "batches"))]
impl Scalar for f32 {
    fn table() -> &'static [(&'static str, Option<Bind<Self>>)] {
        &[]
    }
}
