use std::ops::Range;

use energy_dsl::Level;

use crate::linear::domains::{Precision, Wide};
use crate::matrix::pattern::{Pattern, index};

/// How the aggregates of a coarse level carry the rows of a fine one: P, whose blocks are multiples w of the identity.
///
/// Each row belongs to an aggregate. Its weights are the shares of the aggregates in the row and what it is coupled with: the tentative P, ones and
/// zeros, averaged once. They sum up to one, so translations are carried exactly; and as the aggregate of a root holds all its neighbours, the
/// root's row of P is a unit vector: P has full rank, and Pᵀ A P is positive definite if A is.
///
/// A row that is coupled with none is carried by none: the smoother solves for it.
#[derive(Clone, Debug)]
pub(super) struct Interpolation<T> {
    aggregates: usize,
    row_start: Vec<u32>,
    columns: Vec<u32>,
    weights: Vec<T>,
}

/// Shares below this part are left out, all but that of a row's own aggregate: couplings between coarse rows for next to nothing.
const LEAST_SHARE: f64 = 0.125;

impl<T: Precision> Interpolation<T> {
    /// From aggregates of rows that the pattern couples.
    pub(super) fn averaged(pattern: &Pattern) -> Self {
        let neighbours = Neighbours::of(pattern);
        let (of, aggregates) = neighbours.aggregates();
        let mut row_start = Vec::with_capacity(pattern.rows() + 1);
        row_start.push(0);
        let mut interpolation = Self { aggregates, row_start, columns: Vec::new(), weights: Vec::new() };
        let mut shares: Vec<(u32, f64)> = Vec::new();
        for row in 0..pattern.rows() {
            shares.clear();
            if of[row] != NONE {
                let with_itself = neighbours.of_row(row).len() + 1;
                for aggregate in neighbours.of_row(row).iter().chain([&index(row)]).map(|&row| of[row as usize]) {
                    match shares.iter_mut().find(|(known, _)| *known == aggregate) {
                        Some((_, share)) => *share += 1.0,
                        None => shares.push((aggregate, 1.0)),
                    }
                }
                let least = LEAST_SHARE * with_itself as f64;
                shares.retain(|&(aggregate, share)| aggregate == of[row] || share >= least);
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

    /// The number of aggregates.
    pub(super) fn aggregates(&self) -> usize {
        self.aggregates
    }

    /// Where the weights of a row are.
    #[inline(always)]
    pub(super) fn places(&self, row: usize) -> Range<usize> {
        self.row_start[row] as usize..self.row_start[row + 1] as usize
    }

    /// The aggregates that carry a row.
    #[inline(always)]
    pub(super) fn columns(&self, row: usize) -> &[u32] {
        &self.columns[self.places(row)]
    }

    /// How much each of them does.
    #[inline(always)]
    pub(super) fn weights(&self, row: usize) -> &[T] {
        &self.weights[self.places(row)]
    }

    /// The first and the last aggregate, and those between, that carry some of these rows.
    pub(super) fn span(&self, rows: Range<usize>) -> Range<usize> {
        let columns = &self.columns[self.row_start[rows.start] as usize..self.row_start[rows.end] as usize];
        match (columns.iter().min(), columns.iter().max()) {
            (Some(&first), Some(&last)) => first as usize..last as usize + 1,
            _ => 0..0,
        }
    }

    /// The part of P e in a row.
    #[inline(always)]
    pub(super) fn carried<L: Level>(&self, row: usize, e: &[Wide<T>]) -> Wide<T> {
        let mut sum = [T::from_f64(0.0); 4];
        for place in self.places(row) {
            let (weight, from) = (self.weights[place], e[self.columns[place] as usize]);
            for lane in 0..4 {
                sum[lane] = from[lane].mul_add::<L>(weight, sum[lane]);
            }
        }
        sum
    }

    /// Adds what a row contributes to Pᵀ r, counted from aggregate `first`.
    #[inline(always)]
    pub(super) fn add_restricted<L: Level>(&self, row: usize, r: &Wide<T>, first: usize, sums: &mut [Wide<T>]) {
        for place in self.places(row) {
            let (weight, to) = (self.weights[place], &mut sums[self.columns[place] as usize - first]);
            let mut sum = *to;
            for lane in 0..4 {
                sum[lane] = r[lane].mul_add::<L>(weight, sum[lane]);
            }
            *to = sum;
        }
    }
}

/// Of no aggregate.
const NONE: u32 = u32::MAX;

/// The other rows that each row is coupled with, ascending.
struct Neighbours {
    start: Vec<usize>,
    rows: Vec<u32>,
}

impl Neighbours {
    fn of(pattern: &Pattern) -> Self {
        let rows = pattern.rows();
        let couplings = || (0..rows).flat_map(|row| pattern.above(row).map(move |place| (row, place)));
        let mut start = vec![0; rows + 1];
        for (row, place) in couplings() {
            start[row + 1] += 1;
            start[pattern.columns()[place] as usize + 1] += 1;
        }
        for row in 0..rows {
            start[row + 1] += start[row];
        }
        let (mut next, mut neighbours) = (start.clone(), vec![0; start[rows]]);
        for (row, place) in couplings() {
            let column = pattern.columns()[place] as usize;
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

    /// The aggregate of each row, and how many there are: every row whose neighbours all are free yet makes one with them; what is left over joins one
    /// that it is coupled with (Vaněk, Mandel and Brezina 1996, algorithm 5.1 without its last step, to which nothing is left).
    fn aggregates(&self) -> (Vec<u32>, usize) {
        let rows = self.start.len() - 1;
        let (mut of, mut count) = (vec![NONE; rows], 0);
        for row in 0..rows {
            let neighbours = self.of_row(row);
            let free = |&row: &u32| of[row as usize] == NONE;
            if !neighbours.is_empty() && free(&index(row)) && neighbours.iter().all(free) {
                of[row] = count;
                neighbours.iter().for_each(|&other| of[other as usize] = count);
                count += 1;
            }
        }
        let roots = of.clone();
        for row in 0..rows {
            let joined = || self.of_row(row).iter().map(|&other| roots[other as usize]).find(|&other| other != NONE);
            if of[row] == NONE {
                of[row] = joined().unwrap_or(NONE);
            }
        }
        (of, count as usize)
    }
}
