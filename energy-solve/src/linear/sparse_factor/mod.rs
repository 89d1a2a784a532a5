//! Sparse Cholesky factorisation by supernodes.

mod elimination;
mod panel;
mod supernodes;

use energy_dsl::{Kernel, Level, dispatch};

use crate::matrix::pattern::{Pattern, Storage};
use elimination::Elimination;
use panel::{Panel, PanelMut, Product};
use supernodes::{Supernode, supernodes};

/// The Cholesky factor A = L Lᵀ for matrices of one pattern. The elimination order and the fill-in are computed once.
///
/// Unknowns come in groups of equal size, such as the three coordinates of a vertex, whose blocks are dense. Columns of
/// L with nearly the same rows form a supernode, which is stored as a dense panel. A panel collects the products of the
/// earlier panels that reach it, and is then factored (Ng and Peyton, SIAM J. Sci. Comput. 14, 1993).
#[derive(Clone)]
pub(crate) struct SparseFactor {
    /// Unknowns in a group.
    size: usize,
    /// Position of each group in the elimination order.
    positions: Vec<usize>,
    supernodes: Vec<Supernode>,
    /// Supernode of each position.
    owners: Vec<usize>,
    /// First entry of each supernode's panel, and the end of the last.
    starts: Vec<usize>,
    /// Place of each block of the matrix.
    slots: Vec<PanelSlot>,
    entries: Vec<f64>,
}

/// The slot of a matrix block in the panels: entry (i, j) is at `start + i · row + j · column`.
#[derive(Clone, Copy)]
struct PanelSlot {
    start: usize,
    row: usize,
    column: usize,
}

/// A pivot is not positive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct NotPositiveDefinite;

/// The factor does not fit into memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct OutOfMemory;

impl std::fmt::Debug for SparseFactor {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut shown = f.debug_struct("SparseFactor");
        shown.field("entries", &self.entries.len()).field("supernodes", &self.supernodes.len()).finish_non_exhaustive()
    }
}

impl SparseFactor {
    /// Analyses the pattern of a matrix whose blocks have `size` rows.
    ///
    /// # Panics
    /// If the pattern does not store an upper triangle.
    pub(crate) fn new(size: usize, pattern: &Pattern) -> Result<Self, OutOfMemory> {
        assert_eq!(pattern.storage(), Storage::Upper, "only symmetric matrices have Cholesky factors");
        let elimination = Elimination::new(pattern);
        let supernodes = supernodes(size, &elimination);
        let positions = elimination.positions;
        let mut owners = vec![0; positions.len()];
        let mut starts = vec![0];
        for (index, supernode) in supernodes.iter().enumerate() {
            owners[supernode.columns.clone()].fill(index);
            starts.push(starts[index] + size * size * supernode.rows.len() * supernode.columns.len());
        }
        let mut entries = Vec::new();
        entries.try_reserve_exact(starts[supernodes.len()]).map_err(|_| OutOfMemory)?;
        entries.resize(starts[supernodes.len()], 0.0);
        let slot = |row: usize, column: usize| {
            let (from, to) = (positions[row].min(positions[column]), positions[row].max(positions[column]));
            let Supernode { columns, rows } = &supernodes[owners[from]];
            let stride = size * rows.len();
            let at = rows.binary_search(&to).expect("the factor's pattern has the matrix's blocks");
            let start = starts[owners[from]] + size * (at + (from - columns.start) * stride);
            // The panel has the lower triangle: a block of the upper one is transposed.
            let (row, column) = if positions[row] == to && from != to { (1, stride) } else { (stride, 1) };
            PanelSlot { start, row, column }
        };
        let blocks = (0..pattern.rows()).flat_map(|row| pattern.row(row).map(move |(_, column)| (row, column)));
        let slots = blocks.map(|(row, column)| slot(row, column)).collect();
        Ok(Self { size, positions, owners, starts, slots, entries, supernodes })
    }

    /// Returns the number of stored entries of the factor.
    pub(crate) fn entries(&self) -> usize {
        self.entries.len()
    }

    /// Factors A + μ 1 with the damping μ. Block `b` of A, in the order of the pattern, has the entries `entry(b, i,
    /// j)`.
    pub(crate) fn factor(
        &mut self,
        damping: f64,
        entry: impl Fn(usize, usize, usize) -> f64,
    ) -> Result<(), NotPositiveDefinite> {
        self.fill(damping, entry);
        let mut waiting = Waiting::new(&self.supernodes);
        let mut panel_rows = vec![0; self.positions.len()];
        let mut product = Product::default();
        for index in 0..self.supernodes.len() {
            let supernode = &self.supernodes[index];
            for (number, &row) in supernode.rows.iter().enumerate() {
                panel_rows[row] = number;
            }
            let (earlier, panel) = self.entries[..self.starts[index + 1]].split_at_mut(self.starts[index]);
            let mut panel = PanelMut::new(panel, self.size, supernode);
            while let Some((source, from)) = waiting.take(index) {
                let rows = &self.supernodes[source].rows;
                let to = from + rows[from..].partition_point(|&row| row < supernode.columns.end);
                let source_panel = Panel::new(&earlier[self.starts[source]..], self.size, &self.supernodes[source]);
                panel.subtract_product(&source_panel, from..to, &rows[from..], &panel_rows, &mut product);
                waiting.put(source, to, rows, &self.owners);
            }
            panel.factor().ok_or(NotPositiveDefinite)?;
            waiting.put(index, supernode.columns.len(), &supernode.rows, &self.owners);
        }
        Ok(())
    }

    /// Copies the matrix to the panels and adds the damping to its diagonal.
    fn fill(&mut self, damping: f64, entry: impl Fn(usize, usize, usize) -> f64) {
        self.entries.fill(0.0);
        for (block, slot) in self.slots.iter().enumerate() {
            for i in 0..self.size {
                for j in 0..self.size {
                    self.entries[slot.start + i * slot.row + j * slot.column] = entry(block, i, j);
                }
            }
        }
        for (supernode, start) in self.supernodes.iter().zip(&self.starts) {
            let (rows, columns) = (self.size * supernode.rows.len(), self.size * supernode.columns.len());
            self.entries[*start..][..rows * columns].iter_mut().step_by(rows + 1).for_each(|entry| *entry += damping);
        }
    }

    /// x ← (A + μ 1)⁻¹ x for the last factored matrix.
    pub(crate) fn solve(&self, x: &mut [f64]) {
        let mut ordered = vec![0.0; x.len()];
        for (&position, group) in self.positions.iter().zip(x.chunks_exact(self.size)) {
            ordered[position * self.size..][..self.size].copy_from_slice(group);
        }
        dispatch(Substitution { factor: self, x: &mut ordered });
        for (&position, group) in self.positions.iter().zip(x.chunks_exact_mut(self.size)) {
            group.copy_from_slice(&ordered[position * self.size..][..self.size]);
        }
    }
}

/// x ← (L Lᵀ)⁻¹ x, in the elimination order.
struct Substitution<'a> {
    factor: &'a SparseFactor,
    x: &'a mut [f64],
}

impl Kernel for Substitution<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Level>(self) {
        let Self { factor: SparseFactor { size, supernodes, starts, entries, .. }, x } = self;
        let panels =
            || supernodes.iter().zip(starts).map(|(supernode, &start)| Panel::new(&entries[start..], *size, supernode));
        // Rows below the columns of one panel.
        let mut below = Vec::new();
        panels().for_each(|panel| panel.solve_forwards(x, &mut below));
        panels().rev().for_each(|panel| panel.solve_backwards(x, &mut below));
    }
}

/// Factored supernodes, each in the list of the next supernode that it contributes to.
struct Waiting {
    /// First supernode in each list.
    first: Vec<Option<usize>>,
    /// The next supernode in the same list.
    next: Vec<Option<usize>>,
    /// First row of each supernode that has not contributed yet.
    from: Vec<usize>,
}

impl Waiting {
    fn new(supernodes: &[Supernode]) -> Self {
        let count = supernodes.len();
        Self { first: vec![None; count], next: vec![None; count], from: vec![0; count] }
    }

    /// Removes a supernode from a list, and returns it with its first row to contribute.
    fn take(&mut self, list: usize) -> Option<(usize, usize)> {
        let source = self.first[list]?;
        self.first[list] = self.next[source];
        Some((source, self.from[source]))
    }

    /// Puts a supernode into the list of the supernode that owns its row `from`, if it has this row.
    fn put(&mut self, source: usize, from: usize, rows: &[usize], owners: &[usize]) {
        if let Some(&row) = rows.get(from) {
            let list = owners[row];
            self.from[source] = from;
            self.next[source] = self.first[list].replace(source);
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};
    use proptest::prelude::*;

    use super::*;
    use crate::matrix::pattern::index;

    /// A symmetric matrix by blocks of the upper triangle.
    #[derive(Clone, Debug)]
    struct Blocks {
        size: usize,
        pattern: Pattern,
        /// Entries of all blocks, row after row.
        values: Vec<f64>,
    }

    impl Blocks {
        fn entry(&self, block: usize, i: usize, j: usize) -> f64 {
            let diagonal = self.pattern.diagonals().contains(&index(block));
            let (i, j) = if diagonal { (i.min(j), i.max(j)) } else { (i, j) };
            // Diagonal dominance makes the matrix positive definite.
            let dominance = if diagonal && i == j { (self.size * (self.pattern.rows() + 1)) as f64 } else { 0.0 };
            self.values[(block * self.size + i) * self.size + j] + dominance
        }

        fn dense(&self) -> DMatrix<f64> {
            let unknowns = self.size * self.pattern.rows();
            let mut dense = DMatrix::zeros(unknowns, unknowns);
            for row in 0..self.pattern.rows() {
                for (block, column) in self.pattern.row(row) {
                    for i in 0..self.size {
                        for j in 0..self.size {
                            let (at, to) = (self.size * row + i, self.size * column + j);
                            dense[(at, to)] = self.entry(block, i, j);
                            dense[(to, at)] = self.entry(block, i, j);
                        }
                    }
                }
            }
            dense
        }
    }

    fn blocks() -> impl Strategy<Value = Blocks> {
        (1..=6_usize, 1..=24_usize, 0.0..0.6).prop_flat_map(|(size, groups, density)| {
            let pairs = groups * (groups - 1) / 2;
            prop::collection::vec(0.0..1.0, pairs).prop_flat_map(move |chances| {
                let all = (0..groups).flat_map(|row| (row + 1..groups).map(move |column| [row, column].map(index)));
                let linked = all.zip(chances).filter(|(_, chance)| *chance < density).map(|(pair, _)| pair);
                let links: Vec<[u32; 2]> = linked.collect();
                let links = links.iter().map(<[u32; 2]>::as_slice);
                let pattern = Pattern::from_stencils(Storage::Upper, groups, links);
                let values = prop::collection::vec(-1.0..1.0, size * size * pattern.blocks());
                values.prop_map(move |values| Blocks { size, pattern: pattern.clone(), values })
            })
        })
    }

    proptest! {
        #[test]
        fn solutions_agree_with_a_dense_factorisation(blocks in blocks(), damping in 0.0..3.0) {
            let mut factor = SparseFactor::new(blocks.size, &blocks.pattern).unwrap();
            let dense = blocks.dense();
            let damped = &dense + DMatrix::identity(dense.nrows(), dense.nrows()) * damping;
            let expected = DVector::from_fn(dense.nrows(), |i, _| (i as f64 + 0.5).sin());
            // A second factorisation of the same matrix gives the same bits.
            let mut first = Vec::new();
            for _ in 0..2 {
                factor.factor(damping, |block, i, j| blocks.entry(block, i, j)).unwrap();
                let mut x = (&damped * &expected).as_slice().to_vec();
                factor.solve(&mut x);
                for (x, expected) in x.iter().zip(&expected) {
                    prop_assert!((x - expected).abs() < 1e-12, "{x} instead of {expected}");
                }
                prop_assert!(first.is_empty() || first == x);
                first = x;
            }
        }

        #[test]
        fn a_matrix_is_refused_if_a_dense_factorisation_refuses_it(blocks in blocks(), damping in -80.0..0.0) {
            let mut factor = SparseFactor::new(blocks.size, &blocks.pattern).unwrap();
            let dense = blocks.dense();
            let least: f64 = dense.symmetric_eigenvalues().min() + damping;
            prop_assume!(least.abs() > 1e-9);
            let outcome = factor.factor(damping, |block, i, j| blocks.entry(block, i, j));
            prop_assert_eq!(outcome, if least > 0.0 { Ok(()) } else { Err(NotPositiveDefinite) });
        }
    }

    #[test]
    fn a_matrix_without_rows_has_an_empty_factor() {
        let mut factor = SparseFactor::new(3, &Pattern::from_stencils(Storage::Upper, 0, [])).unwrap();
        factor.factor(0.0, |_, _, _| 1.0).unwrap();
        factor.solve(&mut []);
        assert_eq!(factor.entries(), 0);
    }
}
