//! The kernels of elements, in `f64` and `f32`, for every SIMD level: minutes of building.

use std::borrow::Cow;
use std::ops::Range;

use energy_dsl::{
    BatchError, Declaration, Element, Flagged, Float, Packed, PackedForce, PackedPotential, PackedResidual, Routine,
    RoutineKind, Stored,
};
use energy_elements::for_each_element;

use super::matrices::{hessian_matrices, jacobian_matrices};
use super::{Bind, CompiledBatch, Scalar};

/// Whether no routine of an element has more operations than the largest that is compiled.
const fn is_small(declaration: &Declaration, largest: usize) -> bool {
    let Cow::Borrowed(routines) = declaration.routines else { return false };
    let mut routine = 0;
    while routine < routines.len() {
        let Routine { name, reduced, .. } = routines[routine];
        // Products of Hessians and vectors are not compiled.
        let is_compiled = !matches!(name.as_bytes(), b"hessian_vector");
        if is_compiled && reduced.total() > largest {
            return false;
        }
        routine += 1;
    }
    true
}

macro_rules! table {
    ($($kind:ident $name:ident),*) => {
        &[$({
            const IS_SMALL: bool = is_small(<energy_elements::$name<f64> as Element>::DECLARATION, LARGEST);
            (stringify!($name), if IS_SMALL { Some($kind::<energy_elements::$name<_>, _> as Bind<_>) } else { None })
        }),*]
    };
}

impl Scalar for f64 {
    #[inline(never)]
    fn table() -> &'static [(&'static str, Option<Bind<Self>>)] {
        // Larger routines would double the size of the Python package; tapes take up to twice the time there.
        const LARGEST: usize = 475;
        const TABLE: &[(&str, Option<Bind<f64>>)] = for_each_element!(with kinds table);
        TABLE
    }
}

impl Scalar for f32 {
    #[inline(never)]
    fn table() -> &'static [(&'static str, Option<Bind<Self>>)] {
        // Single precision is asked for less often.
        const LARGEST: usize = 100;
        const TABLE: &[(&str, Option<Bind<f32>>)] = for_each_element!(with kinds table);
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

/// Pads an empty list: a lane needs one number.
fn padded<S: Float>(numbers: Vec<S>) -> Vec<S> {
    if numbers.is_empty() { vec![S::from_f64(0.0)] } else { numbers }
}

/// Packs elements that each have their own places.
fn packed<E: Stored<S>, S: Float>(count: usize, places: usize, element: impl Fn(usize) -> E) -> Option<Packed<E, S>> {
    u32::try_from(count * places).ok()?;
    let elements: Vec<E> = (0..count).map(element).collect();
    Some(Packed::from_fn(count, places, |i| &elements[i], |i, place| (i * places + place) as u32))
}

struct Potentials<E, S>(Packed<E, S>);

impl<E: PackedPotential<S> + Send + Sync, S: Float + Send + Sync> CompiledBatch<S> for Potentials<E, S> {
    fn evaluate(
        &self,
        routine: RoutineKind,
        x: &[S],
        _: &[S],
        results: &mut [&mut [S]],
    ) -> Option<Result<Flagged, BatchError>> {
        let (all, x) = (all(&self.0), x.as_chunks().0);
        match (routine, results) {
            (RoutineKind::Value, [u]) => Some(self.0.values(all, x, u)),
            (RoutineKind::Gradient, [u, g]) => Some(self.0.gradients(all, x, u, g)),
            (RoutineKind::Hessian, [u, g, h]) => Some(hessian_matrices(&self.0, x, u, g, h)),
            _ => None,
        }
    }
}

struct Forces<E, S>(Packed<E, S>);

impl<E: PackedForce<S> + Send + Sync, S: Float + Send + Sync> CompiledBatch<S> for Forces<E, S> {
    fn evaluate(
        &self,
        routine: RoutineKind,
        x: &[S],
        v: &[S],
        results: &mut [&mut [S]],
    ) -> Option<Result<Flagged, BatchError>> {
        let (all, x, v) = (all(&self.0), x.as_chunks().0, v.as_chunks().0);
        match (routine, results) {
            (RoutineKind::Force, [f]) => Some(self.0.forces(all, x, v, f)),
            (RoutineKind::Jacobians, [f, by_x, by_v]) => Some(jacobian_matrices(&self.0, x, v, f, [by_x, by_v])),
            _ => None,
        }
    }
}

struct Residuals<E, S>(Packed<E, S>);

impl<E: PackedResidual<S> + Send + Sync, S: Float + Send + Sync> CompiledBatch<S> for Residuals<E, S> {
    fn evaluate(
        &self,
        routine: RoutineKind,
        x: &[S],
        _: &[S],
        results: &mut [&mut [S]],
    ) -> Option<Result<Flagged, BatchError>> {
        match (routine, results) {
            (RoutineKind::Residual, [r]) => Some(self.0.residuals(all(&self.0), x, r)),
            (RoutineKind::Jacobian, [r, j]) => Some(self.0.jacobians(all(&self.0), x, r, j)),
            _ => None,
        }
    }
}

fn all<E: Stored<S>, S: Float>(packed: &Packed<E, S>) -> Range<usize> {
    0..packed.len()
}
