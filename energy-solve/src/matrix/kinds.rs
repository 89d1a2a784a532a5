//! Symmetric sparse matrices over unknowns of 1, 2 and 3 increments.

use std::sync::Arc;

use super::block_matrix::BlockMatrix;
use super::pattern::{Pattern, Storage, index};

/// The largest number of increments of one unknown.
pub(crate) const MOST_INCREMENTS: usize = 3;

/// The unknowns of a [`KindMatrix`], and the blocks that it stores: one pattern per pair of sizes.
///
/// An unknown has 1, 2 or 3 *increments*, the coordinates in which it moves. Vectors of increments hold all unknowns of
/// three, then those of two, then those of one, each in the order of the unknowns.
#[derive(Debug)]
pub struct KindPattern {
    /// Increments of each unknown.
    sizes: Vec<u8>,
    /// Number of each unknown among those of its size.
    numbers: Vec<u32>,
    /// Number of unknowns of 1, 2 and 3 increments.
    counts: [usize; MOST_INCREMENTS],
    /// Blocks above the diagonal and on it, for unknowns of equal size: 1, 2 and 3.
    square: [Arc<Pattern>; MOST_INCREMENTS],
    two_one: Coupling,
    three_one: Coupling,
    three_two: Coupling,
    /// The unknowns of each stored block: blocks of 1×1, 2×2, 3×3, 2×1, 3×1 and 3×2, each in the order of their slots.
    pairs: Vec<[u32; 2]>,
}

/// The positions of the blocks between unknowns of two sizes. Rows are the unknowns of the larger size.
#[derive(Debug, PartialEq, Eq)]
struct Coupling {
    row_start: Vec<u32>,
    columns: Vec<u32>,
}

/// The place of a block in a [`KindMatrix`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct KindSlot {
    /// Index of the block among those of its pair of sizes.
    pub(crate) slot: u32,
    /// Whether the transpose is stored.
    pub(crate) flipped: bool,
}

impl KindPattern {
    /// Creates the pattern that couples all unknowns of each stencil. Unknown i has `sizes[i]` increments.
    ///
    /// # Panics
    /// If a size is not 1, 2 or 3, a stencil names an unknown that does not exist, or there are more than 2³² blocks.
    #[must_use]
    pub fn from_stencils<'a, S>(sizes: &[usize], stencils: S) -> Self
    where
        S: IntoIterator<Item = &'a [u32], IntoIter: Clone>,
    {
        let mut counts = [0; MOST_INCREMENTS];
        let mut numbers = Vec::with_capacity(sizes.len());
        for &size in sizes {
            assert!((1..=MOST_INCREMENTS).contains(&size), "an unknown has 1, 2 or 3 increments, not {size}");
            numbers.push(index(counts[size - 1]));
            counts[size - 1] += 1;
        }
        let pairs = |stencil: &'a [u32]| stencil.iter().flat_map(|&row| stencil.iter().map(move |&to| (row, to)));
        let all = stencils.into_iter().flat_map(pairs);
        let between = |row_size: usize, column_size: usize| {
            let numbers = &numbers;
            let of_sizes =
                move |&(row, to): &(u32, u32)| sizes[row as usize] == row_size && sizes[to as usize] == column_size;
            all.clone().filter(of_sizes).map(move |(row, to)| (numbers[row as usize], numbers[to as usize]))
        };
        let square = |size| Arc::new(Pattern::from_pairs(Storage::Upper, counts[size - 1], between(size, size)));
        let coupling = |rows: usize, columns: usize| Coupling::from_pairs(counts[rows - 1], between(rows, columns));
        let mut pattern = Self {
            sizes: sizes.iter().map(|&size| size as u8).collect(),
            counts,
            square: [1, 2, 3].map(square),
            two_one: coupling(2, 1),
            three_one: coupling(3, 1),
            three_two: coupling(3, 2),
            pairs: Vec::new(),
            numbers,
        };
        pattern.list_pairs();
        pattern
    }

    /// Returns the number of unknowns.
    #[must_use]
    pub fn unknowns(&self) -> usize {
        self.sizes.len()
    }

    /// Returns the number of increments of all unknowns: the rows of the matrix.
    #[must_use]
    pub fn increments(&self) -> usize {
        let [ones, twos, threes] = self.counts;
        ones + 2 * twos + 3 * threes
    }

    /// Returns the number of increments of one unknown.
    #[must_use]
    pub fn size(&self, unknown: usize) -> usize {
        self.sizes[unknown].into()
    }

    /// Returns the position of an unknown's first increment in vectors.
    #[must_use]
    pub fn first(&self, unknown: usize) -> usize {
        let size = self.size(unknown);
        self.start_of(size) + size * self.numbers[unknown] as usize
    }

    /// Returns the number of stored blocks.
    #[must_use]
    pub fn blocks(&self) -> usize {
        self.pairs.len()
    }

    /// Returns the position of the first increment of all unknowns of a size.
    fn start_of(&self, size: usize) -> usize {
        let [_, twos, threes] = self.counts;
        [3 * threes + 2 * twos, 3 * threes, 0][size - 1]
    }

    /// Returns the pattern between unknowns of two sizes, `rows` > `columns`.
    fn coupling(&self, rows: usize, columns: usize) -> &Coupling {
        match (rows, columns) {
            (2, 1) => &self.two_one,
            (3, 1) => &self.three_one,
            _ => &self.three_two,
        }
    }

    /// Returns the place of the block of two unknowns; `None` if it is not in the pattern.
    pub(crate) fn slot(&self, row: usize, column: usize) -> Option<KindSlot> {
        let (row_size, column_size) = (self.size(row), self.size(column));
        if row == column {
            let slot = self.square[row_size - 1].diagonal(self.numbers[row] as usize);
            return Some(KindSlot { slot: index(slot), flipped: false });
        }
        let (row, column) = (self.numbers[row], self.numbers[column]);
        if row_size == column_size {
            let (slot, flipped) = self.square[row_size - 1].slot(row as usize, column as usize)?;
            return Some(KindSlot { slot: index(slot), flipped });
        }
        let flipped = row_size < column_size;
        let (rows, columns) = (row_size.max(column_size), row_size.min(column_size));
        let (row, column) = if flipped { (column, row) } else { (row, column) };
        let slot = self.coupling(rows, columns).slot(row, column)?;
        Some(KindSlot { slot, flipped })
    }

    /// Returns the coupled pairs of different unknowns, each once.
    pub(crate) fn couplings(&self) -> impl Iterator<Item = (usize, usize)> {
        self.pairs.iter().map(|[row, column]| (*row as usize, *column as usize)).filter(|(row, column)| row != column)
    }

    /// Lists the unknowns of each stored block.
    fn list_pairs(&mut self) {
        let mut of_size: [Vec<u32>; MOST_INCREMENTS] = self.counts.map(Vec::with_capacity);
        for unknown in 0..self.unknowns() {
            of_size[self.size(unknown) - 1].push(index(unknown));
        }
        for size in 1..=MOST_INCREMENTS {
            let (pattern, unknowns) = (&self.square[size - 1], &of_size[size - 1]);
            for row in 0..pattern.rows() {
                self.pairs.extend(pattern.row(row).map(|(_, column)| [unknowns[row], unknowns[column]]));
            }
        }
        for (rows, columns) in [(2, 1), (3, 1), (3, 2)] {
            let pairs: Vec<_> = self.coupling(rows, columns).pairs().collect();
            let unknowns = |(row, column): (usize, usize)| [of_size[rows - 1][row], of_size[columns - 1][column]];
            self.pairs.extend(pairs.into_iter().map(unknowns));
        }
    }
}

impl Coupling {
    fn from_pairs(rows: usize, pairs: impl Iterator<Item = (u32, u32)>) -> Self {
        let mut sorted: Vec<(u32, u32)> = pairs.collect();
        sorted.sort_unstable();
        sorted.dedup();
        let mut row_start = vec![0; rows + 1];
        sorted.iter().for_each(|&(row, _)| row_start[row as usize + 1] += 1);
        for row in 0..rows {
            row_start[row + 1] += row_start[row];
        }
        Self { row_start, columns: sorted.into_iter().map(|(_, column)| column).collect() }
    }

    fn slot(&self, row: u32, column: u32) -> Option<u32> {
        let (start, end) = (self.row_start[row as usize], self.row_start[row as usize + 1]);
        let found = self.columns[start as usize..end as usize].binary_search(&column).ok()?;
        Some(start + index(found))
    }

    fn pairs(&self) -> impl Iterator<Item = (usize, usize)> {
        (0..self.row_start.len() - 1).flat_map(|row| {
            let blocks = self.row_start[row] as usize..self.row_start[row + 1] as usize;
            self.columns[blocks].iter().map(move |&column| (row, column as usize))
        })
    }
}

/// A symmetric matrix over unknowns of 1, 2 and 3 increments. Each pair of sizes has blocks of a fixed size; those of
/// 3×3 are a [`BlockMatrix`].
///
/// ```
/// use energy_solve::{KindMatrix, KindPattern};
///
/// // A point coupled to an angle: 2 N/m on the point, 3 N m/rad on the angle, 1 N/rad between z and the angle.
/// let mut matrix = KindMatrix::zeros(KindPattern::from_stencils(&[3, 1], [&[0, 1][..]]).into());
/// matrix.add(0, 0, |row, column| if row == column { 2.0 } else { 0.0 });
/// matrix.add(1, 1, |_, _| 3.0);
/// matrix.add(0, 1, |row, _| if row == 2 { 1.0 } else { 0.0 });
/// let mut y = [0.0; 4];
/// matrix.multiply(&[0.0, 1.0, 1.0, 1.0], &mut y);
/// assert_eq!(y, [0.0, 2.0, 3.0, 4.0]);
/// ```
#[derive(Clone, Debug)]
pub struct KindMatrix {
    pattern: Arc<KindPattern>,
    ones: Vec<[[f64; 1]; 1]>,
    twos: Vec<[[f64; 2]; 2]>,
    threes: BlockMatrix,
    two_one: Vec<[[f64; 1]; 2]>,
    three_one: Vec<[[f64; 1]; 3]>,
    three_two: Vec<[[f64; 2]; 3]>,
}

/// Reads the blocks of a matrix.
pub(crate) trait BlockVisitor {
    /// Reads the block of two unknowns. Diagonal blocks are whole.
    fn block<const R: usize, const C: usize>(&mut self, row: usize, column: usize, block: &[[f64; C]; R]);
}

impl KindMatrix {
    /// Creates the zero matrix of a pattern.
    #[must_use]
    pub fn zeros(pattern: Arc<KindPattern>) -> Self {
        let [ones, twos, threes] = &pattern.square;
        Self {
            ones: vec![[[0.0]]; ones.blocks()],
            twos: vec![[[0.0; 2]; 2]; twos.blocks()],
            threes: BlockMatrix::zeros(Arc::clone(threes)),
            two_one: vec![[[0.0]; 2]; pattern.two_one.columns.len()],
            three_one: vec![[[0.0]; 3]; pattern.three_one.columns.len()],
            three_two: vec![[[0.0; 2]; 3]; pattern.three_two.columns.len()],
            pattern,
        }
    }

    /// Returns the unknowns and the blocks.
    #[must_use]
    pub fn pattern(&self) -> &Arc<KindPattern> {
        &self.pattern
    }

    /// Returns the blocks between unknowns of three increments.
    #[must_use]
    pub fn threes(&self) -> &BlockMatrix {
        &self.threes
    }

    /// Sets all entries to zero.
    pub fn clear(&mut self) {
        self.ones.fill([[0.0]]);
        self.twos.fill([[0.0; 2]; 2]);
        self.threes.values_mut().fill([[0.0; 3]; 3]);
        self.two_one.fill([[0.0]; 2]);
        self.three_one.fill([[0.0]; 3]);
        self.three_two.fill([[0.0; 2]; 3]);
    }

    /// Adds to the block of two unknowns; and, as the matrix is symmetric, to its transpose. Entry (i, j) is that of
    /// increment i of the first unknown and j of the second.
    ///
    /// # Panics
    /// If the block is not in the pattern.
    pub fn add(&mut self, row: usize, column: usize, entry: impl Fn(usize, usize) -> f64) {
        let slot = self.pattern.slot(row, column).expect("the block is in the pattern");
        let sizes = (self.pattern.size(row), self.pattern.size(column));
        self.add_at(slot, sizes, entry);
    }

    /// [`Self::add`] at a known place.
    #[inline(always)]
    pub(crate) fn add_at(&mut self, at: KindSlot, sizes: (usize, usize), entry: impl Fn(usize, usize) -> f64) {
        let (slot, flipped) = (at.slot as usize, at.flipped);
        match sizes {
            (1, 1) => add_block(&mut self.ones[slot], flipped, entry),
            (2, 2) => add_block(&mut self.twos[slot], flipped, entry),
            (3, 3) => add_block(&mut self.threes.values_and_nowhere()[slot], flipped, entry),
            (2, 1) | (1, 2) => add_block(&mut self.two_one[slot], flipped, entry),
            (3, 1) | (1, 3) => add_block(&mut self.three_one[slot], flipped, entry),
            _ => add_block(&mut self.three_two[slot], flipped, entry),
        }
    }

    /// Returns the diagonal block of an unknown, padded with zeros.
    pub(crate) fn diagonal(&self, unknown: usize) -> [[f64; MOST_INCREMENTS]; MOST_INCREMENTS] {
        let number = self.pattern.numbers[unknown] as usize;
        let slot = |size: usize| self.pattern.square[size - 1].diagonal(number);
        match self.pattern.size(unknown) {
            1 => padded(&self.ones[slot(1)]),
            2 => padded(&self.twos[slot(2)]),
            _ => *self.threes.diagonal(number),
        }
    }

    /// Computes y ← A x.
    ///
    /// # Panics
    /// If the vectors do not have one number per increment.
    pub fn multiply(&self, x: &[f64], y: &mut [f64]) {
        let increments = self.pattern.increments();
        assert!(x.len() == increments && y.len() == increments, "vectors have {increments} numbers");
        let KindPattern { square: [ones, twos, _], two_one, three_one, three_two, .. } = &*self.pattern;
        let (from_twos, from_ones) = (self.pattern.start_of(2), self.pattern.start_of(1));
        let (x3, x) = x.split_at(from_twos);
        let (x2, x1) = x.split_at(from_ones - from_twos);
        let (y3, y) = y.split_at_mut(from_twos);
        let (y2, y1) = y.split_at_mut(from_ones - from_twos);
        let (x3, x2, x1) = (x3.as_chunks::<3>().0, x2.as_chunks::<2>().0, x1.as_chunks::<1>().0);
        let (y3, y2, y1) = (y3.as_chunks_mut::<3>().0, y2.as_chunks_mut::<2>().0, y1.as_chunks_mut::<1>().0);
        self.threes.multiply(x3, y3);
        multiply_square(twos, &self.twos, x2, y2);
        multiply_square(ones, &self.ones, x1, y1);
        add_coupling(three_two, &self.three_two, (x3, x2), (y3, y2));
        add_coupling(three_one, &self.three_one, (x3, x1), (y3, y1));
        add_coupling(two_one, &self.two_one, (x2, x1), (y2, y1));
    }

    /// Visits each stored block.
    #[inline(always)]
    pub(crate) fn visit(&self, visitor: &mut impl BlockVisitor) {
        let mut pairs = self.pattern.pairs.iter();
        visit_blocks(&self.ones, &mut pairs, visitor);
        visit_blocks(&self.twos, &mut pairs, visitor);
        visit_blocks(self.threes.values(), &mut pairs, visitor);
        visit_blocks(&self.two_one, &mut pairs, visitor);
        visit_blocks(&self.three_one, &mut pairs, visitor);
        visit_blocks(&self.three_two, &mut pairs, visitor);
    }
}

/// Visits blocks whose unknowns come next in `pairs`.
#[inline(always)]
fn visit_blocks<'a, const R: usize, const C: usize>(
    blocks: &[[[f64; C]; R]],
    pairs: &mut impl Iterator<Item = &'a [u32; 2]>,
    visitor: &mut impl BlockVisitor,
) {
    for (block, &[row, column]) in blocks.iter().zip(pairs) {
        visitor.block(row as usize, column as usize, block);
    }
}

/// Adds a block, or its transpose.
#[inline(always)]
fn add_block<const R: usize, const C: usize>(
    to: &mut [[f64; C]; R],
    flipped: bool,
    entry: impl Fn(usize, usize) -> f64,
) {
    for row in 0..R {
        for column in 0..C {
            to[row][column] += if flipped { entry(column, row) } else { entry(row, column) };
        }
    }
}

/// Returns a block of 3×3 that begins with this one.
fn padded<const N: usize>(block: &[[f64; N]; N]) -> [[f64; MOST_INCREMENTS]; MOST_INCREMENTS] {
    let mut all = [[0.0; MOST_INCREMENTS]; MOST_INCREMENTS];
    for (row, entries) in all.iter_mut().zip(block) {
        row[..N].copy_from_slice(entries);
    }
    all
}

/// Computes y ← A x for a symmetric matrix whose upper triangle is stored.
fn multiply_square<const N: usize>(pattern: &Pattern, blocks: &[[[f64; N]; N]], x: &[[f64; N]], y: &mut [[f64; N]]) {
    y.fill([0.0; N]);
    for row in 0..pattern.rows() {
        for (slot, column) in pattern.row(row) {
            add_product(&blocks[slot], &x[column], &mut y[row]);
            if column != row {
                add_transposed_product(&blocks[slot], &x[row], &mut y[column]);
            }
        }
    }
}

/// Adds B x to the rows' part of y, and Bᵀ x to the columns' part.
fn add_coupling<const R: usize, const C: usize>(
    pattern: &Coupling,
    blocks: &[[[f64; C]; R]],
    (x_rows, x_columns): (&[[f64; R]], &[[f64; C]]),
    (y_rows, y_columns): (&mut [[f64; R]], &mut [[f64; C]]),
) {
    for (block, (row, column)) in blocks.iter().zip(pattern.pairs()) {
        add_product(block, &x_columns[column], &mut y_rows[row]);
        add_transposed_product(block, &x_rows[row], &mut y_columns[column]);
    }
}

/// y ← y + B x.
fn add_product<const R: usize, const C: usize>(block: &[[f64; C]; R], x: &[f64; C], y: &mut [f64; R]) {
    for (sum, row) in y.iter_mut().zip(block) {
        *sum += row.iter().zip(x).map(|(entry, x)| entry * x).sum::<f64>();
    }
}

/// y ← y + Bᵀ x.
fn add_transposed_product<const R: usize, const C: usize>(block: &[[f64; C]; R], x: &[f64; R], y: &mut [f64; C]) {
    for (row, x) in block.iter().zip(x) {
        y.iter_mut().zip(row).for_each(|(sum, entry)| *sum += entry * x);
    }
}
