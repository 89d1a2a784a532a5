//! Constant parts of matrices, evaluated once and reused.

use std::ops::Range;
use std::sync::{Arc, Weak};

use energy_dsl::Block;

use crate::matrix::block_matrix::Contents;
use crate::matrix::pattern::{Pattern, Storage, index};
use crate::matrix::precision::Blocks;
use crate::terms::curvature::Curvature;
use crate::terms::linearisation::Weights;
use crate::terms::stencils::Stencils;

/// The constant part of a matrix M + α ∂f/∂x + β ∂f/∂v: masses and quadratic terms, evaluated once for all steps of one
/// size.
///
/// The matrix itself holds this part. Blocks that other terms also write are copied here and restored before each
/// assembly.
#[derive(Clone, Debug)]
pub(super) struct ConstantPart {
    /// Identifies the matrices that hold this part.
    contents: Weak<Contents>,
    weights: Weights,
    curvature: Curvature,
    /// The masses of all vertices; empty if the matrix was assembled without masses.
    masses: Vec<f64>,
    /// Whether the Hessian of some element was projected. If not, the part is the same for every [`Curvature`].
    projected: bool,
    /// The blocks that other terms also write, as runs within rows, and their values.
    runs: Arc<[Range<u32>]>,
    blocks: StoredBlocks,
}

/// Blocks in the precision of their matrix.
#[derive(Clone, Debug)]
enum StoredBlocks {
    Single(Vec<Block<f32>>),
    Double(Vec<Block<f64>>),
}

impl ConstantPart {
    /// Copies the blocks of `runs` from a matrix that holds the constant part and nothing else.
    pub(super) fn new(
        contents: &Arc<Contents>,
        (weights, curvature): (Weights, Curvature),
        masses: &[f64],
        projected: bool,
        runs: Arc<[Range<u32>]>,
        matrix: Blocks<'_>,
    ) -> Self {
        let blocks = match matrix {
            Blocks::Single(matrix) => StoredBlocks::Single(gathered(&runs, matrix)),
            Blocks::Double(matrix) => StoredBlocks::Double(gathered(&runs, matrix)),
        };
        let contents = Arc::downgrade(contents);
        Self { contents, weights, curvature, masses: masses.to_vec(), projected, runs, blocks }
    }

    /// Whether some matrix still holds this part.
    pub(super) fn is_in_use(&self) -> bool {
        self.contents.strong_count() > 0
    }

    /// Whether matrices with these contents hold this part.
    pub(super) fn is_in(&self, contents: &Arc<Contents>) -> bool {
        std::ptr::eq(self.contents.as_ptr(), Arc::as_ptr(contents))
    }

    /// Whether this is the constant part for these weights, curvature and masses.
    pub(super) fn matches(&self, weights: Weights, curvature: Curvature, masses: &[f64]) -> bool {
        self.weights == weights && (!self.projected || self.curvature == curvature) && self.masses == masses
    }

    /// Restores blocks of consecutive rows; `first` is the index of their first block.
    pub(super) fn restore(&self, first: usize, matrix: Blocks<'_>) {
        match (&self.blocks, matrix) {
            (StoredBlocks::Single(blocks), Blocks::Single(matrix)) => restore(&self.runs, blocks, first, matrix),
            (StoredBlocks::Double(blocks), Blocks::Double(matrix)) => restore(&self.runs, blocks, first, matrix),
            _ => unreachable!("a matrix does not change its precision"),
        }
    }
}

/// Copies the blocks of the runs.
fn gathered<T: Copy>(runs: &[Range<u32>], matrix: &[Block<T>]) -> Vec<Block<T>> {
    let mut blocks = Vec::with_capacity(runs.iter().map(ExactSizeIterator::len).sum());
    runs.iter().for_each(|run| blocks.extend_from_slice(&matrix[run.start as usize..run.end as usize]));
    blocks
}

/// Writes the runs that lie within `matrix`, whose first block has the index `first`.
fn restore<T: Copy>(runs: &[Range<u32>], blocks: &[Block<T>], first: usize, matrix: &mut [Block<T>]) {
    let before = runs.partition_point(|run| (run.start as usize) < first);
    let mut done: usize = runs[..before].iter().map(ExactSizeIterator::len).sum();
    for run in &runs[before..] {
        let start = run.start as usize - first;
        let Some(target) = matrix.get_mut(start..start + run.len()) else { break };
        target.copy_from_slice(&blocks[done..][..run.len()]);
        done += run.len();
    }
}

/// Returns the indices of the blocks that the stencils couple, as runs within rows. `row` maps a vertex to its row, if
/// it has one.
pub(super) fn coupled_runs<'a>(
    pattern: &Pattern,
    row: impl Fn(u32) -> Option<usize>,
    terms: impl Iterator<Item = Stencils<'a>>,
) -> Arc<[Range<u32>]> {
    let mut coupled = vec![false; pattern.blocks()];
    for stencil in terms.flat_map(Stencils::iter) {
        for i in stencil.clone().filter_map(&row) {
            for j in stencil.clone().filter_map(&row) {
                if (pattern.storage() == Storage::Whole || i <= j)
                    && let Some((slot, _)) = pattern.slot(i, j)
                {
                    coupled[slot] = true;
                }
            }
        }
    }
    let mut runs: Vec<Range<u32>> = Vec::new();
    for row in 0..pattern.rows() {
        let slots = pattern.first_in(row)..pattern.first_in(row + 1);
        for slot in slots.clone().filter(|&slot| coupled[slot]) {
            match runs.last_mut() {
                Some(run) if run.end as usize == slot && slot > slots.start => run.end += 1,
                _ => runs.push(index(slot)..index(slot + 1)),
            }
        }
    }
    runs.into()
}
