//! Inputs and results of kernels.

use energy_dsl::{
    Array, Block, Element, Hessian, Lane, Level, PackedPotential, PackedResidual, Potential, Real, Residual,
    ResidualJacobian, Stored, Vector3,
};

/// One element in the form each contender reads. What a rest shape determines is computed beforehand for all of them.
#[derive(Clone, Debug)]
pub struct Sample {
    /// For the library: the element's own numbers, then its unknowns.
    pub library: Vec<f64>,
    /// The unknowns alone.
    pub unknowns: Vec<f64>,
    /// For hand-derived code; see [`Subject::Hand`](crate::Subject::Hand).
    pub hand: Vec<f64>,
    /// For the textbook formula, which dual numbers and computer algebra differentiate.
    pub textbook: Vec<f64>,
}

impl Sample {
    /// From an element and what it is evaluated on.
    pub(crate) fn new<E: Stored<f64>>(element: &E, unknowns: &[f64], hand: Vec<f64>, textbook: Vec<f64>) -> Self {
        let mut library = vec![0.0; E::NUMBERS];
        element.store(&mut library, 1);
        library.extend_from_slice(unknowns);
        Self { library, unknowns: unknowns.to_vec(), hand, textbook }
    }
}

/// A result with derivatives.
pub trait Answer<T>: Copy {
    /// Value, gradient and triangle of Hessian blocks (or residual and Jacobian), one after the other.
    fn numbers(&self) -> Vec<T>;
}

/// The result of hand-derived code: what the library returns, without flags.
#[derive(Clone, Copy, Debug)]
pub struct Derivatives<T, const POINTS: usize, const BLOCKS: usize> {
    /// U.
    pub value: T,
    /// ∂U/∂x.
    pub gradient: [Vector3<T>; POINTS],
    /// The triangle of ∂²U/∂x².
    pub hessian: [Block<T>; BLOCKS],
}

impl<T: Copy, const POINTS: usize, const BLOCKS: usize> Answer<T> for Derivatives<T, POINTS, BLOCKS> {
    fn numbers(&self) -> Vec<T> {
        let blocks = self.hessian.as_flattened().as_flattened();
        [&[self.value], self.gradient.as_flattened(), blocks].concat()
    }
}

impl<T: Real, Points: Array<Vector3<T>>, Triangle: Array<Block<T>>> Answer<T> for Hessian<T, Points, Triangle> {
    fn numbers(&self) -> Vec<T> {
        let blocks = self.hessian.as_ref().as_flattened().as_flattened();
        [&[self.value], self.gradient.as_ref().as_flattened(), blocks].concat()
    }
}

/// The result of hand-derived code for a residual.
#[derive(Clone, Copy, Debug)]
pub struct Row<T, const UNKNOWNS: usize> {
    /// r.
    pub value: T,
    /// ∂r/∂u.
    pub jacobian: [T; UNKNOWNS],
}

impl<T: Copy, const UNKNOWNS: usize> Answer<T> for Row<T, UNKNOWNS> {
    fn numbers(&self) -> Vec<T> {
        [&[self.value], self.jacobian.as_slice()].concat()
    }
}

impl<T: Real, Rows: Array<T>, Jacobian: Array<T>> Answer<T> for ResidualJacobian<T, Rows, Jacobian> {
    fn numbers(&self) -> Vec<T> {
        [self.value.as_ref(), self.jacobian.as_ref()].concat()
    }
}

/// What a potential over lanes returns.
type WideHessian<E, S, V> = Hessian<
    V,
    <<E as PackedPotential<S>>::Wide<V> as Potential<V>>::Points,
    <<E as PackedPotential<S>>::Wide<V> as Potential<V>>::Triangle,
>;

/// A potential of the library, read from numbers.
#[inline(always)]
pub(crate) fn potential<S: Real, E: PackedPotential<S>, V: Lane<S>, L: Level>(
    numbers: &[S],
    stride: usize,
) -> WideHessian<E, S, V> {
    let zero = V::splat(S::from_f64(0.0));
    let element = E::load::<V>(numbers, stride);
    let mut points = <<E::Wide<V> as Potential<V>>::Points as Array<Vector3<V>>>::repeat([zero; 3]);
    for (i, number) in points.as_mut().as_flattened_mut().iter_mut().enumerate() {
        *number = V::load(&numbers[(E::NUMBERS + i) * stride..]);
    }
    element.hessian_at::<L>(&points)
}

/// What a residual over lanes returns.
type WideJacobian<E, S, V> = ResidualJacobian<
    V,
    <<E as PackedResidual<S>>::Wide<V> as Residual<V>>::Rows,
    <<E as PackedResidual<S>>::Wide<V> as Residual<V>>::Jacobian,
>;

/// A residual of the library, read from numbers.
#[inline(always)]
pub(crate) fn residual<S: Real, E: PackedResidual<S>, V: Lane<S>, L: Level>(
    numbers: &[S],
    stride: usize,
) -> WideJacobian<E, S, V> {
    let zero = V::splat(S::from_f64(0.0));
    let element = E::load::<V>(numbers, stride);
    let mut unknowns = <<E::Wide<V> as Residual<V>>::Unknowns as Array<V>>::repeat(zero);
    for (i, number) in unknowns.as_mut().iter_mut().enumerate() {
        *number = V::load(&numbers[(E::NUMBERS + i) * stride..]);
    }
    element.jacobian_at::<L>(&unknowns)
}

/// The numbers of an element and of its unknowns.
pub(crate) fn number_count<E: Stored<f64>>() -> usize {
    E::NUMBERS + <E as Element>::DECLARATION.points.iter().map(|field| field.size).sum::<usize>()
}

/// The points that unknowns are the coordinates of, where they are.
pub(crate) fn points<const N: usize>(unknowns: &[f64]) -> &[Vector3<f64>; N] {
    let (points, _) = unknowns.as_chunks();
    points.try_into().expect("three numbers a point")
}
