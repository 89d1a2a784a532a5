use std::ops::Range;
use std::sync::Arc;

use energy_dsl::{Kernel, Level, Number, dispatch};

use super::interpolation::Interpolation;
use crate::domains::Precision;
use crate::matrix::BlockMatrix;
use crate::pattern::{Pattern, Storage, index};
use crate::threads::for_each;

/// Pᵀ A P, for matrices A of one pattern: where each block goes is found once.
///
/// With A = U + Uᵀ, half of each diagonal block in U, it is G + Gᵀ with G = Pᵀ (U P). The rows of U P are summed up one by one.
#[derive(Clone, Debug)]
pub(super) struct GalerkinProduct {
    /// By row, how many blocks that of U P has.
    sums: Vec<u32>,
    /// By row, block of U and weight of the block's column: to which of them they add.
    slot_start: Vec<u32>,
    slots: Vec<u32>,
    /// By row, weight and block of U P: to which half of which block of G they add.
    half_start: Vec<u32>,
    halves: Vec<u32>,
    parts: Vec<Part>,
}

/// Rows whose contributions are summed up together.
#[derive(Clone, Debug)]
struct Part {
    rows: Range<usize>,
    /// The halves that they add to, and those between.
    halves: Range<usize>,
}

/// A block of G as it is, or the one that its mirror image adds to: by rows.
type Half = [f64; 9];

impl GalerkinProduct {
    /// For matrices of a pattern, and the pattern of the product. `ranges` of rows are summed up by themselves.
    pub(super) fn new<T: Precision>(
        fine: &Pattern,
        interpolation: &Interpolation<T>,
        ranges: &[Range<usize>],
    ) -> (Self, Arc<Pattern>) {
        let (mut sums, mut slots, mut slot_start) = (Vec::new(), Vec::new(), vec![0]);
        let (mut touched, mut pairs): (Vec<u32>, Vec<[u32; 2]>) = (Vec::new(), Vec::new());
        for row in 0..fine.rows() {
            touched.clear();
            for (_, column) in fine.row(row) {
                for aggregate in interpolation.columns(column) {
                    let known = touched.iter().position(|known| known == aggregate);
                    slots.push(index(known.unwrap_or(touched.len())));
                    if known.is_none() {
                        touched.push(*aggregate);
                    }
                }
            }
            let own = interpolation.columns(row);
            pairs.extend(own.iter().flat_map(|&own| touched.iter().map(move |&other| [own, other])));
            sums.push(index(touched.len()));
            slot_start.push(index(slots.len()));
        }
        let stencils = pairs.iter().map(<[u32; 2]>::as_slice);
        let coarse = Pattern::from_stencils(Storage::Upper, interpolation.aggregates(), stencils);
        let half = |&[row, column]: &[u32; 2]| {
            let (place, turned) = coarse.place(row as usize, column as usize).expect("it is coupled");
            index(2 * place + usize::from(turned))
        };
        let halves: Vec<u32> = pairs.iter().map(half).collect();
        let mut half_start = vec![0];
        for row in 0..fine.rows() {
            half_start.push(half_start[row] + index(interpolation.columns(row).len()) * sums[row]);
        }
        let part = |rows: &Range<usize>| {
            let touched = &halves[half_start[rows.start] as usize..half_start[rows.end] as usize];
            let first = touched.iter().min().map_or(0, |&first| first as usize);
            let halves = first..touched.iter().max().map_or(first, |&last| last as usize + 1);
            Part { rows: rows.clone(), halves }
        };
        let parts = ranges.iter().map(part).collect();
        slots.shrink_to_fit();
        (Self { sums, slot_start, slots, half_start, halves, parts }, Arc::new(coarse))
    }

    /// Computes the product, on at most so many threads.
    pub(super) fn compute<T: Precision>(
        &self,
        fine: &BlockMatrix<impl Precision>,
        interpolation: &Interpolation<T>,
        threads: usize,
        coarse: &mut BlockMatrix,
    ) {
        let contribution = |part| dispatch(Contribution { of: self, part, fine, interpolation });
        let contributions = for_each(threads, self.parts.iter().collect(), contribution);
        let mut whole = vec![[0.0; 9]; 2 * coarse.pattern().blocks()];
        for (part, sums) in self.parts.iter().zip(contributions) {
            for (sum, half) in whole[part.halves.clone()].iter_mut().zip(&sums) {
                (0..9).for_each(|entry| sum[entry] += half[entry]);
            }
        }
        let pattern = Arc::clone(coarse.pattern());
        for (block, halves) in coarse.values_mut().iter_mut().zip(whole.as_chunks::<2>().0) {
            for i in 0..3 {
                for j in 0..3 {
                    block[i][j] = halves[0][3 * i + j] + halves[1][3 * j + i];
                }
            }
        }
        for row in 0..pattern.rows() {
            let half = whole[2 * pattern.diagonal(row)];
            for i in 0..3 {
                for j in 0..3 {
                    coarse.diagonal_mut(row)[i][j] = half[3 * i + j] + half[3 * j + i];
                }
            }
        }
    }
}

/// What the rows of a part contribute.
struct Contribution<'a, T, M> {
    of: &'a GalerkinProduct,
    part: &'a Part,
    fine: &'a BlockMatrix<M>,
    interpolation: &'a Interpolation<T>,
}

impl<T: Precision, M: Precision> Kernel for Contribution<'_, T, M> {
    type Output = Vec<Half>;

    #[inline(always)]
    fn run<L: Level>(self) -> Vec<Half> {
        let Self { of, part, fine, interpolation } = self;
        let (pattern, values) = (fine.pattern(), fine.values().as_flattened().as_flattened().as_chunks::<9>().0);
        let mut sums = vec![[0.0; 9]; part.halves.len()];
        let mut row_of_product: Vec<Half> = Vec::new();
        for row in part.rows.clone() {
            row_of_product.clear();
            row_of_product.resize(of.sums[row] as usize, [0.0; 9]);
            let mut slot = of.slot_start[row] as usize;
            let diagonal = pattern.diagonal(row);
            for place in diagonal..pattern.above(row).end {
                let share = if place == diagonal { 0.5 } else { 1.0 };
                for &weight in interpolation.weights(pattern.columns()[place] as usize) {
                    let weight: f64 = weight.into();
                    add_times::<M, L>(&mut row_of_product[of.slots[slot] as usize], share * weight, &values[place]);
                    slot += 1;
                }
            }
            let mut place = of.half_start[row] as usize;
            for &weight in interpolation.weights(row) {
                for block in &row_of_product {
                    let half = of.halves[place] as usize - part.halves.start;
                    add_times::<f64, L>(&mut sums[half], weight.into(), block);
                    place += 1;
                }
            }
        }
        sums
    }
}

/// A ← A + s B.
#[inline(always)]
fn add_times<M: Precision, L: Level>(sum: &mut Half, scale: f64, block: &[M; 9]) {
    for entry in 0..9 {
        sum[entry] = Number::mul_add::<L>(block[entry].into(), scale, sum[entry]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DMatrix;

    /// A grid whose rows are coupled with those beside, below and across.
    fn grid(side: u32) -> Pattern {
        let vertex = |i: u32, j: u32| j * side + i;
        let cell = |(i, j)| [vertex(i, j), vertex(i + 1, j), vertex(i, j + 1), vertex(i + 1, j + 1)];
        let cells: Vec<[u32; 4]> = (1..side).flat_map(|j| (1..side).map(move |i| (i - 1, j - 1))).map(cell).collect();
        let rows = (side * side) as usize + 1; // and one that is coupled with none
        Pattern::from_stencils(Storage::Upper, rows, cells.iter().map(<[u32; 4]>::as_slice))
    }

    fn dense(matrix: &BlockMatrix) -> DMatrix<f64> {
        let rows = 3 * matrix.pattern().rows();
        DMatrix::from_fn(rows, rows, |i, j| matrix.block(i / 3, j / 3)[i % 3][j % 3])
    }

    #[test]
    fn it_is_the_dense_product() {
        let pattern = Arc::new(grid(11));
        let mut fine = BlockMatrix::zeros(Arc::clone(&pattern));
        let mut seed = 1_u64;
        for entry in fine.values_mut().iter_mut().flatten().flatten() {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            *entry = (seed >> 11) as f64 / (1_u64 << 53) as f64 - 0.5;
        }
        for row in 0..pattern.rows() {
            let block = *fine.diagonal(row);
            *fine.diagonal_mut(row) = std::array::from_fn(|i| std::array::from_fn(|j| block[i.min(j)][i.max(j)]));
        }
        let interpolation = Interpolation::<f64>::averaged(&pattern);
        let p = DMatrix::from_fn(3 * pattern.rows(), 3 * interpolation.aggregates(), |i, j| {
            let carries = interpolation.columns(i / 3).iter().position(|&aggregate| aggregate as usize == j / 3);
            carries.map_or(0.0, |place| if i % 3 == j % 3 { interpolation.weights(i / 3)[place] } else { 0.0 })
        });
        let expected = p.transpose() * dense(&fine) * &p;
        for bounds in [[0, 122].as_slice(), &[0, 50, 80, 122]] {
            let ranges: Vec<_> = bounds.windows(2).map(|ends| ends[0]..ends[1]).collect();
            let (product, coarse) = GalerkinProduct::new(&pattern, &interpolation, &ranges);
            let mut computed = BlockMatrix::zeros(coarse);
            for _ in 0..2 {
                product.compute(&fine, &interpolation, 2, &mut computed);
                assert!((dense(&computed) - &expected).amax() < 1e-13);
            }
        }
    }

    #[test]
    fn translations_are_carried_and_roots_by_their_own() {
        let pattern = grid(11);
        let interpolation = Interpolation::<f64>::averaged(&pattern);
        let mut roots = vec![0; interpolation.aggregates()];
        for row in 0..pattern.rows() - 1 {
            let sum: f64 = interpolation.weights(row).iter().sum();
            assert!((sum - 1.0).abs() < 1e-15, "{sum}");
            if let [aggregate] = interpolation.columns(row) {
                roots[*aggregate as usize] += 1;
            }
        }
        assert!(roots.iter().all(|&rows| rows > 0), "{roots:?}");
        assert!(interpolation.columns(pattern.rows() - 1).is_empty());
    }
}
