//! Second derivatives as full matrices, row by row: the layout of NumPy, of LAPACK in row order, and of tapes.

use std::ops::Range;

use super::error::{BatchError, Flagged, check_output, note_flags};
use super::packed::{BLOCK, Packed, PackedForce, PackedPotential, WidePoints};
use super::potentials::{Batch, BatchWork, Batches, points_of, store_rows};
use crate::array::Array;
use crate::element::{Block, ForceLaw, Potential, Vector3, triangle_index};
use crate::numbers::{Float, Kernel, Lane, Level, Number, dispatch};

impl<S: Float, E: PackedPotential<S>> Packed<E, S> {
    /// Writes U, ∂U/∂x (3 N numbers) and ∂²U/∂x² (3 N × 3 N numbers, row by row) of each element of a range, which
    /// starts at a multiple of [`BLOCK`]. [`Packed::hessians`] writes half as much: one triangle.
    ///
    /// # Errors
    /// When range, points and outputs do not fit each other.
    pub fn hessian_matrices(
        &self,
        range: Range<usize>,
        x: &[Vector3<S>],
        energies: &mut [S],
        gradients: &mut [S],
        matrices: &mut [S],
    ) -> Result<Flagged, BatchError> {
        let points = points_of::<S, E>();
        self.check(&range, points, x.len())?;
        check_output("energies", energies.len(), range.len(), 1)?;
        check_output("gradients", gradients.len(), range.len(), 3 * points)?;
        check_output("Hessians", matrices.len(), range.len(), 9 * points * points)?;
        let mut work = HessianMatrices { energies, gradients, matrices, flagged: Vec::new() };
        dispatch(Batches { elements: self, range, positions: x, work: &mut work });
        Ok(work.flagged)
    }

    /// Writes (∂²U/∂x²) v, 3 N numbers, of each element of a range, which starts at a multiple of [`BLOCK`]. Stencils
    /// index `v` like `x`.
    ///
    /// # Errors
    /// When range, points, vectors and outputs do not fit each other.
    pub fn hessian_vectors(
        &self,
        range: Range<usize>,
        x: &[Vector3<S>],
        v: &[Vector3<S>],
        products: &mut [S],
    ) -> Result<Flagged, BatchError> {
        let points = points_of::<S, E>();
        self.check(&range, points, x.len().min(v.len()))?;
        check_output("products", products.len(), range.len(), 3 * points)?;
        let mut work = HessianVectors { v, products, flagged: Vec::new() };
        dispatch(Batches { elements: self, range, positions: x, work: &mut work });
        Ok(work.flagged)
    }
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
        let (place, count, points) = (batch.place, batch.count, points_of::<S, E>());
        let result = batch.element.hessian_at::<L>(batch.points);
        result.value.store_ragged(&mut self.energies[place..][..count]);
        store_rows(result.gradient.as_ref().as_flattened(), place, count, self.gradients);
        let triangle: &[Block<S::Lanes<L>>] = result.hessian.as_ref();
        let mut numbers = WidePoints::<E, S::Lanes<L>, S>::repeat([S::Lanes::<L>::from_f64(0.0); 3]);
        for i in 0..points {
            for row in 0..3 {
                for (j, number) in numbers.as_mut().iter_mut().enumerate() {
                    *number = if i <= j {
                        triangle[triangle_index(points, i, j)][row]
                    } else {
                        let block = &triangle[triangle_index(points, j, i)];
                        [block[0][row], block[1][row], block[2][row]]
                    };
                }
                store_row(numbers.as_ref(), 3 * i + row, place, count, self.matrices);
            }
        }
        if result.flags.any() {
            note_flags(&mut self.flagged, batch.first, count, result.flags.degenerate, result.flags.kink);
        }
    }
}

/// Writes row `row` of the square matrices of `count` elements, one element per lane, from matrix `place` on.
#[inline(always)]
fn store_row<S: Float, V: Lane<S>>(numbers: &[[V; 3]], row: usize, place: usize, count: usize, out: &mut [S]) {
    let width = 3 * numbers.len();
    V::store_transposed(numbers.as_flattened(), count, &mut out[(place * width + row) * width..], width * width);
}

struct HessianVectors<'a, S> {
    v: &'a [Vector3<S>],
    products: &'a mut [S],
    flagged: Flagged,
}

impl<S: Float, E: PackedPotential<S>> BatchWork<E, S> for HessianVectors<'_, S> {
    #[inline(always)]
    fn batch<L: Level>(&mut self, batch: Batch<'_, E, S::Lanes<L>, S>) {
        let mut v = WidePoints::<E, S::Lanes<L>, S>::repeat([S::Lanes::<L>::from_f64(0.0); 3]);
        for (point, wide) in v.as_mut().iter_mut().enumerate() {
            *wide = S::Lanes::<L>::gather(self.v, batch.vertices(point));
        }
        let result = batch.element.hessian_vector_at::<L>(batch.points, &v);
        store_rows(result.product.as_ref().as_flattened(), batch.place, batch.count, self.products);
        if result.flags.any() {
            note_flags(&mut self.flagged, batch.first, batch.count, result.flags.degenerate, result.flags.kink);
        }
    }
}

impl<S: Float, E: PackedForce<S>> Packed<E, S> {
    /// Writes f(x, v) (3 N numbers), ∂f/∂x and ∂f/∂v (3 N × 3 N numbers each, row by row) of each element of a range,
    /// which starts at a multiple of [`BLOCK`]. [`Packed::force_jacobians`] writes 3×3 blocks.
    ///
    /// # Errors
    /// When range, points, velocities and outputs do not fit each other.
    pub fn force_jacobian_matrices(
        &self,
        range: Range<usize>,
        x: &[Vector3<S>],
        v: &[Vector3<S>],
        forces: &mut [S],
        by_position: &mut [S],
        by_velocity: &mut [S],
    ) -> Result<Flagged, BatchError> {
        let points = <<E as ForceLaw<S>>::Points as Array<Vector3<S>>>::LEN;
        self.check(&range, points, x.len().min(v.len()))?;
        check_output("forces", forces.len(), range.len(), 3 * points)?;
        check_output("Jacobians by position", by_position.len(), range.len(), 9 * points * points)?;
        check_output("Jacobians by velocity", by_velocity.len(), range.len(), 9 * points * points)?;
        Ok(dispatch(ForceMatrices { packed: self, range, x, v, forces, jacobians: [by_position, by_velocity] }))
    }
}

/// Points of an element per lane.
type WideForcePoints<E, V, S> = <<E as PackedForce<S>>::Wide<V> as ForceLaw<V>>::Points;

struct ForceMatrices<'a, E, S> {
    packed: &'a Packed<E, S>,
    range: Range<usize>,
    x: &'a [Vector3<S>],
    v: &'a [Vector3<S>],
    forces: &'a mut [S],
    /// By position, by velocity.
    jacobians: [&'a mut [S]; 2],
}

impl<S: Float, E: PackedForce<S>> Kernel for ForceMatrices<'_, E, S> {
    type Output = Flagged;

    #[inline(always)]
    fn run<L: Level>(self) -> Flagged {
        let Self { packed, range, x, v, forces, mut jacobians } = self;
        let (lanes, mut flagged) = (<S::Lanes<L> as Lane<S>>::LANES, Vec::new());
        for first in range.clone().step_by(lanes) {
            let (block, offset, count) = (first / BLOCK, first % BLOCK, lanes.min(range.end - first));
            let element = E::load::<S::Lanes<L>>(packed.numbers_from(block, offset), BLOCK);
            let x: WideForcePoints<E, S::Lanes<L>, S> = packed.gather(block, offset, x);
            let v: WideForcePoints<E, S::Lanes<L>, S> = packed.gather(block, offset, v);
            let result = element.jacobians_at::<L>(&x, &v);
            let place = first - range.start;
            store_rows(result.force.as_ref().as_flattened(), place, count, forces);
            let mut numbers: WideForcePoints<E, S::Lanes<L>, S> = Array::repeat([S::Lanes::<L>::from_f64(0.0); 3]);
            let points = numbers.as_ref().len();
            let squares: [&[Block<S::Lanes<L>>]; 2] = [result.by_position.as_ref(), result.by_velocity.as_ref()];
            for (square, out) in squares.into_iter().zip(&mut jacobians) {
                for i in 0..points {
                    for row in 0..3 {
                        let blocks = &square[points * i..][..points];
                        numbers.as_mut().iter_mut().zip(blocks).for_each(|(number, block)| *number = block[row]);
                        store_row(numbers.as_ref(), 3 * i + row, place, count, out);
                    }
                }
            }
            if result.flags.any() {
                note_flags(&mut flagged, first, count, result.flags.degenerate, result.flags.kink);
            }
        }
        flagged
    }
}
