use std::ops::Range;
use std::sync::RwLock;

use energy_dsl::{Block, Level, Vector3};

use super::RELAXATION;
use super::diagonal::{Inverse, scaled};
use crate::matrix::BlockMatrix;
use crate::pattern::{Pattern, index};
use crate::precision::Precision;

/// A vector of three in a register of four, with a last component that means nothing.
pub(super) type Wide<T> = [T; 4];

/// Numbers after the last block, so that four can be read where its last column begins.
const SLACK: usize = 1;

/// Consecutive rows: their part of the scaled matrix, and of the vectors of conjugate gradients. Rows and columns are counted from its first.
#[derive(Clone, Debug)]
pub(super) struct Domain<T> {
    pub(super) rows: Range<usize>,
    /// Blocks above the diagonal in the rows before.
    blocks_before: usize,
    /// For each row the first place that is no longer coupled within the domain.
    inner_end: Vec<u32>,
    /// The blocks of L̃ᵀ by rows, each column by column, and row by row.
    columns: Vec<T>,
    by_rows: Vec<T>,
    /// Ẽ: what couples it with other domains.
    couplings: Vec<Coupling<T>>,
    /// The rows that others are coupled with.
    border: Vec<u32>,
    residual: Vec<Wide<T>>,
    direction: Vec<Wide<T>>,
    /// t = (I + L̃ᵀ)⁻¹ p.
    back: Vec<Wide<T>>,
    /// (I + L̃)⁻¹ (p + (ω − 2) t + Ẽ t).
    forth: Vec<Wide<T>>,
    solution: Vec<Wide<T>>,
}

/// A block that acts on a row of another domain.
#[derive(Clone, Debug)]
struct Coupling<T> {
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

impl<T: Precision> Domain<T> {
    /// Domains of these consecutive rows, which make up the pattern.
    pub(super) fn all(pattern: &Pattern, ranges: &[Range<usize>]) -> Vec<Self> {
        let mut domains: Vec<Self> = ranges.iter().map(|rows| Self::uncoupled(pattern, rows.clone())).collect();
        let outer = outer_blocks(pattern, &domains);
        for &(_, between) in &outer {
            for row in between {
                let (domain, local) = local(ranges, row);
                domains[domain].border.push(local);
            }
        }
        for domain in &mut domains {
            domain.border.sort_unstable();
            domain.border.dedup();
        }
        for (place, between) in outer {
            couple(&mut domains, ranges, place, between);
        }
        for domain in &mut domains {
            domain.couplings.sort_by_key(|coupling| coupling.other);
        }
        domains
    }

    fn uncoupled(pattern: &Pattern, rows: Range<usize>) -> Self {
        let zero = T::from_f64(0.0);
        let before = |row: usize| pattern.above(row).start - row - 1;
        let inner_end = rows.clone().map(|row| {
            let above = pattern.above(row);
            let inner = pattern.columns()[above.clone()].partition_point(|&column| (column as usize) < rows.end);
            index(above.start + inner)
        });
        let last = rows.end - 1;
        let blocks = pattern.above(last).end - last - 1 - before(rows.start);
        let numbers = vec![zero; 9 * blocks + SLACK];
        let zeros = vec![[zero; 4]; rows.len()];
        Self {
            blocks_before: before(rows.start),
            inner_end: inner_end.collect(),
            rows,
            columns: numbers.clone(),
            by_rows: numbers,
            couplings: Vec::new(),
            border: Vec::new(),
            residual: zeros.clone(),
            direction: zeros.clone(),
            back: zeros.clone(),
            forth: zeros.clone(),
            solution: zeros,
        }
    }

    /// How many rows others are coupled with.
    pub(super) fn border(&self) -> usize {
        self.border.len()
    }

    /// Takes over its part of a matrix, scaled by C⁻¹ of each row.
    #[inline(always)]
    pub(super) fn scale<M: Precision, L: Level>(
        &mut self,
        pattern: &Pattern,
        inverses: &[Inverse],
        matrix: &BlockMatrix<M>,
    ) {
        let values = matrix.values();
        for (local, row) in self.rows.clone().enumerate() {
            let own = rounded(&inverses[row]);
            for place in pattern.above(row).start..self.inner_end[local] as usize {
                let other = rounded(&inverses[pattern.columns()[place] as usize]);
                let rows = scaled_block::<M, L>(&own, &values[place], &other);
                // Before it there are as many blocks on the diagonal as rows, and its own.
                let number = place - row - 1 - self.blocks_before;
                store(&mut self.by_rows[9 * number..][..9 + SLACK], &rows);
                store(&mut self.columns[9 * number..][..9 + SLACK], &transposed(&rows));
            }
        }
        for coupling in &mut self.couplings {
            let [row, column] = coupling.between.map(|row| &inverses[row as usize]);
            let block = scaled_block::<M, L>(&rounded(row), &values[coupling.place as usize], &rounded(column));
            for i in 0..3 {
                for j in 0..3 {
                    let entry = if coupling.turned { block[j][i] } else { block[i][j] };
                    coupling.columns[j][i] = T::from_f64(entry.into());
                }
            }
        }
    }

    /// r ← (I + L̃)⁻¹ C⁻¹ b/s, p ← 0, x ← 0. Returns r · r.
    #[inline(always)]
    pub(super) fn start<L: Level>(
        &mut self,
        pattern: &Pattern,
        inverses: &[Inverse],
        b: &[Vector3<f64>],
        scale: f64,
    ) -> f64 {
        let zero = [T::from_f64(0.0); 4];
        self.solution.fill(zero);
        self.direction.fill(zero);
        for row in 0..self.forth.len() {
            let [u, v, w] = scaled(&inverses[row], &b[row]).map(|component| T::from_f64(component / scale));
            self.forth[row] = [u, v, w, T::from_f64(0.0)];
        }
        self.forward::<L>(pattern);
        std::mem::swap(&mut self.residual, &mut self.forth);
        let mut squares = [0.0; 4];
        for vector in &self.residual {
            add_products(&mut squares, vector, vector);
        }
        of_three(squares)
    }

    /// p ← r + β p, t ← (I + L̃ᵀ)⁻¹ p, w ← p + (ω − 2) t. Returns p · t, and shows t on the border.
    #[inline(always)]
    pub(super) fn backward<L: Level>(
        &mut self,
        pattern: &Pattern,
        conjugate: f64,
        border: &RwLock<Vec<Wide<T>>>,
    ) -> f64 {
        let (conjugate, rest) = (T::from_f64(conjugate), T::from_f64(RELAXATION - 2.0));
        let first = self.rows.start;
        let (r, p, t, w) = (&self.residual[..], &mut self.direction[..], &mut self.back[..], &mut self.forth[..]);
        let mut along = [0.0; 4];
        for row in (0..p.len()).rev() {
            let (residual, mut direction) = (r[row], p[row]);
            for lane in 0..4 {
                direction[lane] = direction[lane].mul_add::<L>(conjugate, residual[lane]);
            }
            p[row] = direction;
            let mut sums = [direction, [T::from_f64(0.0); 4], [T::from_f64(0.0); 4]];
            // The nearest row, computed just before, comes last: the others do not have to wait for it.
            let number_of = first + row + 1 + self.blocks_before;
            for place in (pattern.above(first + row).start..self.inner_end[row] as usize).rev() {
                let block = &self.columns[9 * (place - number_of)..][..9 + SLACK];
                subtract_product::<T, L>(&mut sums, block, &t[pattern.columns()[place] as usize - first]);
            }
            let back = total(&sums);
            let mut start = direction;
            for lane in 0..4 {
                start[lane] = back[lane].mul_add::<L>(rest, direction[lane]);
            }
            add_products(&mut along, &direction, &back);
            (t[row], w[row]) = (back, start);
        }
        if !self.border.is_empty() {
            let mut shown = border.write().expect("no thread panics");
            for (place, &row) in shown.iter_mut().zip(&self.border) {
                *place = self.back[row as usize];
            }
        }
        of_three(along)
    }

    /// w ← w + Ẽ t.
    #[inline(always)]
    pub(super) fn couple<L: Level>(&mut self, borders: &[RwLock<Vec<Wide<T>>>]) {
        for group in self.couplings.chunk_by(|a, b| a.other == b.other) {
            let t = borders[group[0].other as usize].read().expect("no thread panics");
            for coupling in group {
                let (w, t) = (&mut self.forth[coupling.row as usize], t[coupling.border as usize]);
                let mut sum = *w;
                for column in 0..3 {
                    for lane in 0..4 {
                        sum[lane] = coupling.columns[column][lane].mul_add::<L>(t[column], sum[lane]);
                    }
                }
                *w = sum;
            }
        }
    }

    /// w ← (I + L̃)⁻¹ w. Returns p · w.
    #[inline(always)]
    pub(super) fn forward<L: Level>(&mut self, pattern: &Pattern) -> f64 {
        let first = self.rows.start;
        let (p, w) = (&self.direction[..], &mut self.forth[..]);
        let mut along = [0.0; 4];
        for row in 0..w.len() {
            let here = w[row];
            add_products(&mut along, &p[row], &here);
            let number_of = first + row + 1 + self.blocks_before;
            for place in pattern.above(first + row).start..self.inner_end[row] as usize {
                let block = &self.by_rows[9 * (place - number_of)..][..9 + SLACK];
                let other = &mut w[pattern.columns()[place] as usize - first];
                let mut sums = [*other, [T::from_f64(0.0); 4], [T::from_f64(0.0); 4]];
                subtract_product::<T, L>(&mut sums, block, &here);
                *other = total(&sums);
            }
        }
        of_three(along)
    }

    /// x ← x + α t, r ← r − α (t + w). Returns r · r.
    #[inline(always)]
    pub(super) fn advance<L: Level>(&mut self, step: f64) -> f64 {
        let step = T::from_f64(step);
        let (t, w, x, r) = (&self.back[..], &self.forth[..], &mut self.solution[..], &mut self.residual[..]);
        let mut squares = [0.0; 4];
        for row in 0..r.len() {
            let (t, w, mut solution, mut rest) = (t[row], w[row], x[row], r[row]);
            for lane in 0..4 {
                solution[lane] = t[lane].mul_add::<L>(step, solution[lane]);
            }
            for lane in 0..4 {
                rest[lane] = (t[lane] + w[lane]).mul_add::<L>(-step, rest[lane]);
            }
            add_products(&mut squares, &rest, &rest);
            (x[row], r[row]) = (solution, rest);
        }
        of_three(squares)
    }

    /// C⁻ᵀ x s.
    #[inline(always)]
    pub(super) fn finish(&self, inverses: &[Inverse], scale: f64, x: &mut [Vector3<f64>]) {
        for row in 0..x.len() {
            let [u, v, w, _] = self.solution[row].map(|component| Into::<f64>::into(component) * scale);
            let [[a, b, d, _], [_, c, e, _], [_, _, f, _]] = inverses[row];
            x[row] = [a * u + b * v + d * w, c * v + e * w, f * w];
        }
    }
}

/// The places of the blocks that couple domains, with their rows and columns.
fn outer_blocks<T>(pattern: &Pattern, domains: &[Domain<T>]) -> Vec<(usize, [usize; 2])> {
    let of_row =
        |row: usize, inner_end: u32| (inner_end as usize..pattern.above(row).end).map(move |place| (row, place));
    let places = domains.iter().flat_map(|domain| {
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
fn couple<T: Precision>(domains: &mut [Domain<T>], ranges: &[Range<usize>], place: usize, between: [usize; 2]) {
    let ends = between.map(|row| local(ranges, row));
    for (own, with, turned) in [(ends[0], ends[1], false), (ends[1], ends[0], true)] {
        let border = domains[with.0].border.binary_search(&with.1).expect("it is on the border");
        domains[own.0].couplings.push(Coupling {
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

/// In the precision of a matrix.
#[inline(always)]
fn rounded<M: Precision>(inverse: &Inverse) -> [Wide<M>; 3] {
    let mut rounded = [[M::from_f64(0.0); 4]; 3];
    for column in 0..3 {
        for lane in 0..4 {
            rounded[column][lane] = M::from_f64(inverse[column][lane]);
        }
    }
    rounded
}

/// The rows of P B Qᵀ, for lower triangular P and Q given by columns: rows of B Qᵀ are sums of columns of Q, and those of the product sums of these.
#[inline(always)]
fn scaled_block<M: Precision, L: Level>(p: &[Wide<M>; 3], b: &Block<M>, q: &[Wide<M>; 3]) -> [Wide<M>; 3] {
    let zero = [M::from_f64(0.0); 4];
    let (mut right, mut scaled) = ([zero; 3], [zero; 3]);
    for i in 0..3 {
        for k in 0..3 {
            for lane in 0..4 {
                right[i][lane] = q[k][lane].mul_add::<L>(b[i][k], right[i][lane]);
            }
        }
    }
    let right = whole(right);
    for i in 0..3 {
        for k in 0..=i {
            for lane in 0..4 {
                scaled[i][lane] = right[k][lane].mul_add::<L>(p[k][i], scaled[i][lane]);
            }
        }
    }
    whole(scaled)
}

#[inline(always)]
fn transposed<M: Precision>([a, b, c]: &[Wide<M>; 3]) -> [Wide<M>; 3] {
    let zero = M::from_f64(0.0);
    [[a[0], b[0], c[0], zero], [a[1], b[1], c[1], zero], [a[2], b[2], c[2], zero]]
}

/// Writes three numbers of each row, and the fourth, which means nothing, where the next is written after it.
#[inline(always)]
fn store<T: Precision, M: Precision>(numbers: &mut [T], rows: &[Wide<M>; 3]) {
    for row in 0..3 {
        let place = &mut numbers[3 * row..3 * row + 4];
        for lane in 0..4 {
            place[lane] = T::from_f64(rows[row][lane].into());
        }
    }
}

/// The sum of three partial sums, which do not wait for each other.
#[inline(always)]
fn total<T: Precision>(sums: &[Wide<T>; 3]) -> Wide<T> {
    let mut total = sums[0];
    for lane in 0..4 {
        total[lane] = sums[0][lane] + (sums[1][lane] + sums[2][lane]);
    }
    total
}

/// Subtracts B v from the sum of three, B stored column by column (and followed by one more number).
#[inline(always)]
fn subtract_product<T: Precision, L: Level>(sums: &mut [Wide<T>; 3], block: &[T], v: &Wide<T>) {
    for column in 0..3 {
        let factor = -v[column];
        for lane in 0..4 {
            sums[column][lane] = block[3 * column + lane].mul_add::<L>(factor, sums[column][lane]);
        }
    }
}

/// The same. What is computed for nothing costs nothing, but without this compilers take registers apart that are not needed whole.
#[inline(always)]
fn whole<T>(registers: T) -> T {
    std::hint::black_box(registers)
}

/// The sum of the first three of four sums.
#[inline(always)]
fn of_three(sums: [f64; 4]) -> f64 {
    let [x, y, z, _] = whole(sums);
    x + y + z
}

/// Adds products of components, in doubles.
#[inline(always)]
fn add_products<T: Precision>(sums: &mut [f64; 4], a: &Wide<T>, b: &Wide<T>) {
    for lane in 0..4 {
        let product: f64 = (a[lane] * b[lane]).into();
        sums[lane] += product;
    }
}
