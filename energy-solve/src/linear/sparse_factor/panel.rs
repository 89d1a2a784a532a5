//! Dense panels: the columns of a supernode, column by column.

use std::ops::Range;

use energy_dsl::{Kernel, Lane, Level, Number, dispatch};

use super::supernodes::Supernode;

/// Columns that are factored one by one; wider panels are divided.
const NARROW: usize = 16;

/// Registers of rows of a product that are computed at a time.
const REGISTERS: usize = 2;

/// The panel of a factored supernode.
pub(super) struct Panel<'a> {
    entries: &'a [f64],
    size: usize,
    supernode: &'a Supernode,
}

/// The panel of a supernode that is being factored.
pub(super) struct PanelMut<'a> {
    entries: &'a mut [f64],
    size: usize,
    /// Scalar rows and columns.
    rows: usize,
    columns: usize,
}

/// Memory for the product of two parts of a panel.
#[derive(Default)]
pub(super) struct Product(Vec<f64>);

impl<'a> Panel<'a> {
    /// `entries` start with the panel of the supernode, whose groups have `size` unknowns.
    pub fn new(entries: &'a [f64], size: usize, supernode: &'a Supernode) -> Self {
        Self { entries: &entries[..size * size * supernode.rows.len() * supernode.columns.len()], size, supernode }
    }

    /// Returns the scalar rows of the panel.
    fn rows(&self) -> usize {
        self.size * self.supernode.rows.len()
    }

    /// Returns the scalar columns of the panel.
    fn columns(&self) -> usize {
        self.size * self.supernode.columns.len()
    }

    /// x ← L⁻¹ x for the columns of this supernode. `below` is memory for the rows below them.
    #[inline(always)]
    pub fn solve_forwards(&self, x: &mut [f64], below: &mut Vec<f64>) {
        let (rows, columns) = (self.rows(), self.columns());
        let (own, later) = x[self.size * self.supernode.columns.start..].split_at_mut(columns);
        below.clear();
        below.resize(rows - columns, 0.0);
        for (i, column) in self.entries.chunks_exact(rows).enumerate() {
            let solved = own[i] / column[i];
            own[i] = solved;
            add_multiple(&mut own[i + 1..], -solved, &column[i + 1..columns]);
            add_multiple(below, -solved, &column[columns..]);
        }
        for (group, part) in self.rows_below().zip(below.chunks_exact(self.size)) {
            add_multiple(&mut later[group], 1.0, part);
        }
    }

    /// x ← L⁻ᵀ x for the columns of this supernode. `below` is memory for the rows below them.
    #[inline(always)]
    pub fn solve_backwards(&self, x: &mut [f64], below: &mut Vec<f64>) {
        let (rows, columns) = (self.rows(), self.columns());
        let (own, later) = x[self.size * self.supernode.columns.start..].split_at_mut(columns);
        below.clear();
        self.rows_below().for_each(|group| below.extend_from_slice(&later[group]));
        for (i, column) in self.entries.chunks_exact(rows).enumerate().rev() {
            let known = dot(&column[i + 1..columns], &own[i + 1..]) + dot(&column[columns..], below);
            own[i] = (own[i] - known) / column[i];
        }
    }

    /// Returns the unknowns of each row below, counted from the end of the supernode's columns.
    fn rows_below(&self) -> impl Iterator<Item = Range<usize>> {
        let Supernode { columns, rows } = self.supernode;
        let size = self.size;
        rows[columns.len()..].iter().map(move |row| size * (row - columns.end)..size * (row - columns.end + 1))
    }
}

impl<'a> PanelMut<'a> {
    /// `entries` are the panel of the supernode, whose groups have `size` unknowns.
    pub fn new(entries: &'a mut [f64], size: usize, supernode: &Supernode) -> Self {
        Self { entries, size, rows: size * supernode.rows.len(), columns: size * supernode.columns.len() }
    }

    /// Subtracts the contribution of an earlier panel S: its rows `columns` are columns of this panel, and S_r S_cᵀ is
    /// subtracted for its rows r from `columns.start` on. `rows` has the positions of these rows, and `panel_rows` the
    /// row of each position in this panel.
    pub fn subtract_product(
        &mut self,
        source: &Panel<'_>,
        columns: Range<usize>,
        rows: &[usize],
        panel_rows: &[usize],
        product: &mut Product,
    ) {
        let size = self.size;
        let (height, width, depth) = (size * rows.len(), size * columns.len(), source.columns());
        let (left, stride) = (&source.entries[size * columns.start..], source.rows());
        let first = panel_rows[rows[0]];
        let last = panel_rows[rows[rows.len() - 1]];
        if last - first + 1 == rows.len() {
            let target = &mut self.entries[size * (first + first * self.rows)..];
            subtract_outer(target, self.rows, left, stride, [height, width, depth]);
            return;
        }
        product.0.clear();
        product.0.resize(height * width, 0.0);
        subtract_outer(&mut product.0, height, left, stride, [height, width, depth]);
        for (at, column) in product.0.chunks_exact(height).enumerate() {
            let target_column = size * panel_rows[rows[at / size]] + at % size;
            let target = &mut self.entries[target_column * self.rows..][..self.rows];
            for (part, row) in column.chunks_exact(size).zip(rows) {
                add_multiple(&mut target[size * panel_rows[*row]..], 1.0, part);
            }
        }
    }

    /// Factors the panel in place: its upper square A into L Lᵀ, and the rows B below into B L⁻ᵀ. Returns `None` if a
    /// pivot is not positive.
    pub fn factor(&mut self) -> Option<()> {
        factor(self.entries, self.rows, 0, self.columns)
    }
}

/// Factors columns of length `stride`. The diagonal entry of the first one is in row `from`.
fn factor(entries: &mut [f64], stride: usize, from: usize, columns: usize) -> Option<()> {
    if columns <= NARROW {
        return dispatch(NarrowFactor { entries, stride, from, columns });
    }
    let half = (columns / 2).next_multiple_of(NARROW);
    let (left, right) = entries.split_at_mut(half * stride);
    factor(left, stride, from, half)?;
    let middle = from + half;
    subtract_outer(&mut right[middle..], stride, &left[middle..], stride, [stride - middle, columns - half, half]);
    factor(right, stride, middle, columns - half)
}

/// Factors few columns, one after the other.
struct NarrowFactor<'a> {
    entries: &'a mut [f64],
    stride: usize,
    from: usize,
    columns: usize,
}

impl Kernel for NarrowFactor<'_> {
    type Output = Option<()>;

    #[inline(always)]
    fn run<L: Level>(self) -> Option<()> {
        let Self { entries, stride, from, columns } = self;
        for index in 0..columns {
            let diagonal = from + index;
            let (done, column) = entries.split_at_mut(index * stride);
            let column = &mut column[diagonal..stride];
            for done in done.chunks_exact(stride) {
                let multiple = done[diagonal];
                column.iter_mut().zip(&done[diagonal..]).for_each(|(entry, done)| *entry -= multiple * done);
            }
            let pivot = column[0];
            if pivot.is_nan() || pivot <= 0.0 {
                return None;
            }
            let inverse = 1.0 / pivot.sqrt();
            column.iter_mut().for_each(|entry| *entry *= inverse);
        }
        Some(())
    }
}

/// C ← C − A Bᵀ below the diagonal, where A has the given height and depth, and B is the first `width` rows of A.
fn subtract_outer(target: &mut [f64], target_stride: usize, left: &[f64], stride: usize, sizes: [usize; 3]) {
    dispatch(OuterProduct { target, target_stride, left, stride, sizes });
}

/// [`subtract_outer`], in tiles whose sums stay in registers. A strip of rows of A stays in the cache while it meets
/// all columns.
struct OuterProduct<'a> {
    target: &'a mut [f64],
    target_stride: usize,
    left: &'a [f64],
    stride: usize,
    sizes: [usize; 3],
}

impl Kernel for OuterProduct<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Level>(mut self) {
        let ([height, width, _], rows) = (self.sizes, REGISTERS * L::F64::LANES);
        for row in (0..height).step_by(rows) {
            let (mut first, end) = (0, width.min(row + rows));
            while first < end {
                // Most columns come in threes: the unknowns of a vertex.
                first += match width - first {
                    6.. => self.subtract_tile::<L, 6>(first, row),
                    3.. => self.subtract_tile::<L, 3>(first, row),
                    _ => self.subtract_tile::<L, 1>(first, row),
                };
            }
        }
    }
}

impl OuterProduct<'_> {
    /// Subtracts the product from some columns and the rows of some registers. Returns the number of columns.
    #[inline(always)]
    fn subtract_tile<L: Level, const COLUMNS: usize>(&mut self, first: usize, row: usize) -> usize {
        let Self { target, target_stride, left, stride, sizes: [height, _, depth] } = self;
        // Registers beyond the last row read the last one, and are not stored.
        let from = |register: usize| (row + register * L::F64::LANES).min(*height - 1);
        let zero = L::F64::splat(0.0);
        let mut sums = [[zero; REGISTERS]; COLUMNS];
        for index in 0..*depth {
            let source = &left[index * *stride..][..*height];
            let entries: [L::F64; REGISTERS] =
                std::array::from_fn(|register| L::F64::load_ragged(&source[from(register)..]));
            for column in 0..COLUMNS {
                let factor = L::F64::splat(source[first + column]);
                for register in 0..REGISTERS {
                    sums[column][register] = factor.mul_add::<L>(entries[register], sums[column][register]);
                }
            }
        }
        for (column, sums) in sums.into_iter().enumerate() {
            let target = &mut target[(first + column) * *target_stride..][..*height];
            for (register, sum) in sums.into_iter().enumerate() {
                let target_row = row + register * L::F64::LANES;
                if target_row < *height {
                    (L::F64::load_ragged(&target[target_row..]) - sum).store_ragged(&mut target[target_row..]);
                }
            }
        }
        COLUMNS
    }
}

/// y ← y + multiple · x
#[inline(always)]
fn add_multiple(y: &mut [f64], multiple: f64, x: &[f64]) {
    y.iter_mut().zip(x).for_each(|(y, x)| *y += multiple * x);
}

/// Returns the dot product, in 16 sums.
#[inline(always)]
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (a, a_left) = a.as_chunks::<16>();
    let (b, b_left) = b.as_chunks::<16>();
    let mut sums = [0.0; 16];
    for (a, b) in a.iter().zip(b) {
        for lane in 0..16 {
            sums[lane] += a[lane] * b[lane];
        }
    }
    let left: f64 = a_left.iter().zip(b_left).map(|(a, b)| a * b).sum();
    sums.iter().sum::<f64>() + left
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A panel of `rows` rows whose upper square is positive definite.
    fn panel(rows: usize, columns: usize) -> Vec<f64> {
        let entry = |row: usize, column: usize| {
            if row == column { 50.0 + row as f64 } else { ((7 * row + 3 * column) % 11) as f64 / 11.0 }
        };
        (0..columns).flat_map(|column| (0..rows).map(move |row| entry(row.max(column), row.min(column)))).collect()
    }

    #[test]
    fn narrow_and_wide_panels_are_products_of_their_factors() {
        for (rows, columns) in [(1, 1), (5, 3), (40, 16), (41, 17), (130, 75)] {
            let original = panel(rows, columns);
            let mut factored = original.clone();
            factor(&mut factored, rows, 0, columns).unwrap();
            for column in 0..columns {
                for row in column..rows {
                    let product: f64 =
                        (0..=column).map(|k| factored[k * rows + row] * factored[k * rows + column]).sum();
                    let error = (product - original[column * rows + row]).abs();
                    assert!(error < 1e-12, "{rows} × {columns}: entry ({row}, {column}) is off by {error:e}");
                }
            }
        }
    }

    #[test]
    fn a_pivot_that_is_not_positive_is_refused() {
        for bad in [0.0, -1.0, f64::NAN] {
            let mut entries = panel(40, 20);
            entries[18 * 40 + 18] = bad;
            assert_eq!(factor(&mut entries, 40, 0, 20), None, "{bad}");
        }
    }
}
