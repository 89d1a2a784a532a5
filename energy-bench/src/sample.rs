//! Inputs and results of kernels.

use energy_dsl::{
    Array, Block, Element, Hessian, Lane, Level, PackedPotential, PackedResidual, Potential, Real, Residual,
    ResidualJacobian, Stored, Vector3,
};

/// One element, in the form that each contender reads. Numbers that depend on the rest shape alone are precomputed.
#[derive(Clone, Debug)]
pub struct Sample {
    /// Input of generated code: the element's parameters, then its unknowns.
    pub generated: Vec<f64>,
    /// Unknowns: coordinates of points, or twists.
    pub unknowns: Vec<f64>,
    /// Input of hand-derived code; see [`Subject::Hand`](crate::Subject::Hand).
    pub hand: Vec<f64>,
    /// Input of the textbook formula: constants, then unknowns.
    pub textbook: Vec<f64>,
}

/// A degenerate element and its documented result.
#[derive(Clone, Debug)]
pub struct Coincident {
    /// The element, with two or more points at the same position (K5: with no rotation).
    pub sample: Sample,
    /// The documented value, gradient and Hessian blocks (or residual and Jacobian), flattened.
    pub expected: Vec<f64>,
}

impl Sample {
    /// Creates the sample of an element at the given unknowns.
    pub(crate) fn new<E: Stored<f64>>(element: &E, unknowns: &[f64], hand: Vec<f64>, textbook: Vec<f64>) -> Self {
        let mut generated = vec![0.0; E::NUMBERS];
        element.store(&mut generated, 1);
        generated.extend_from_slice(unknowns);
        Self { generated, unknowns: unknowns.to_vec(), hand, textbook }
    }

    /// Returns the same element at other unknowns.
    pub(crate) fn with_unknowns(&self, unknowns: &[f64]) -> Self {
        assert_eq!(unknowns.len(), self.unknowns.len(), "the number of unknowns stays");
        let replace = |numbers: &[f64]| [&numbers[..numbers.len() - unknowns.len()], unknowns].concat();
        Self {
            generated: replace(&self.generated),
            unknowns: unknowns.to_vec(),
            hand: replace(&self.hand),
            textbook: replace(&self.textbook),
        }
    }
}

/// A value with its derivatives.
pub trait Answer<T>: Copy {
    /// Returns value, gradient and upper triangle of Hessian blocks (or residual and Jacobian) as one list.
    fn numbers(&self) -> Vec<T>;
}

/// Result of hand-derived code for a potential: generated results without flags.
#[derive(Clone, Copy, Debug)]
pub struct Derivatives<T, const POINTS: usize, const BLOCKS: usize> {
    /// The potential U.
    pub value: T,
    /// ∂U/∂x, by point.
    pub gradient: [Vector3<T>; POINTS],
    /// Upper triangle of the 3×3 blocks of ∂²U/∂x².
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

/// Result of hand-derived code for a residual.
#[derive(Clone, Copy, Debug)]
pub struct Row<T, const UNKNOWNS: usize> {
    /// The residual r.
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

/// Result of a generated potential over lanes.
type WideHessian<E, S, V> = Hessian<
    V,
    <<E as PackedPotential<S>>::Wide<V> as Potential<V>>::Points,
    <<E as PackedPotential<S>>::Wide<V> as Potential<V>>::Triangle,
>;

/// Loads a generated potential and its points from numbers, and evaluates its Hessian.
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

/// Result of a generated residual over lanes.
type WideJacobian<E, S, V> = ResidualJacobian<
    V,
    <<E as PackedResidual<S>>::Wide<V> as Residual<V>>::Rows,
    <<E as PackedResidual<S>>::Wide<V> as Residual<V>>::Jacobian,
>;

/// Loads a generated residual and its unknowns from numbers, and evaluates its Jacobian.
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

/// Length of [`Sample::generated`]: parameters and unknowns.
pub(crate) fn number_count<E: Stored<f64>>() -> usize {
    E::NUMBERS + <E as Element>::DECLARATION.points.iter().map(|field| field.size).sum::<usize>()
}

/// Returns unknowns as points.
pub(crate) fn points<const N: usize>(unknowns: &[f64]) -> &[Vector3<f64>; N] {
    let (points, _) = unknowns.as_chunks();
    points.try_into().expect("three numbers a point")
}
