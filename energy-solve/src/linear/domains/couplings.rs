use std::ops::Range;
use std::sync::RwLock;

use energy_dsl::{Level, Vector3};

use super::triangle::{Triangle, scaled_block};
use super::{InverseFactor, Precision, Wide, rounded};
use crate::matrix::block_matrix::BlockMatrix;
use crate::matrix::cross_blocks::CrossBlocks;
use crate::matrix::pattern::{Pattern, index};
use crate::matrix::precision::doubled;

/// The blocks Ẽ that couple a domain with others, and the domain's border: the rows that they act on.
#[derive(Clone, Debug)]
pub(crate) struct Couplings<T> {
    /// Sorted by the other domain.
    couplings: Vec<Coupling<T>>,
    border: Vec<u32>,
}

/// A block that couples a row with a row of another domain.
#[derive(Clone, Debug)]
pub(crate) struct Coupling<T> {
    row: u32,
    /// The other domain, and the index of its row on its border.
    other: u32,
    border: u32,
    /// The index of the block in the matrix, or that of a block which the matrix lacks, counted from the matrix's
    /// number of blocks; and its row and column there.
    slot: u32,
    between: [u32; 2],
    /// Whether the transpose of the stored block acts.
    transposed: bool,
    columns: [Wide<T>; 3],
}

impl<T: Precision> Couplings<T> {
    /// Creates the couplings of all domains, whose rows make up the pattern.
    pub(super) fn all(pattern: &Pattern, cross: &CrossBlocks, triangles: &[&Triangle<T>]) -> Vec<Self> {
        let ranges = &triangles.iter().map(|triangle| triangle.rows.clone()).collect::<Vec<_>>()[..];
        let mut all: Vec<Self> = ranges.iter().map(|_| Self { couplings: Vec::new(), border: Vec::new() }).collect();
        let outer = outer_blocks(pattern, cross, triangles);
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
        for (slot, between) in outer {
            couple(&mut all, ranges, slot, between);
        }
        for domain in &mut all {
            domain.couplings.sort_by_key(|coupling| coupling.other);
        }
        all
    }

    /// Returns the border rows, counted from the first row of the domain.
    pub(crate) fn border(&self) -> &[u32] {
        &self.border
    }

    /// Creates the place where other domains read the border rows of a vector.
    pub(crate) fn create_border(&self) -> RwLock<Vec<Wide<T>>> {
        RwLock::new(vec![[T::from_f64(0.0); 4]; self.border.len()])
    }

    /// Returns Σ_j |e_ij| for each component of the border rows.
    pub(crate) fn absolute_row_sums(
        &self,
        matrix: &BlockMatrix<impl Precision>,
        cross: &CrossBlocks,
    ) -> Vec<Vector3<f64>> {
        let mut sums = vec![[0.0; 3]; self.border.len()];
        for coupling in &self.couplings {
            let border = self.border.binary_search(&coupling.row).expect("coupled rows are on the border");
            let block = match coupling.beyond(matrix) {
                Some(beyond) => cross.blocks()[beyond],
                None => doubled(&matrix.values()[coupling.slot as usize]),
            };
            for i in 0..3 {
                for j in 0..3 {
                    sums[border][i] += if coupling.transposed { block[j][i].abs() } else { block[i][j].abs() };
                }
            }
        }
        sums
    }

    /// Reads the coupling blocks of a matrix and of the blocks that it lacks, scaled by C⁻¹ of each row.
    #[inline(always)]
    pub(crate) fn scale<M: Precision, L: Level>(
        &mut self,
        inverses: &[InverseFactor<T>],
        matrix: &BlockMatrix<M>,
        cross: &CrossBlocks,
    ) {
        for coupling in &mut self.couplings {
            let [row, column] = coupling.between.map(|row| &inverses[row as usize]);
            let block = match coupling.beyond(matrix) {
                Some(beyond) => scaled_block::<f64, L>(&rounded(row), &cross.blocks()[beyond], &rounded(column)),
                None => {
                    let stored = &matrix.values()[coupling.slot as usize];
                    scaled_block::<M, L>(&rounded(row), stored, &rounded(column)).map(|row| row.map(Into::into))
                }
            };
            for i in 0..3 {
                for j in 0..3 {
                    let entry = if coupling.transposed { block[j][i] } else { block[i][j] };
                    coupling.columns[j][i] = T::from_f64(entry);
                }
            }
        }
    }

    /// Copies the border rows of a vector to where other domains read them.
    #[inline(always)]
    pub(crate) fn publish(&self, vector: &[Wide<T>], border: &RwLock<Vec<Wide<T>>>) {
        if !self.border.is_empty() {
            let mut published = border.write().expect("no other thread panicked");
            for (target, &row) in published.iter_mut().zip(&self.border) {
                *target = vector[row as usize];
            }
        }
    }

    /// w ← w + s Ẽ t, where t is the vector that the other domains published.
    #[inline(always)]
    pub(crate) fn add_product<L: Level>(&self, s: T, borders: &[RwLock<Vec<Wide<T>>>], w: &mut [Wide<T>]) {
        for group in self.couplings.chunk_by(|a, b| a.other == b.other) {
            let t = borders[group[0].other as usize].read().expect("no other thread panicked");
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

impl<T> Coupling<T> {
    /// Returns the index of the block among those that the matrix lacks; `None` if the matrix has it.
    #[inline(always)]
    fn beyond(&self, matrix: &BlockMatrix<impl Precision>) -> Option<usize> {
        (self.slot as usize).checked_sub(matrix.pattern().blocks())
    }
}

/// Returns the index, row and column of each block that couples two domains.
fn outer_blocks<T>(pattern: &Pattern, cross: &CrossBlocks, triangles: &[&Triangle<T>]) -> Vec<(usize, [usize; 2])> {
    let mut outer = Vec::new();
    for Triangle { rows, inner_end, .. } in triangles {
        for (row, &inner_end) in rows.clone().zip(inner_end) {
            let slots = inner_end as usize..pattern.above(row).end;
            outer.extend(slots.map(|slot| (slot, [row, pattern.columns()[slot] as usize])));
            let beyond = cross.of_row(row).filter(|(_, column, _)| *column as usize >= rows.end);
            outer.extend(beyond.map(|(number, column, _)| (pattern.blocks() + number, [row, column as usize])));
        }
    }
    outer
}

/// Returns the domain of a row and the index of the row within it.
fn local(ranges: &[Range<usize>], row: usize) -> (usize, u32) {
    let domain = ranges.partition_point(|range| range.end <= row);
    (domain, index(row - ranges[domain].start))
}

/// Adds the block between two domains to both.
fn couple<T: Precision>(all: &mut [Couplings<T>], ranges: &[Range<usize>], slot: usize, between: [usize; 2]) {
    let ends = between.map(|row| local(ranges, row));
    for (own, with, transposed) in [(ends[0], ends[1], false), (ends[1], ends[0], true)] {
        let border = all[with.0].border.binary_search(&with.1).expect("coupled rows are on the border");
        all[own.0].couplings.push(Coupling {
            row: own.1,
            other: index(with.0),
            border: index(border),
            slot: index(slot),
            between: between.map(index),
            transposed,
            columns: [[T::from_f64(0.0); 4]; 3],
        });
    }
}
