//! Second derivatives as full matrices, row by row: the layout of NumPy and of tapes.

use std::hint::black_box;

use energy_dsl::{
    Array, BLOCK, Batch, BatchError, BatchWork, Block, Flagged, Flags, Float, Lane, Level, Mask, Number, Packed,
    PackedForce, PackedPotential, Potential, Real, Vector3, WidePoints, for_each_batch, triangle_index,
};

/// Writes U, ∂U/∂x (3 N numbers) and ∂²U/∂x² (3 N × 3 N numbers, row by row) of each element.
pub fn hessian_matrices<S: Float, E: PackedPotential<S>>(
    packed: &Packed<E, S>,
    x: &[Vector3<S>],
    energies: &mut [S],
    gradients: &mut [S],
    matrices: &mut [S],
) -> Result<Flagged, BatchError> {
    let width = 3 * E::DECLARATION.points.len();
    check_input("coordinates", 3 * x.len(), packed.len() * width)?;
    check_output("energies", energies.len(), packed.len())?;
    check_output("gradients", gradients.len(), packed.len() * width)?;
    check_output("Hessians", matrices.len(), packed.len() * width * width)?;
    let mut work = HessianMatrices { energies, gradients, matrices, flagged: Vec::new() };
    for_each_batch(packed, x, &mut work);
    Ok(work.flagged)
}

fn check_input(of: &'static str, given: usize, needed: usize) -> Result<(), BatchError> {
    if given == needed { Ok(()) } else { Err(BatchError::Input { of, needed, given }) }
}

fn check_output(of: &'static str, given: usize, needed: usize) -> Result<(), BatchError> {
    if given == needed { Ok(()) } else { Err(BatchError::Output { of, needed, given }) }
}

struct HessianMatrices<'a, S> {
    energies: &'a mut [S],
    gradients: &'a mut [S],
    matrices: &'a mut [S],
    flagged: Flagged,
}

impl<S: Float, E: PackedPotential<S>> BatchWork<E, S> for HessianMatrices<'_, S> {
    #[inline(always)]
    fn batch<L: Level>(&mut self, batch: Batch<'_, E, S::Lanes<L>, S>) {
        let (place, count) = (batch.place, batch.count);
        let result = batch.element.hessian_at::<L>(batch.points);
        result.value.store_ragged(&mut self.energies[place..][..count]);
        store(result.gradient.as_ref(), place, count, self.gradients);
        let triangle: &[Block<S::Lanes<L>>] = result.hessian.as_ref();
        let mut numbers = WidePoints::<E, S::Lanes<L>, S>::repeat([S::Lanes::<L>::from_f64(0.0); 3]);
        let points = numbers.as_ref().len();
        let width = 3 * points;
        // With a known bound the rows would be unrolled, each with its own transpose: ten times the code of the kernel.
        for row in 0..black_box(width) {
            let (i, component) = (row / 3, row % 3);
            for (j, number) in numbers.as_mut().iter_mut().enumerate() {
                let block = &triangle[triangle_index(points, i.min(j), i.max(j))];
                let transposed = [block[0][component], block[1][component], block[2][component]];
                *number = if i <= j { block[component] } else { transposed };
            }
            let out = &mut self.matrices[(place * width + row) * width..];
            S::Lanes::<L>::store_transposed(numbers.as_ref().as_flattened(), count, out, width * width);
        }
        note_flags(&mut self.flagged, batch.first, count, result.flags);
    }
}

/// Writes the vectors of `count` elements, one element per lane, from element `place` on.
#[inline(always)]
fn store<S: Float, V: Lane<S>>(numbers: &[[V; 3]], place: usize, count: usize, out: &mut [S]) {
    let width = 3 * numbers.len();
    V::store_transposed(numbers.as_flattened(), count, &mut out[place * width..], width);
}

#[inline(always)]
fn note_flags<V: Real>(flagged: &mut Flagged, first: usize, count: usize, flags: Flags<V>) {
    if flags.any() {
        add_flags(flagged, first, count, flags.degenerate, flags.kink);
    }
}

/// Adds the flags of a batch. Flags are rare, so this is not inlined.
#[cold]
#[inline(never)]
fn add_flags<M: Mask>(flagged: &mut Flagged, first: usize, count: usize, degenerate: M, kink: M) {
    let flags = (0..count).map(|lane| Flags { degenerate: degenerate.lane(lane), kink: kink.lane(lane) });
    flagged.extend((first..).zip(flags).filter(|(_, flags)| flags.any()));
}

/// Elements whose blocks are rearranged together. They stay in the cache.
const TOGETHER: usize = 2 * BLOCK;

/// Writes f(x, v) (3 N numbers), ∂f/∂x and ∂f/∂v (3 N × 3 N numbers each, row by row) of each element.
pub fn jacobian_matrices<S: Float, E: PackedForce<S>>(
    packed: &Packed<E, S>,
    x: &[Vector3<S>],
    v: &[Vector3<S>],
    forces: &mut [S],
    mut jacobians: [&mut [S]; 2],
) -> Result<Flagged, BatchError> {
    let points = E::DECLARATION.points.len();
    let (width, size) = (3 * points, 9 * points * points);
    check_output("forces", forces.len(), packed.len() * width)?;
    for of in &jacobians {
        check_output("Jacobians", of.len(), packed.len() * size)?;
    }
    let mut blocks = [(); 2].map(|()| vec![S::from_f64(0.0); TOGETHER * size]);
    let mut flagged = Vec::new();
    for first in (0..packed.len()).step_by(TOGETHER) {
        let range = first..packed.len().min(first + TOGETHER);
        let [by_position, by_velocity] = blocks.each_mut().map(|blocks| &mut blocks[..range.len() * size]);
        let forces = &mut forces[first * width..range.end * width];
        flagged.extend(packed.force_jacobians(range.clone(), x, v, forces, by_position, by_velocity)?);
        for (blocks, out) in blocks.iter().zip(&mut jacobians) {
            let matrices = &mut out[first * size..range.end * size];
            for (blocks, matrix) in blocks.chunks_exact(size).zip(matrices.chunks_exact_mut(size)) {
                rearrange(blocks, matrix, points);
            }
        }
    }
    Ok(flagged)
}

/// Turns a square of 3×3 blocks, block by block, into a matrix, row by row.
fn rearrange<S: Float>(blocks: &[S], matrix: &mut [S], points: usize) {
    for (index, block) in blocks.as_chunks::<9>().0.iter().enumerate() {
        let (i, j) = (index / points, index % points);
        for (row, numbers) in block.as_chunks::<3>().0.iter().enumerate() {
            matrix[(3 * i + row) * 3 * points + 3 * j..][..3].clone_from_slice(numbers);
        }
    }
}
