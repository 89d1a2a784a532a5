//! Compiled elements of the library with bound parameters, behind one interface for all types.

#[cfg(feature = "compiled")]
mod kernels;
#[cfg(feature = "compiled")]
mod matrices;

use energy_dsl::{BatchError, Flagged, Float, RoutineKind};

/// Elements of one type with bound parameters. Element i reads the i-th numbers of `x` and `v`: three coordinates for
/// each point, or its unknowns.
pub trait CompiledBatch<S>: Send + Sync {
    /// Writes the results of a routine for all elements, matrices row by row. `v` may be empty if the routine does not
    /// read it. `None` if the routine is not compiled: products of Hessians and vectors, and constraints as such with
    /// their forces.
    fn evaluate(
        &self,
        routine: RoutineKind,
        x: &[S],
        v: &[S],
        results: &mut [&mut [S]],
    ) -> Option<Result<Flagged, BatchError>>;
}

/// Binds `count` compiled elements to their numbers: `numbers(i)` returns parameters and stored numbers of element i,
/// as [`energy_dsl::Stored`] lists them.
///
/// The result is `None` without the feature `compiled`, for an unknown name, and for elements whose largest routine has
/// more than 475 operations (100 in `f32`). These take too long to compile, and too much space. It is also `None` if
/// coordinates cannot be indexed by `u32`.
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
pub type Bind<S> = fn(usize, &dyn Fn(usize) -> Vec<S>) -> Option<Box<dyn CompiledBatch<S>>>;

/// `f32` or `f64`.
pub trait Scalar: Float + Send + Sync + 'static {
    /// Names of the elements, and how to bind them. Empty without the feature `compiled`.
    fn table() -> &'static [(&'static str, Option<Bind<Self>>)];
}

#[cfg(not(feature = "compiled"))]
impl Scalar for f64 {
    fn table() -> &'static [(&'static str, Option<Bind<Self>>)] {
        &[]
    }
}

#[cfg(not(feature = "compiled"))]
impl Scalar for f32 {
    fn table() -> &'static [(&'static str, Option<Bind<Self>>)] {
        &[]
    }
}
