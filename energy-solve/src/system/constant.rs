use std::ops::Range;

use energy_dsl::Block;

use crate::matrix::pattern::{Pattern, Storage, index};
use crate::matrix::precision::Precision;
use crate::terms::curvature::Curvature;
use crate::terms::stencils::Stencils;
use crate::terms::term::Weights;

/// What is constant of a matrix M + α ∂f/∂x + β ∂f/∂v: masses and quadratic terms, evaluated once for all steps of one size. The matrix holds it; of
/// the blocks that other terms are added to it is kept here, to begin with again.
#[derive(Clone, Debug)]
pub(crate) struct Constant<T> {
    weights: Weights,
    curvature: Curvature,
    /// The masses of all vertices; empty for none.
    masses: Vec<f64>,
    /// Whether some element's curvature had to be changed; where none had, they serve for any treatment.
    projected: bool,
    /// The places that other terms are added to, in runs within rows, and the blocks there.
    runs: Vec<Range<u32>>,
    blocks: Vec<Block<T>>,
}

impl<T: Precision> Constant<T> {
    /// Keeps what a matrix holds at these places.
    pub(crate) fn new(
        (weights, curvature): (Weights, Curvature),
        masses: &[f64],
        projected: bool,
        runs: Vec<Range<u32>>,
        matrix: &[Block<T>],
    ) -> Self {
        let mut blocks = Vec::with_capacity(runs.iter().map(ExactSizeIterator::len).sum());
        runs.iter().for_each(|run| blocks.extend_from_slice(&matrix[run.start as usize..run.end as usize]));
        Self { weights, curvature, masses: masses.to_vec(), projected, runs, blocks }
    }

    /// Whether it is what is asked for.
    pub(crate) fn serves(&self, weights: Weights, curvature: Curvature, masses: &[f64]) -> bool {
        self.weights == weights && (!self.projected || self.curvature == curvature) && self.masses == masses
    }

    /// The runs, for another constant.
    pub(crate) fn into_runs(self) -> Vec<Range<u32>> {
        self.runs
    }

    /// Writes it to blocks of consecutive rows, the first of which is `first`.
    pub(crate) fn restore(&self, first: usize, matrix: &mut [Block<T>]) {
        let before = self.runs.partition_point(|run| (run.start as usize) < first);
        let mut kept: usize = self.runs[..before].iter().map(ExactSizeIterator::len).sum();
        for run in &self.runs[before..] {
            let start = run.start as usize - first;
            let Some(place) = matrix.get_mut(start..start + run.len()) else { break };
            place.copy_from_slice(&self.blocks[kept..][..run.len()]);
            kept += run.len();
        }
    }
}

/// The places of blocks that couple the rows of stencils, in runs within rows. `row` is the row of a vertex, if it has one.
pub(crate) fn coupled_runs<'a>(
    pattern: &Pattern,
    row: impl Fn(u32) -> Option<usize>,
    terms: impl Iterator<Item = Stencils<'a>>,
) -> Vec<Range<u32>> {
    let mut coupled = vec![false; pattern.blocks()];
    for stencil in terms.flat_map(Stencils::iter) {
        for i in stencil.clone().filter_map(&row) {
            for j in stencil.clone().filter_map(&row) {
                if (pattern.storage() == Storage::Whole || i <= j)
                    && let Some((place, _)) = pattern.place(i, j)
                {
                    coupled[place] = true;
                }
            }
        }
    }
    let mut runs: Vec<Range<u32>> = Vec::new();
    for row in 0..pattern.rows() {
        let places = pattern.first_in(row)..pattern.first_in(row + 1);
        for place in places.clone().filter(|&place| coupled[place]) {
            match runs.last_mut() {
                Some(run) if run.end as usize == place && place > places.start => run.end += 1,
                _ => runs.push(index(place)..index(place + 1)),
            }
        }
    }
    runs.shrink_to_fit();
    runs
}
