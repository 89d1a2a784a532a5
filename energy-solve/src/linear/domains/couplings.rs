use std::ops::Range;
use std::sync::RwLock;

use energy_dsl::{Level, Vector3};

use super::triangle::{Triangle, scaled_block};
use super::{InverseFactor, Precision, Wide, rounded};
use crate::matrix::block_matrix::BlockMatrix;
use crate::matrix::pattern::{Pattern, index};
use crate::matrix::precision::doubled;

/// What couples a domain with others, Ẽ, and its rows that others are coupled with, its border.
#[derive(Clone, Debug)]
pub(crate) struct Couplings<T> {
    /// By the other domain.
    couplings: Vec<Coupling<T>>,
    border: Vec<u32>,
}

/// A block that acts on a row of another domain.
#[derive(Clone, Debug)]
pub(crate) struct Coupling<T> {
    row: u32,
    /// The other domain, and the place of its row on its border.
    other: u32,
    border: u32,
    /// The block's place in the matrix, its row and its column there.
    place: u32,
    between: [u32; 2],
    /// Whether its mirror image is what acts.
    turned: bool,
    columns: [Wide<T>; 3],
}

impl<T: Precision> Couplings<T> {
    /// Of domains of these consecutive rows, which make up the pattern, with these triangles.
    pub(super) fn all(pattern: &Pattern, ranges: &[Range<usize>], triangles: &[Triangle<T>]) -> Vec<Self> {
        let mut all: Vec<Self> = ranges.iter().map(|_| Self { couplings: Vec::new(), border: Vec::new() }).collect();
        let outer = outer_blocks(pattern, triangles);
        for &(_, between) in &outer {
            for row in between {
                let (domain, local) = local(ranges, row);
                all[domain].border.push(local);
            }
        }
        for domain in &mut all {
            domain.border.sort_unstable();
            domain.border.dedup();
        }
        for (place, between) in outer {
            couple(&mut all, ranges, place, between);
        }
        for domain in &mut all {
            domain.couplings.sort_by_key(|coupling| coupling.other);
        }
        all
    }

    /// The rows that others are coupled with, counted from the domain's first.
    pub(crate) fn border(&self) -> &[u32] {
        &self.border
    }

    /// Σ_j |e_ij| of the rows on the border.
    pub(crate) fn absolute_row_sums(&self, matrix: &BlockMatrix<impl Precision>) -> Vec<Vector3<f64>> {
        let mut sums = vec![[0.0; 3]; self.border.len()];
        for coupling in &self.couplings {
            let place = self.border.binary_search(&coupling.row).expect("it is on the border");
            let block = doubled(&matrix.values()[coupling.place as usize]);
            for i in 0..3 {
                for j in 0..3 {
                    sums[place][i] += if coupling.turned { block[j][i].abs() } else { block[i][j].abs() };
                }
            }
        }
        sums
    }

    /// Takes over its part of a matrix, scaled by C⁻¹ of each row.
    #[inline(always)]
    pub(crate) fn scale<M: Precision, L: Level>(&mut self, inverses: &[InverseFactor<T>], matrix: &BlockMatrix<M>) {
        for coupling in &mut self.couplings {
            let [row, column] = coupling.between.map(|row| rounded(&inverses[row as usize]));
            let block = scaled_block::<M, L>(&row, &matrix.values()[coupling.place as usize], &column);
            for i in 0..3 {
                for j in 0..3 {
                    let entry = if coupling.turned { block[j][i] } else { block[i][j] };
                    coupling.columns[j][i] = T::from_f64(entry.into());
                }
            }
        }
    }

    /// Shows others a vector on the border.
    #[inline(always)]
    pub(crate) fn show(&self, vector: &[Wide<T>], border: &RwLock<Vec<Wide<T>>>) {
        if !self.border.is_empty() {
            let mut shown = border.write().expect("no thread panics");
            for (place, &row) in shown.iter_mut().zip(&self.border) {
                *place = vector[row as usize];
            }
        }
    }

    /// w ← w + s Ẽ t, t as others show it.
    #[inline(always)]
    pub(crate) fn add_product<L: Level>(&self, s: T, borders: &[RwLock<Vec<Wide<T>>>], w: &mut [Wide<T>]) {
        for group in self.couplings.chunk_by(|a, b| a.other == b.other) {
            let t = borders[group[0].other as usize].read().expect("no thread panics");
            for coupling in group {
                let (w, t) = (&mut w[coupling.row as usize], t[coupling.border as usize]);
                let mut sum = *w;
                for column in 0..3 {
                    let factor = s * t[column];
                    for lane in 0..4 {
                        sum[lane] = coupling.columns[column][lane].mul_add::<L>(factor, sum[lane]);
                    }
                }
                *w = sum;
            }
        }
    }
}

/// The places of the blocks that couple domains, with their rows and columns.
fn outer_blocks<T>(pattern: &Pattern, triangles: &[Triangle<T>]) -> Vec<(usize, [usize; 2])> {
    let of_row =
        |row: usize, inner_end: u32| (inner_end as usize..pattern.above(row).end).map(move |place| (row, place));
    let places = triangles.iter().flat_map(|domain| {
        domain.rows.clone().zip(&domain.inner_end).flat_map(move |(row, &inner_end)| of_row(row, inner_end))
    });
    places.map(|(row, place)| (place, [row, pattern.columns()[place] as usize])).collect()
}

/// The domain of a row, and its number there.
fn local(ranges: &[Range<usize>], row: usize) -> (usize, u32) {
    let domain = ranges.partition_point(|range| range.end <= row);
    (domain, index(row - ranges[domain].start))
}

/// Notes the block of two rows of different domains, in both.
fn couple<T: Precision>(all: &mut [Couplings<T>], ranges: &[Range<usize>], place: usize, between: [usize; 2]) {
    let ends = between.map(|row| local(ranges, row));
    for (own, with, turned) in [(ends[0], ends[1], false), (ends[1], ends[0], true)] {
        let border = all[with.0].border.binary_search(&with.1).expect("it is on the border");
        all[own.0].couplings.push(Coupling {
            row: own.1,
            other: index(with.0),
            border: index(border),
            place: index(place),
            between: between.map(index),
            turned,
            columns: [[T::from_f64(0.0); 4]; 3],
        });
    }
}
