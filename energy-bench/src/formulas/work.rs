//! How declared formulas run, with results in memory.

use std::hint::black_box;
use std::marker::PhantomData;

use energy_dsl::{
    Aligned, Array, BLOCK, Block, Kernel, Lane, Level, Packed, PackedPotential, Potential, dispatch, level,
};

use super::{Contender, Program};
use crate::sample::potential;
use crate::work::{Doubles, Work};

/// Coordinates of an element.
const fn coordinates<E: Potential<f64>>() -> usize {
    3 * <E::Points as Array<_>>::LEN
}

/// Numbers of an element: parameters and coordinates.
const fn inputs<E: PackedPotential<f64>>() -> usize {
    E::NUMBERS + coordinates::<E>()
}

/// Numbers of a result: value, gradient and triangle of Hessian blocks.
const fn results<E: Potential<f64>>() -> usize {
    1 + coordinates::<E>() + 9 * <E::Triangle as Array<Block<f64>>>::LEN
}

/// Returns value, gradient and triangle of Hessian blocks of each element, as [`Program::Batches`] computes them.
pub(super) fn expected<E: PackedPotential<f64, Wide<f64> = E>>(numbers: &[f64]) -> Vec<f64> {
    let rows: Vec<&[f64]> = numbers.chunks_exact(inputs::<E>()).collect();
    let mut batches = Batches::<E>::new(&rows);
    batches.evaluate();
    let gradients = batches.gradients.chunks_exact(coordinates::<E>());
    let triangles = batches.triangles.chunks_exact(results::<E>() - 1 - coordinates::<E>());
    let all = batches.values.iter().zip(gradients.zip(triangles));
    all.flat_map(|(value, (gradient, triangle))| [&[*value], gradient, triangle].concat()).collect()
}

/// Returns the ways to evaluate `count` elements, a multiple of 16, which repeat those of `numbers`.
pub(super) fn contenders<E>(numbers: &[f64], count: usize) -> Vec<Contender>
where
    E: PackedPotential<f64, Wide<f64> = E> + 'static,
{
    let rows: Vec<&[f64]> = numbers.chunks_exact(inputs::<E>()).cycle().take(count).collect();
    let mut batches = Batches::<E>::new(&rows);
    vec![
        (Program::Lanes, lanes::<E>(&rows)),
        (Program::Batches, Box::new(move || batches.evaluate())),
        (Program::Memory, memory(inputs::<E>() * count, results::<E>() * count)),
    ]
}

/// Value, gradient and Hessian, element by element.
struct Batches<E> {
    packed: Packed<E>,
    positions: Vec<[f64; 3]>,
    values: Vec<f64>,
    gradients: Vec<f64>,
    triangles: Vec<f64>,
}

impl<E: PackedPotential<f64, Wide<f64> = E>> Batches<E> {
    fn new(rows: &[&[f64]]) -> Self {
        let (count, coordinates) = (rows.len(), coordinates::<E>());
        let points = coordinates / 3;
        let elements: Vec<E> = rows.iter().map(|row| E::load::<f64>(row, 1)).collect();
        let vertex = |element: usize, point: usize| u32::try_from(points * element + point).expect("few vertices");
        Self {
            packed: Packed::from_fn(count, points, |element| &elements[element], vertex),
            positions: rows.iter().flat_map(|row| row[E::NUMBERS..].as_chunks().0).copied().collect(),
            values: vec![0.0; count],
            gradients: vec![0.0; coordinates * count],
            triangles: vec![0.0; (results::<E>() - 1 - coordinates) * count],
        }
    }

    fn evaluate(&mut self) {
        let Self { packed, positions, values, gradients, triangles } = self;
        let flagged = packed.hessians(0..packed.len(), positions, values, gradients, triangles);
        black_box(flagged.expect("inputs and results fit each other"));
    }
}

/// The same with the numbers of as many elements interleaved as the best level has lanes, in inputs and results.
fn lanes<E: PackedPotential<f64> + 'static>(rows: &[&[f64]]) -> Work {
    let width = crate::work::lanes::<Doubles>(level()).expect("the level is available");
    let mut numbers = Aligned::new(rows.len() * inputs::<E>(), 0.0);
    for (rows, block) in rows.chunks_exact(width).zip(numbers.chunks_exact_mut(inputs::<E>() * width)) {
        for (i, places) in block.chunks_exact_mut(width).enumerate() {
            places.iter_mut().zip(rows).for_each(|(place, row)| *place = row[i]);
        }
    }
    let mut found = Aligned::new(rows.len() * results::<E>(), 0.0);
    Box::new(move || {
        dispatch(Lanes::<E> { numbers: &numbers, results: &mut found, of: PhantomData });
        black_box(&mut found);
    })
}

struct Lanes<'a, E> {
    numbers: &'a [f64],
    results: &'a mut [f64],
    of: PhantomData<E>,
}

impl<E: PackedPotential<f64>> Kernel for Lanes<'_, E> {
    type Output = ();

    #[inline(always)]
    fn run<L: Level>(self) {
        let lanes = <L::F64 as Lane<f64>>::LANES;
        let blocks = self.numbers.chunks_exact(inputs::<E>() * lanes);
        for (numbers, results) in blocks.zip(self.results.chunks_exact_mut(results::<E>() * lanes)) {
            let found = potential::<f64, E, L::F64, L>(numbers, lanes);
            let (value, results) = results.split_at_mut(lanes);
            let (gradient, triangle) = results.split_at_mut(coordinates::<E>() * lanes);
            found.value.store(value);
            for (number, places) in found.gradient.as_ref().as_flattened().iter().zip(gradient.chunks_exact_mut(lanes))
            {
                number.store(places);
            }
            let numbers = found.hessian.as_ref().as_flattened().as_flattened();
            for (number, places) in numbers.iter().zip(triangle.chunks_exact_mut(lanes)) {
                number.store(places);
            }
        }
    }
}

/// Reads as many numbers as the inputs, and clears as many as the results: the least that memory costs.
fn memory(inputs: usize, results: usize) -> Work {
    let numbers = vec![1.0f64; inputs];
    let mut found = vec![0.0f64; results];
    Box::new(move || {
        let sums = numbers.as_chunks::<BLOCK>().0.iter().fold([0.0; BLOCK], |mut sums, block| {
            sums.iter_mut().zip(block).for_each(|(sum, number)| *sum += number);
            sums
        });
        found.fill(0.0);
        black_box((sums, &mut found));
    })
}
