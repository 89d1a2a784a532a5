//! Compiled elements with bound parameters, behind one interface for all types. Feature `batches`: it compiles the
//! kernels of all elements, in `f64` and `f32`, for every SIMD level.

use std::ops::Range;

use energy_dsl::{BatchError, Flagged, Float, Packed, PackedForce, PackedPotential, PackedResidual, Stored};
use energy_elements::for_each_element;

/// A routine of many elements: what is written for each.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BatchRoutine {
    /// U.
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
    /// Writes the results of a routine for all elements. `v` may be empty if the routine reads no velocities or vectors.
    /// `None` if the type has no lanes for the routine; constraints as such and their forces have none.
    fn evaluate(
        &self,
        routine: BatchRoutine,
        x: &[S],
        v: &[S],
        results: &mut [&mut [S]],
    ) -> Option<Result<Flagged, BatchError>>;
}

/// Binds `count` compiled elements to their numbers: `numbers(i)` returns parameters and stored numbers of element i,
/// as [`Stored`] lists them. `None` if the library has no element of this name.
///
/// ```
/// use energy_catalogue::{BatchRoutine, bind};
///
/// // HookeSpring(p, q; k, L): U = k/2 (‖p − q‖ − L)².
/// let springs = bind::<f64>("HookeSpring", 2, |_| vec![100.0, 1.0]).unwrap();
/// let x = [0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0];
/// let mut energies = [0.0; 2];
/// springs.evaluate(BatchRoutine::Value, &x, &[], &mut [&mut energies]).unwrap().unwrap();
/// assert_eq!(energies, [50.0, 0.0]);
/// ```
#[must_use]
pub fn bind<S: Scalar>(
    name: &str,
    count: usize,
    numbers: impl Fn(usize) -> Vec<S>,
) -> Option<Box<dyn CompiledBatch<S>>> {
    let (_, bind) = S::table().iter().find(|(element, _)| *element == name)?;
    bind(count, &numbers)
}

/// Binds elements of one type; `None` if there are too many to index their coordinates.
type Bind<S> = fn(usize, &dyn Fn(usize) -> Vec<S>) -> Option<Box<dyn CompiledBatch<S>>>;

/// `f32` or `f64`.
pub trait Scalar: Float + Send + Sync + 'static {
    #[doc(hidden)]
    fn table() -> &'static [(&'static str, Bind<Self>)];
}

// Not inlined, and not a constant of the trait: a crate that used that would compile all kernels itself.
macro_rules! table {
    ($($kind:ident $name:ident),*) => {
        &[$((stringify!($name), $kind::<energy_elements::$name<_>, _> as Bind<_>)),*]
    };
}

impl Scalar for f64 {
    #[inline(never)]
    fn table() -> &'static [(&'static str, Bind<Self>)] {
        const TABLE: &[(&str, Bind<f64>)] = for_each_element!(with kinds table);
        TABLE
    }
}

impl Scalar for f32 {
    #[inline(never)]
    fn table() -> &'static [(&'static str, Bind<Self>)] {
        const TABLE: &[(&str, Bind<f32>)] = for_each_element!(with kinds table);
        TABLE
    }
}

fn potential<E, S: Float + Send + Sync + 'static>(
    count: usize,
    numbers: &dyn Fn(usize) -> Vec<S>,
) -> Option<Box<dyn CompiledBatch<S>>>
where
    E: PackedPotential<S, Wide<S> = E> + Send + Sync + 'static,
{
    let points = E::DECLARATION.points.len();
    packed(count, points, |i| E::load::<S>(&padded(numbers(i)), 1)).map(|packed| Box::new(Potentials(packed)) as _)
}

fn force<E, S: Float + Send + Sync + 'static>(
    count: usize,
    numbers: &dyn Fn(usize) -> Vec<S>,
) -> Option<Box<dyn CompiledBatch<S>>>
where
    E: PackedForce<S, Wide<S> = E> + Send + Sync + 'static,
{
    let points = E::DECLARATION.points.len();
    packed(count, points, |i| E::load::<S>(&padded(numbers(i)), 1)).map(|packed| Box::new(Forces(packed)) as _)
}

fn residual<E, S: Float + Send + Sync + 'static>(
    count: usize,
    numbers: &dyn Fn(usize) -> Vec<S>,
) -> Option<Box<dyn CompiledBatch<S>>>
where
    E: PackedResidual<S, Wide<S> = E> + Send + Sync + 'static,
{
    let unknowns = E::DECLARATION.points.iter().map(|field| field.size).sum();
    packed(count, unknowns, |i| E::load::<S>(&padded(numbers(i)), 1)).map(|packed| Box::new(Residuals(packed)) as _)
}

/// Returns numbers that a lane can be loaded from, also if an element has none.
fn padded<S: Float>(numbers: Vec<S>) -> Vec<S> {
    if numbers.is_empty() { vec![S::from_f64(0.0)] } else { numbers }
}

/// Packs elements of which each has places of its own.
fn packed<E: Stored<S>, S: Float>(count: usize, places: usize, element: impl Fn(usize) -> E) -> Option<Packed<E, S>> {
    u32::try_from(count * places).ok()?;
    let elements: Vec<E> = (0..count).map(element).collect();
    Some(Packed::from_fn(count, places, |i| &elements[i], |i, place| (i * places + place) as u32))
}

struct Potentials<E, S>(Packed<E, S>);

impl<E: PackedPotential<S> + Send + Sync, S: Float + Send + Sync> CompiledBatch<S> for Potentials<E, S> {
    fn evaluate(
        &self,
        routine: BatchRoutine,
        x: &[S],
        v: &[S],
        results: &mut [&mut [S]],
    ) -> Option<Result<Flagged, BatchError>> {
        let (all, x, v) = (all(&self.0), x.as_chunks().0, v.as_chunks().0);
        match (routine, results) {
            (BatchRoutine::Value, [u]) => Some(self.0.values(all, x, u)),
            (BatchRoutine::Gradient, [u, g]) => Some(self.0.gradients(all, x, u, g)),
            (BatchRoutine::Hessian, [u, g, h]) => Some(self.0.hessian_matrices(all, x, u, g, h)),
            (BatchRoutine::HessianVector, [product]) => Some(self.0.hessian_vectors(all, x, v, product)),
            _ => None,
        }
    }
}

struct Forces<E, S>(Packed<E, S>);

impl<E: PackedForce<S> + Send + Sync, S: Float + Send + Sync> CompiledBatch<S> for Forces<E, S> {
    fn evaluate(
        &self,
        routine: BatchRoutine,
        x: &[S],
        v: &[S],
        results: &mut [&mut [S]],
    ) -> Option<Result<Flagged, BatchError>> {
        let (all, x, v) = (all(&self.0), x.as_chunks().0, v.as_chunks().0);
        match (routine, results) {
            (BatchRoutine::Force, [f]) => Some(self.0.forces(all, x, v, f)),
            (BatchRoutine::ForceJacobians, [f, by_x, by_v]) => {
                Some(self.0.force_jacobian_matrices(all, x, v, f, by_x, by_v))
            }
            _ => None,
        }
    }
}

struct Residuals<E, S>(Packed<E, S>);

impl<E: PackedResidual<S> + Send + Sync, S: Float + Send + Sync> CompiledBatch<S> for Residuals<E, S> {
    fn evaluate(
        &self,
        routine: BatchRoutine,
        x: &[S],
        _: &[S],
        results: &mut [&mut [S]],
    ) -> Option<Result<Flagged, BatchError>> {
        match (routine, results) {
            (BatchRoutine::Residual, [r]) => Some(self.0.residuals(all(&self.0), x, r)),
            (BatchRoutine::Jacobian, [r, j]) => Some(self.0.jacobians(all(&self.0), x, r, j)),
            _ => None,
        }
    }
}

fn all<E: Stored<S>, S: Float>(packed: &Packed<E, S>) -> Range<usize> {
    0..packed.len()
}
