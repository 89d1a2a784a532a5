use std::ops::Range;

use energy_dsl::Level;

use crate::linear::domains::{Precision, Wide};
use crate::matrix::pattern::{Pattern, index};

/// The prolongation P from the aggregates of a coarse level to the rows of a fine level. Its blocks are multiples of
/// the identity.
///
/// Each row belongs to one aggregate. A row's weights are the averages of the tentative prolongation, which has ones
/// and zeros, over the row and its neighbours.
///
/// The weights of a row sum to 1, so P reproduces translations exactly. The neighbours of an aggregate's root all
/// belong to that aggregate, so the root's row of P is a unit vector. So P has full rank, and Pᵀ A P is positive
/// definite if A is.
///
/// A row without couplings has no weights: the smoother alone solves for it.
#[derive(Clone, Debug)]
pub(super) struct Interpolation<T> {
    aggregates: usize,
    row_start: Vec<u32>,
    columns: Vec<u32>,
    weights: Vec<T>,
}

/// Weights below this fraction are dropped, except that of a row's own aggregate: they would couple coarse rows for
/// little gain.
const LEAST_SHARE: f64 = 0.125;

impl<T: Precision> Interpolation<T> {
    /// Aggregates the rows of a pattern and averages the tentative prolongation.
    pub(super) fn averaged(pattern: &Pattern) -> Self {
        let neighbours = Neighbours::of(pattern);
        let (aggregate_of, aggregates) = neighbours.aggregates();
        let mut row_start = Vec::with_capacity(pattern.rows() + 1);
        row_start.push(0);
        let mut interpolation = Self { aggregates, row_start, columns: Vec::new(), weights: Vec::new() };
        let mut shares: Vec<(u32, f64)> = Vec::new();
        for row in 0..pattern.rows() {
            shares.clear();
            if aggregate_of[row] != NONE {
                let with_itself = neighbours.of_row(row).len() + 1;
                for aggregate in
                    neighbours.of_row(row).iter().chain([&index(row)]).map(|&row| aggregate_of[row as usize])
                {
                    match shares.iter_mut().find(|(known, _)| *known == aggregate) {
                        Some((_, share)) => *share += 1.0,
                        None => shares.push((aggregate, 1.0)),
                    }
                }
                let least = LEAST_SHARE * with_itself as f64;
                shares.retain(|&(aggregate, share)| aggregate == aggregate_of[row] || share >= least);
                shares.sort_unstable_by_key(|&(aggregate, _)| aggregate);
            }
            let all: f64 = shares.iter().map(|(_, share)| share).sum();
            for &(aggregate, share) in &shares {
                interpolation.columns.push(aggregate);
                interpolation.weights.push(T::from_f64(share / all));
            }
            interpolation.row_start.push(index(interpolation.columns.len()));
        }
        interpolation.columns.shrink_to_fit();
        interpolation.weights.shrink_to_fit();
        interpolation
    }

    /// Returns the number of aggregates.
    pub(super) fn aggregates(&self) -> usize {
        self.aggregates
    }

    /// Returns the number of rows that are interpolated.
    pub(super) fn rows(&self) -> usize {
        self.row_start.len() - 1
    }

    /// Iterates over the aggregates from which a row is interpolated, with their weights.
    #[inline(always)]
    pub(super) fn weighted(&self, row: usize) -> impl Iterator<Item = (u32, f64)> {
        self.columns(row).iter().copied().zip(self.weights(row).iter().map(|&weight| weight.into()))
    }

    /// Returns the indices of a row's weights.
    #[inline(always)]
    pub(super) fn entries(&self, row: usize) -> Range<usize> {
        self.row_start[row] as usize..self.row_start[row + 1] as usize
    }

    /// Returns the aggregates from which a row is interpolated.
    #[inline(always)]
    pub(super) fn columns(&self, row: usize) -> &[u32] {
        &self.columns[self.entries(row)]
    }

    /// Returns the weights of these aggregates.
    #[inline(always)]
    pub(super) fn weights(&self, row: usize) -> &[T] {
        &self.weights[self.entries(row)]
    }

    /// Returns the range of aggregates from which these rows are interpolated.
    pub(super) fn span(&self, rows: Range<usize>) -> Range<usize> {
        let columns = &self.columns[self.row_start[rows.start] as usize..self.row_start[rows.end] as usize];
        match (columns.iter().min(), columns.iter().max()) {
            (Some(&first), Some(&last)) => first as usize..last as usize + 1,
            _ => 0..0,
        }
    }

    /// Returns the row of P e.
    #[inline(always)]
    pub(super) fn prolonged<L: Level>(&self, row: usize, e: &[Wide<T>]) -> Wide<T> {
        let mut sum = [T::from_f64(0.0); 4];
        for entry in self.entries(row) {
            let (weight, from) = (self.weights[entry], e[self.columns[entry] as usize]);
            for lane in 0..4 {
                sum[lane] = from[lane].mul_add::<L>(weight, sum[lane]);
            }
        }
        sum
    }

    /// Adds a row's contribution to Pᵀ r; `sums` begins with the aggregate `first`.
    #[inline(always)]
    pub(super) fn add_restricted<L: Level>(&self, row: usize, r: &Wide<T>, first: usize, sums: &mut [Wide<T>]) {
        for entry in self.entries(row) {
            let (weight, to) = (self.weights[entry], &mut sums[self.columns[entry] as usize - first]);
            let mut sum = *to;
            for lane in 0..4 {
                sum[lane] = r[lane].mul_add::<L>(weight, sum[lane]);
            }
            *to = sum;
        }
    }
}

/// Marks a row without an aggregate.
const NONE: u32 = u32::MAX;

/// The other rows that each row is coupled with, ascending.
struct Neighbours {
    start: Vec<usize>,
    rows: Vec<u32>,
}

impl Neighbours {
    fn of(pattern: &Pattern) -> Self {
        let rows = pattern.rows();
        let couplings = || (0..rows).flat_map(|row| pattern.above(row).map(move |entry| (row, entry)));
        let mut start = vec![0; rows + 1];
        for (row, entry) in couplings() {
            start[row + 1] += 1;
            start[pattern.columns()[entry] as usize + 1] += 1;
        }
        for row in 0..rows {
            start[row + 1] += start[row];
        }
        let (mut next, mut neighbours) = (start.clone(), vec![0; start[rows]]);
        for (row, entry) in couplings() {
            let column = pattern.columns()[entry] as usize;
            for (of, other) in [(row, column), (column, row)] {
                neighbours[next[of]] = index(other);
                next[of] += 1;
            }
        }
        Self { start, rows: neighbours }
    }

    fn of_row(&self, row: usize) -> &[u32] {
        &self.rows[self.start[row]..self.start[row + 1]]
    }

    /// Returns the aggregate of each row and the number of aggregates. A row whose neighbours are all free forms an
    /// aggregate with them; each remaining row joins the aggregate of a neighbour (Vaněk, Mandel and Brezina 1996,
    /// algorithm 5.1; its last step never applies).
    fn aggregates(&self) -> (Vec<u32>, usize) {
        let rows = self.start.len() - 1;
        let (mut aggregate_of, mut count) = (vec![NONE; rows], 0);
        for row in 0..rows {
            let neighbours = self.of_row(row);
            let free = |&row: &u32| aggregate_of[row as usize] == NONE;
            if !neighbours.is_empty() && free(&index(row)) && neighbours.iter().all(free) {
                aggregate_of[row] = count;
                neighbours.iter().for_each(|&other| aggregate_of[other as usize] = count);
                count += 1;
            }
        }
        let roots = aggregate_of.clone();
        for row in 0..rows {
            let joined = || self.of_row(row).iter().map(|&other| roots[other as usize]).find(|&other| other != NONE);
            if aggregate_of[row] == NONE {
                aggregate_of[row] = joined().unwrap_or(NONE);
            }
        }
        (aggregate_of, count as usize)
    }
}
