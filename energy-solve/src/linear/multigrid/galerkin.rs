use std::ops::Range;
use std::sync::Arc;

use energy_dsl::{Block, Kernel, Level, Number, dispatch};

use super::interpolation::Interpolation;
use crate::linear::domains::Precision;
use crate::matrix::block_matrix::BlockMatrix;
use crate::matrix::cross_blocks::{CrossBlocks, CrossEntry};
use crate::matrix::pattern::{Pattern, Storage, index};
use crate::matrix::vector::{add_scaled_block, transposed};
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

/// A block, by its number in a list, that is added to one above the diagonal of a product.
struct Summand {
    row: u32,
    column: u32,
    weight: f64,
    block: usize,
}

/// Adds Pᵀ (X + Xᵀ) P to a product, where X holds the blocks that the fine matrix lacks. Returns the blocks that the
/// product lacks.
pub(super) fn add_product<T: Precision>(
    cross: &CrossBlocks,
    interpolation: &Interpolation<T>,
    product: &mut BlockMatrix,
) -> CrossBlocks {
    let rows = product.pattern().rows();
    // The blocks of X P, each followed by its transpose, and the places of the product to which they add.
    let (mut blocks, mut summands): (Vec<Block<f64>>, Vec<Summand>) = (Vec::new(), Vec::new());
    let mut of_row: Vec<(u32, Block<f64>)> = Vec::new();
    for row in 0..interpolation.rows() {
        of_row.clear();
        for (_, column, block) in cross.of_row(row) {
            for (aggregate, weight) in interpolation.weighted(column as usize) {
                let known = of_row.iter().position(|(known, _)| *known == aggregate).unwrap_or_else(|| {
                    of_row.push((aggregate, [[0.0; 3]; 3]));
                    of_row.len() - 1
                });
                add_scaled_block(&mut of_row[known].1, weight, block);
            }
        }
        for (own, weight) in interpolation.weighted(row) {
            for (number, (other, block)) in of_row.iter().enumerate() {
                if own == *other {
                    let diagonal = product.diagonal_mut(own as usize);
                    add_scaled_block(diagonal, weight, block);
                    add_scaled_block(diagonal, weight, &transposed(block));
                } else {
                    let block = blocks.len() + 2 * number + usize::from(own > *other);
                    summands.push(Summand { row: own.min(*other), column: own.max(*other), weight, block });
                }
            }
        }
        blocks.extend(of_row.iter().flat_map(|(_, block)| [*block, transposed(block)]));
    }
    let entry = |&Summand { row, column, weight, block }: &Summand| CrossEntry {
        row,
        column,
        share: weight,
        block: &blocks[block],
    };
    let sums = CrossBlocks::summed(rows, &[summands.iter().map(entry).collect()]);
    let mut beyond = Vec::new();
    for row in 0..rows {
        for (_, column, block) in sums.of_row(row) {
            match product.pattern().slot(row, column as usize) {
                Some((slot, _)) => add_scaled_block(&mut product.values_mut()[slot], 1.0, block),
                None => beyond.push(CrossEntry { row: index(row), column, share: 1.0, block }),
            }
        }
    }
    CrossBlocks::summed(rows, &[beyond])
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

    fn dense_interpolation(interpolation: &Interpolation<f64>) -> DMatrix<f64> {
        DMatrix::from_fn(3 * interpolation.rows(), 3 * interpolation.aggregates(), |i, j| {
            let carries = interpolation.weighted(i / 3).find(|(aggregate, _)| *aggregate as usize == j / 3);
            carries.map_or(0.0, |(_, weight)| if i % 3 == j % 3 { weight } else { 0.0 })
        })
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
        let p = dense_interpolation(&interpolation);
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
    fn blocks_beyond_the_pattern_are_part_of_the_product() {
        let pattern = Arc::new(grid(11));
        let rows = pattern.rows();
        let interpolation = Interpolation::<f64>::averaged(&pattern);
        let product = GalerkinProduct::new(&pattern, &interpolation, &[Range { start: 0, end: rows }]).unwrap();
        let mut random = fastrand::Rng::with_seed(7);
        // Far from each other, and near enough to fall into one aggregate or into two that are coupled.
        let mut places = Vec::new();
        for number in 0..60 {
            let row = random.usize(0..rows - 40);
            let column = row + if number % 2 == 0 { random.usize(2..5) } else { random.usize(14..40) };
            if pattern.slot(row, column).is_none() {
                let block: Block<f64> = std::array::from_fn(|_| std::array::from_fn(|_| random.f64() - 0.5));
                places.push((index(row), index(column), block));
            }
        }
        let entries =
            places.iter().map(|(row, column, block)| CrossEntry { row: *row, column: *column, share: 1.0, block });
        let cross = CrossBlocks::summed(rows, &[entries.collect()]);
        let mut coarse = product.compute(&BlockMatrix::<f64>::zeros(Arc::clone(&pattern)), &interpolation, 1);
        let beyond = add_product(&cross, &interpolation, &mut coarse);
        assert!(!beyond.is_empty() && beyond.len() < cross.len() * 9);
        let expand = |matrix: DMatrix<f64>, cross: &CrossBlocks| {
            let mut sum = matrix;
            for row in 0..sum.nrows() / 3 {
                for (_, column, block) in cross.of_row(row) {
                    for (i, j) in (0..9).map(|number| (number / 3, number % 3)) {
                        sum[(3 * row + i, 3 * column as usize + j)] += block[i][j];
                        sum[(3 * column as usize + j, 3 * row + i)] += block[i][j];
                    }
                }
            }
            sum
        };
        let p = dense_interpolation(&interpolation);
        let expected = p.transpose() * expand(DMatrix::zeros(3 * rows, 3 * rows), &cross) * &p;
        assert!((expand(dense(&coarse), &beyond) - expected).amax() < 1e-13);
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
