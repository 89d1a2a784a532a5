//! Elements in lanes whose Hessians wait for projection.
//!
//! Few Hessians are indefinite in most places, and eigenvalues of eight cost as much as those of one. So a batch with
//! an indefinite Hessian waits, and those after it, until there are enough to fill all lanes. Then all of them are
//! added in their order.

use energy_dsl::{Lane, Level};

use crate::terms::curvature::Projection;
use crate::terms::scatter::Lanes;

/// The most batches that wait: they should stay in the cache.
const MOST: usize = 32;

/// Batches that wait, in order.
#[derive(Debug, Default)]
pub(super) struct Waiting {
    batches: Vec<Held>,
    /// Batch by batch: U, gradient, upper triangle and vectors, each number for all lanes together.
    numbers: Vec<f64>,
    /// Batch by batch and point by point: the vertices of all lanes.
    stencils: Vec<u32>,
    /// Lanes with an indefinite Hessian: batch times the number of lanes, plus the lane.
    open: Vec<usize>,
}

/// A batch that waits.
#[derive(Clone, Copy, Debug)]
pub(super) struct Held {
    /// Index of its first element.
    pub(super) first: usize,
    /// Number of elements.
    pub(super) count: usize,
    /// Bits of lanes: degenerate or at a kink.
    pub(super) degenerate: u32,
    pub(super) kink: u32,
    /// Bits of the changed lanes.
    pub(super) changed: u32,
}

impl Waiting {
    /// Projects the Hessians of a batch in which all are indefinite. They need not wait. Returns a bit mask of the
    /// changed lanes.
    #[inline(always)]
    pub(super) fn project_now<L: Level>(
        &mut self,
        projection: Projection<'_>,
        hessian: &mut [L::F64],
        vectors: &[L::F64],
    ) -> u32 {
        let lanes = <L::F64 as Lane<f64>>::LANES;
        self.numbers.resize((hessian.len() + vectors.len()) * lanes, 0.0);
        for (number, stored) in hessian.iter().chain(vectors).zip(self.numbers.chunks_exact_mut(lanes)) {
            number.store(stored);
        }
        let changed = projection.change_all::<L>(&mut self.numbers);
        for (number, stored) in hessian.iter_mut().zip(self.numbers.chunks_exact(lanes)) {
            *number = L::F64::load(stored);
        }
        self.numbers.clear();
        changed
    }

    pub(super) fn is_empty(&self) -> bool {
        self.batches.is_empty()
    }

    /// Returns whether the Hessians should be projected now.
    pub(super) fn is_full(&self, lanes: usize) -> bool {
        self.open.len() >= lanes || self.batches.len() >= MOST
    }

    /// Adds a batch with its U, gradient, upper triangle and vectors. `open` marks the lanes with an indefinite
    /// Hessian.
    #[inline(always)]
    pub(super) fn hold<V: Lane<f64>>(
        &mut self,
        held: Held,
        open: u32,
        (lanes, points): (&Lanes<'_>, usize),
        numbers: [&[V]; 4],
    ) {
        let first = self.batches.len() * V::LANES;
        self.open.extend((0..V::LANES).filter(|lane| open >> lane & 1 == 1).map(|lane| first + lane));
        self.batches.push(held);
        for point in 0..points {
            self.stencils.extend_from_slice(&lanes.all_vertices(point)[..V::LANES]);
        }
        let end = self.numbers.len();
        self.numbers.resize(end + numbers.iter().map(|part| part.len() * V::LANES).sum::<usize>(), 0.0);
        for (number, stored) in numbers.into_iter().flatten().zip(self.numbers[end..].chunks_exact_mut(V::LANES)) {
            number.store(stored);
        }
    }

    /// Projects the open lanes.
    pub(super) fn project<L: Level>(&mut self, projection: Projection<'_>) {
        let lanes = <L::F64 as Lane<f64>>::LANES;
        let per_batch = self.numbers.len() / self.batches.len();
        let first = |element: usize| element / lanes * per_batch + (1 + projection.n) * lanes + element % lanes;
        let Self { batches, numbers, open, .. } = self;
        projection.change_some::<L>(open, (numbers, lanes), first, |element| {
            batches[element / lanes].changed |= 1 << (element % lanes);
        });
        self.open.clear();
    }

    /// Calls `each` with the batches, their lanes and numbers, and forgets them.
    #[inline(always)]
    pub(super) fn release<V: Lane<f64>>(&mut self, mut each: impl FnMut(Held, Lanes<'_>, &[f64])) {
        let count = self.batches.len().max(1);
        let (per_batch, points) = (self.numbers.len() / count, self.stencils.len() / count);
        for (number, held) in self.batches.drain(..).enumerate() {
            let stencils = &self.stencils[number * points..][..points];
            let lanes = Lanes { first: held.first, count: held.count, stencils, stride: V::LANES };
            each(held, lanes, &self.numbers[number * per_batch..][..per_batch]);
        }
        self.numbers.clear();
        self.stencils.clear();
    }
}
