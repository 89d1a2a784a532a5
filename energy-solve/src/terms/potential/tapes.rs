//! Elements that were read at run time.

use std::ops::Range;
use std::sync::Arc;

use energy_dsl::tape::{BlockResults, Expander, Places, Results, Slot, TAPE_BLOCK, TapeElements, stencil_blocks};
use energy_dsl::{Declaration, Kernel, Lane, Level, RoutineKind, Vector3, dispatch};

use super::evaluated::Evaluated;
use super::work::{Expanded, Gradients, Hessians, Values, difference_vectors};
use crate::terms::active::Active;
use crate::terms::curvature::Projection;
use crate::terms::scatter::Lanes;
use crate::terms::stencils::Stencils;

/// Elements as tapes, with their vertices.
#[derive(Debug)]
pub(super) struct TapePacks {
    declaration: Arc<Declaration>,
    elements: TapeElements,
    /// Indexed by block, point, element.
    stencils: Vec<u32>,
    /// The indices of the reduced results.
    identity: Vec<u16>,
}

impl TapePacks {
    /// Packs elements; point p of element i is `vertex(i, p)`.
    pub(super) fn new(
        declaration: Arc<Declaration>,
        elements: TapeElements,
        vertex: impl Fn(usize, usize) -> u32,
    ) -> Self {
        let stencils = stencil_blocks(elements.len(), declaration.points.len(), vertex);
        let reduced =
            elements.routines().find(RoutineKind::ReducedHessian).map_or(0, |r| r.groups.iter().map(Vec::len).sum());
        Self { declaration, elements, stencils, identity: (0..=u16::MAX).take(reduced).collect() }
    }

    /// Packs the active ones of all elements, whose vertices are `stencils`.
    pub(super) fn of_active(
        declaration: &Arc<Declaration>,
        elements: TapeElements,
        stencils: Stencils<'_>,
        active: &Active,
    ) -> Self {
        let vertex = |number: usize, point: usize| stencils.vertex(active.element(number), point);
        let elements = if active.is_all() { elements } else { elements.selected(&active.iter().collect::<Vec<_>>()) };
        Self::new(Arc::clone(declaration), elements, vertex)
    }

    /// Calls `work` with the results of a routine and the vertices of each block.
    fn for_each_block(
        &self,
        routine: RoutineKind,
        packs: &[Range<usize>],
        x: &[Vector3<f64>],
        work: &mut impl FnMut(BlockResults<'_, f64>, &[u32]),
    ) {
        let places = Places::Gathered { vectors: x, stencils: &self.stencils };
        let per_block = self.declaration.points.len() * TAPE_BLOCK;
        self.elements.for_each_block(routine, packs, places, None, &mut |block| {
            let stencils = &self.stencils[block.first / TAPE_BLOCK * per_block..][..per_block];
            work(block, stencils);
        });
    }
}

impl Evaluated for TapePacks {
    const PACK: usize = TAPE_BLOCK;

    fn declaration(&self) -> &Declaration {
        &self.declaration
    }

    fn stencils(&self) -> &[u32] {
        &self.stencils
    }

    fn selected(&self, indices: &[usize]) -> Self {
        let points = self.declaration.points.len();
        let vertex = |number: usize, point: usize| {
            let element = indices[number];
            self.stencils[(element / TAPE_BLOCK * points + point) * TAPE_BLOCK + element % TAPE_BLOCK]
        };
        Self::new(Arc::clone(&self.declaration), self.elements.selected(indices), vertex)
    }

    fn values(&self, packs: &[Range<usize>], x: &[Vector3<f64>], work: &mut Values<'_>) {
        self.for_each_block(RoutineKind::Value, packs, x, &mut |block, stencils| {
            dispatch(AddValues { block, stencils, work: &mut *work });
        });
    }

    fn gradients(&self, packs: &[Range<usize>], x: &[Vector3<f64>], work: &mut Gradients<'_>) {
        self.for_each_block(RoutineKind::Gradient, packs, x, &mut |block, stencils| {
            dispatch(AddGradients { block, stencils, work: &mut *work });
        });
    }

    fn hessians(&self, packs: &[Range<usize>], x: &[Vector3<f64>], work: &mut Hessians<'_, '_>) {
        let mut expander = Expander::new(&self.elements).expect("an energy has an expansion");
        // All results, and two difference vectors.
        let mut reduced: Vec<Slot<f64>> = vec![[0.0; TAPE_BLOCK]; self.identity.len() + 6];
        self.for_each_block(RoutineKind::ReducedHessian, packs, x, &mut |block, stencils| {
            let BlockResults { first, count, results, flags } = block;
            let mut projected = [0; TAPE_BLOCK];
            let results = if let Some(projection) = work.projection(&self.declaration) {
                for (number, slot) in reduced.iter_mut().enumerate().take(results.len()) {
                    *slot = *results.number(number);
                }
                let block = (first, count);
                let (declaration, reduced, projected) = (&*self.declaration, &mut reduced[..], &mut projected);
                dispatch(Project { declaration, projection, block, stencils, reduced, x, projected, work });
                Results::new(&reduced[..], &self.identity)
            } else {
                results
            };
            let results = expander.expand(count, results);
            let block = BlockResults { first, count, results, flags };
            dispatch(AddHessians { block, stencils, projected: &projected, work });
        });
        expander.finish();
    }

    fn each_gradient(&self, x: &[Vector3<f64>], each: &mut dyn FnMut(usize, f64, &[f64])) {
        let all = 0..self.elements.len();
        self.for_each_block(RoutineKind::Gradient, std::slice::from_ref(&all), x, &mut |block, _| {
            for element in 0..block.count {
                let number = |result: usize| block.results.number(result)[element];
                let gradient: Vec<f64> = (1..block.results.len()).map(number).collect();
                each(block.first + element, number(0), &gradient);
            }
        });
    }
}

/// Returns the elements of a block from one on, one per lane.
#[inline(always)]
fn lanes<L: Level>(first: usize, count: usize, at: usize, stencils: &[u32]) -> Lanes<'_> {
    let count = <L::F64 as Lane<f64>>::LANES.min(count - at);
    Lanes { first: first + at, count, stencils: &stencils[at..], stride: TAPE_BLOCK }
}

/// Returns the flagged lanes from one element on.
#[inline(always)]
fn flagged(flags: [u64; 2], lanes: &Lanes<'_>, at: usize) -> u32 {
    ((flags[0] | flags[1]) >> at) as u32 & (u32::MAX >> (32 - lanes.count))
}

/// Reads vectors from consecutive results.
#[inline(always)]
fn read<L: Level>(results: Results<'_, f64>, first: usize, at: usize, vectors: &mut [Vector3<L::F64>]) {
    for (number, entry) in vectors.as_flattened_mut().iter_mut().enumerate() {
        *entry = L::F64::load(&results.number(first + number)[at..]);
    }
}

struct AddValues<'a, 'w> {
    block: BlockResults<'a, f64>,
    stencils: &'a [u32],
    work: &'a mut Values<'w>,
}

impl Kernel for AddValues<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Level>(self) {
        let BlockResults { first, count, results, flags } = self.block;
        let mut at = 0;
        while at < count {
            let lanes = lanes::<L>(first, count, at, self.stencils);
            self.work.add(&lanes, L::F64::load(&results.number(0)[at..]), flagged(flags, &lanes, at));
            at += <L::F64 as Lane<f64>>::LANES;
        }
    }
}

struct AddGradients<'a, 'w> {
    block: BlockResults<'a, f64>,
    stencils: &'a [u32],
    work: &'a mut Gradients<'w>,
}

impl Kernel for AddGradients<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Level>(self) {
        let BlockResults { first, count, results, flags } = self.block;
        let mut gradient = vec![[L::F64::splat(0.0); 3]; self.stencils.len() / TAPE_BLOCK];
        let mut at = 0;
        while at < count {
            let lanes = lanes::<L>(first, count, at, self.stencils);
            read::<L>(results, 1, at, &mut gradient);
            let value = L::F64::load(&results.number(0)[at..]);
            self.work.add(&lanes, value, &gradient, flagged(flags, &lanes, at));
            at += <L::F64 as Lane<f64>>::LANES;
        }
    }
}

/// Makes the reduced Hessians of a block positive semi-definite.
struct Project<'a, 'w, 'b> {
    declaration: &'a Declaration,
    projection: Projection<'w>,
    /// Index of the first element, and number of elements.
    block: (usize, usize),
    stencils: &'a [u32],
    /// Results, and room for two difference vectors.
    reduced: &'a mut [Slot<f64>],
    x: &'a [Vector3<f64>],
    /// Bits of the changed lanes, by the first element of the lanes.
    projected: &'a mut [u32; TAPE_BLOCK],
    work: &'a mut Hessians<'w, 'b>,
}

impl Kernel for Project<'_, '_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Level>(self) {
        let Self { declaration, projection, block: (first, count), stencils, reduced, x, projected, work } = self;
        let n = declaration.reduced_coordinates;
        let (value_and_gradient, numbers) = reduced.split_at_mut(1 + n);
        let entries = numbers.len() - 6;
        let mut gradient = vec![L::F64::splat(0.0); n];
        let mut hessian = vec![L::F64::splat(0.0); entries];
        let mut points = vec![[L::F64::splat(0.0); 3]; declaration.points.len()];
        let per_batch = <L::F64 as Lane<f64>>::LANES;
        let mut open = Vec::new();
        for at in (0..count).step_by(per_batch) {
            let lanes = lanes::<L>(first, count, at, stencils);
            let slots = value_and_gradient[1..].iter().chain(&numbers[..entries]);
            for (number, slot) in gradient.iter_mut().chain(&mut hessian).zip(slots) {
                *number = L::F64::load(&slot[at..]);
            }
            for point in 0..points.len() {
                points[point] = L::F64::gather(x, lanes.all_vertices(point));
            }
            let derivatives = (&gradient[..], &mut hessian[..]);
            let examined = work.examine::<L>(declaration, &lanes, derivatives, n, &points);
            projected[at] = examined.changed;
            if examined.changed != 0 {
                for (number, slot) in hessian.iter().zip(&mut numbers[..entries]) {
                    number.store(&mut slot[at..]);
                }
            }
            if examined.open != 0 {
                let vectors = difference_vectors::<L>(declaration, &points);
                for (number, slot) in vectors.as_flattened().iter().zip(&mut numbers[entries..]) {
                    number.store(&mut slot[at..]);
                }
                open.extend((0..per_batch).filter(|lane| examined.open >> lane & 1 == 1).map(|lane| at + lane));
            }
        }
        projection.change_some::<L>(
            &open,
            (numbers.as_flattened_mut(), TAPE_BLOCK),
            |element| element,
            |element| {
                projected[element / per_batch * per_batch] |= 1 << (element % per_batch);
            },
        );
    }
}

struct AddHessians<'a, 'w, 'b> {
    block: BlockResults<'a, f64>,
    stencils: &'a [u32],
    /// Bits of the changed lanes, by the first element of the lanes.
    projected: &'a [u32; TAPE_BLOCK],
    work: &'a mut Hessians<'w, 'b>,
}

impl Kernel for AddHessians<'_, '_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Level>(self) {
        let BlockResults { first, count, results, flags } = self.block;
        let points = self.stencils.len() / TAPE_BLOCK;
        let zero = [L::F64::splat(0.0); 3];
        let mut vectors = vec![zero; 3 * points];
        let (gradient, scratch) = vectors.split_at_mut(points);
        let mut triangle = vec![[zero; 3]; points * (points + 1) / 2];
        let mut at = 0;
        while at < count {
            let lanes = lanes::<L>(first, count, at, self.stencils);
            read::<L>(results, 1, at, gradient);
            read::<L>(results, 1 + 3 * points, at, triangle.as_flattened_mut());
            let value = L::F64::load(&results.number(0)[at..]);
            let bits = (flagged(flags, &lanes, at), self.projected[at]);
            let (v, sums) = scratch.split_at_mut(points);
            let numbers = Expanded { value, gradient, triangle: &mut triangle };
            self.work.add(&lanes, numbers, bits, [v, sums]);
            at += <L::F64 as Lane<f64>>::LANES;
        }
    }
}
