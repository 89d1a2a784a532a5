use std::ops::Range;
use std::sync::Arc;

use energy_dsl::{Kernel, Level, Number, dispatch};

use super::interpolation::Interpolation;
use crate::linear::domains::Precision;
use crate::matrix::block_matrix::BlockMatrix;
use crate::matrix::pattern::{Pattern, Storage, index};
use crate::threads::for_each;

/// Pᵀ A P for matrices A of one pattern. The scatter maps of the product are computed once.
///
/// With A = U + Uᵀ, where U has half of each diagonal block, the product is G + Gᵀ with G = Pᵀ (U P). The rows of U P
/// are summed one at a time.
#[derive(Clone, Debug)]
pub(super) struct GalerkinProduct {
    /// Pattern of the product.
    pattern: Arc<Pattern>,
    /// Number of blocks in each row of U P.
    sums: Vec<u16>,
    /// The block of the row of U P to which a product adds; sorted by row, block of U, and weight of the block's
    /// column.
    slots: Vec<u16>,
    /// The half of a block of G to which a product adds; sorted by row, weight, and block of U P.
    halves: Vec<u32>,
    parts: Vec<Part>,
}

/// Rows whose contributions are summed together.
#[derive(Clone, Debug)]
struct Part {
    rows: Range<usize>,
    /// The first entries of its rows in [`GalerkinProduct::slots`] and [`GalerkinProduct::halves`].
    first_slot: usize,
    first_half: usize,
    /// The range of halves to which the rows add.
    touched: Range<usize>,
}

/// A block of G, by rows: either as stored or as its transpose.
type Half = [f64; 9];

impl GalerkinProduct {
    /// Analyses a pattern. Each range of rows is summed on its own. `None` if a row is coupled with more aggregates
    /// than 16 bits count.
    pub(super) fn new<T: Precision>(
        fine: &Pattern,
        interpolation: &Interpolation<T>,
        ranges: &[Range<usize>],
    ) -> Option<Self> {
        let UpperTimes { columns, start, mut slots, slot_start } = UpperTimes::new(fine, interpolation)?;
        let of_row = |row: usize| &columns[start[row]..start[row + 1]];
        let sums = (0..fine.rows()).map(|row| u16::try_from(of_row(row).len()).ok()).collect::<Option<_>>()?;
        let of_rows = |rows: Range<usize>| {
            rows.flat_map(|row| {
                let others = of_row(row);
                interpolation.columns(row).iter().flat_map(move |&own| others.iter().map(move |&other| (own, other)))
            })
        };
        let upper = of_rows(0..fine.rows()).map(|(row, column)| (row.min(column), row.max(column)));
        let coarse = Pattern::from_pairs(Storage::Upper, interpolation.aggregates(), upper);
        let half = |(row, column): (u32, u32)| {
            let (slot, transposed) =
                coarse.slot(row as usize, column as usize).expect("the pattern contains every product");
            index(2 * slot + usize::from(transposed))
        };
        let mut halves = Vec::with_capacity(of_rows(0..fine.rows()).count());
        let part = |rows: &Range<usize>| {
            let first_half = halves.len();
            halves.extend(of_rows(rows.clone()).map(half));
            let of_part = || halves[first_half..].iter().map(|&half| half as usize);
            let touched = of_part().min().unwrap_or(0)..of_part().max().map_or(0, |last| last + 1);
            Part { rows: rows.clone(), first_slot: slot_start[rows.start], first_half, touched }
        };
        let parts = ranges.iter().map(part).collect();
        slots.shrink_to_fit();
        Some(Self { pattern: Arc::new(coarse), sums, slots, halves, parts })
    }

    /// Returns the pattern of the product.
    pub(super) fn pattern(&self) -> &Arc<Pattern> {
        &self.pattern
    }

    /// Computes the product on at most `threads` threads.
    pub(super) fn compute<T: Precision>(
        &self,
        fine: &BlockMatrix<impl Precision>,
        interpolation: &Interpolation<T>,
        threads: usize,
    ) -> BlockMatrix {
        let mut product = BlockMatrix::zeros(Arc::clone(&self.pattern));
        let blocks = product.values_mut();
        // Limit the parts at a time to the number of threads, to save memory.
        for parts in self.parts.chunks(threads.max(1)) {
            let contribution = |part| dispatch(Contribution { product: self, part, fine, interpolation });
            let contributions = for_each(threads, parts.iter().collect(), contribution);
            for (part, contribution) in parts.iter().zip(contributions) {
                for (half, sum) in part.touched.clone().zip(contribution) {
                    let (block, transposed) = (&mut blocks[half / 2], half % 2 == 1);
                    for i in 0..3 {
                        for j in 0..3 {
                            block[i][j] += if transposed { sum[3 * j + i] } else { sum[3 * i + j] };
                        }
                    }
                }
            }
        }
        for row in 0..self.pattern.rows() {
            let diagonal = product.diagonal_mut(row);
            *diagonal = std::array::from_fn(|i| std::array::from_fn(|j| diagonal[i][j] + diagonal[j][i]));
        }
        product
    }
}

/// The pattern of U P.
struct UpperTimes {
    /// The columns of each row's blocks, in order of first occurrence, and where each row begins.
    columns: Vec<u32>,
    start: Vec<usize>,
    /// The block of the row to which a product adds, sorted by row, block of U, and weight of the block's column; and
    /// where each row begins.
    slots: Vec<u16>,
    slot_start: Vec<usize>,
}

impl UpperTimes {
    /// `None` if a row has more blocks than 16 bits count.
    fn new<T: Precision>(fine: &Pattern, interpolation: &Interpolation<T>) -> Option<Self> {
        let mut product = Self { columns: Vec::new(), start: vec![0], slots: Vec::new(), slot_start: vec![0] };
        for row in 0..fine.rows() {
            let before = product.columns.len();
            let prolonged_from = fine.row(row).flat_map(|(_, column)| interpolation.columns(column));
            for &aggregate in prolonged_from {
                let known = product.columns[before..].iter().position(|&known| known == aggregate);
                product.slots.push(u16::try_from(known.unwrap_or(product.columns.len() - before)).ok()?);
                if known.is_none() {
                    product.columns.push(aggregate);
                }
            }
            product.start.push(product.columns.len());
            product.slot_start.push(product.slots.len());
        }
        Some(product)
    }
}

/// Computes the contributions of a part's rows.
struct Contribution<'a, T, M> {
    product: &'a GalerkinProduct,
    part: &'a Part,
    fine: &'a BlockMatrix<M>,
    interpolation: &'a Interpolation<T>,
}

impl<T: Precision, M: Precision> Kernel for Contribution<'_, T, M> {
    type Output = Vec<Half>;

    #[inline(always)]
    fn run<L: Level>(self) -> Vec<Half> {
        let Self { product, part, fine, interpolation } = self;
        let (pattern, values) = (fine.pattern(), fine.values().as_flattened().as_flattened().as_chunks::<9>().0);
        let mut sums = vec![[0.0; 9]; part.touched.len()];
        let mut row_of_product: Vec<Half> = Vec::new();
        let (mut slot, mut half_number) = (part.first_slot, part.first_half);
        for row in part.rows.clone() {
            row_of_product.clear();
            row_of_product.resize(product.sums[row] as usize, [0.0; 9]);
            let diagonal = pattern.diagonal(row);
            for block in diagonal..pattern.above(row).end {
                let share = if block == diagonal { 0.5 } else { 1.0 };
                for &weight in interpolation.weights(pattern.columns()[block] as usize) {
                    let weight: f64 = weight.into();
                    add_times::<M, L>(
                        &mut row_of_product[product.slots[slot] as usize],
                        share * weight,
                        &values[block],
                    );
                    slot += 1;
                }
            }
            for &weight in interpolation.weights(row) {
                for block in &row_of_product {
                    let half = product.halves[half_number] as usize - part.touched.start;
                    add_times::<f64, L>(&mut sums[half], weight.into(), block);
                    half_number += 1;
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

    /// A grid whose rows are coupled with their neighbours, also diagonally.
    fn grid(side: u32) -> Pattern {
        let vertex = |i: u32, j: u32| j * side + i;
        let cell = |(i, j)| [vertex(i, j), vertex(i + 1, j), vertex(i, j + 1), vertex(i + 1, j + 1)];
        let cells: Vec<[u32; 4]> = (1..side).flat_map(|j| (1..side).map(move |i| (i - 1, j - 1))).map(cell).collect();
        let rows = (side * side) as usize + 1; // and one uncoupled row
        Pattern::from_stencils(Storage::Upper, rows, cells.iter().map(<[u32; 4]>::as_slice))
    }

    fn dense(matrix: &BlockMatrix) -> DMatrix<f64> {
        let rows = 3 * matrix.pattern().rows();
        DMatrix::from_fn(rows, rows, |i, j| matrix.block(i / 3, j / 3)[i % 3][j % 3])
    }

    #[test]
    fn the_galerkin_product_is_the_dense_product() {
        let pattern = Arc::new(grid(11));
        let mut fine = BlockMatrix::zeros(Arc::clone(&pattern));
        let mut random = fastrand::Rng::with_seed(1);
        for entry in fine.values_mut().iter_mut().flatten().flatten() {
            *entry = random.f64() - 0.5;
        }
        for row in 0..pattern.rows() {
            let block = *fine.diagonal(row);
            *fine.diagonal_mut(row) = std::array::from_fn(|i| std::array::from_fn(|j| block[i.min(j)][i.max(j)]));
        }
        let interpolation = Interpolation::<f64>::averaged(&pattern);
        let p = DMatrix::from_fn(3 * pattern.rows(), 3 * interpolation.aggregates(), |i, j| {
            let carries = interpolation.columns(i / 3).iter().position(|&aggregate| aggregate as usize == j / 3);
            carries.map_or(0.0, |entry| if i % 3 == j % 3 { interpolation.weights(i / 3)[entry] } else { 0.0 })
        });
        let expected = p.transpose() * dense(&fine) * &p;
        for bounds in [[0, 122].as_slice(), &[0, 50, 80, 122]] {
            let ranges: Vec<_> = bounds.windows(2).map(|ends| ends[0]..ends[1]).collect();
            let product = GalerkinProduct::new(&pattern, &interpolation, &ranges).unwrap();
            for threads in [1, 2] {
                let computed = product.compute(&fine, &interpolation, threads);
                assert!((dense(&computed) - &expected).amax() < 1e-13);
            }
        }
    }

    #[test]
    fn prolongation_reproduces_translations_and_is_exact_at_roots() {
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
