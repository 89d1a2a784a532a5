use std::sync::Arc;

use energy_dsl::{Kernel, Lane, Level, Number, dispatch};

use crate::matrix::pattern::{Pattern, Storage};

/// Numbers in a stored row of a block: the lanes of the widest register, so that one or a few loads read a row. Numbers
/// past the block's own columns are ignored.
pub(crate) const WIDTH: usize = 8;

/// A stored block: D rows of [`WIDTH`] numbers, of which the first D are used.
pub(crate) type WideBlock<const D: usize> = [[f64; WIDTH]; D];

/// Stencils that do not fit a pattern.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum CouplingError {
    /// A stencil names a block of unknowns that does not exist.
    #[error("element {element} acts on block {block} of unknowns, but there are only {blocks}")]
    OutOfRange {
        /// Index of the element.
        element: usize,
        /// Index of the missing block.
        block: usize,
        /// Number of blocks.
        blocks: usize,
    },
    /// A stencil names a block of unknowns twice.
    #[error("element {element} names block {block} of unknowns twice")]
    Repeated {
        /// Index of the element.
        element: usize,
        /// Index of the block.
        block: usize,
    },
    /// An element couples two blocks that the pattern does not.
    #[error(
        "element {element} couples blocks {first} and {second}, which the pattern does not; \
         build the pattern from all stencils"
    )]
    NotInPattern {
        /// Index of the element.
        element: usize,
        /// Index of the first block.
        first: usize,
        /// Index of the second block.
        second: usize,
    },
}

/// Scatter map from elements to JᵀJ: the blocks of unknowns of each stencil, and where the products of their
/// derivatives are stored. It depends on the stencils only, so a term can replace its elements.
#[derive(Clone, Debug)]
pub struct Couplings {
    arity: usize,
    blocks: Vec<u32>,
    /// For each pair i ≤ j of a stencil's blocks, twice the index in the matrix, plus one if the second block comes
    /// first there.
    slots: Vec<u32>,
}

impl Couplings {
    /// Returns the pattern of JᵀJ over `blocks` blocks of unknowns: the upper triangle, with all blocks of each stencil
    /// coupled.
    ///
    /// # Errors
    /// If a stencil names a block out of range.
    pub fn pattern<'a, S>(blocks: usize, stencils: S) -> Result<Pattern, CouplingError>
    where
        S: IntoIterator<Item = &'a [u32], IntoIter: Clone>,
    {
        let stencils = stencils.into_iter();
        for (element, stencil) in stencils.clone().enumerate() {
            if let Some(&block) = stencil.iter().find(|&&block| block as usize >= blocks) {
                return Err(CouplingError::OutOfRange { element, block: block as usize, blocks });
            }
        }
        Ok(Pattern::from_stencils(Storage::Upper, blocks, stencils))
    }

    /// Looks up the stencils in a pattern.
    ///
    /// # Errors
    /// If a stencil repeats a block, or couples blocks that the pattern does not.
    pub fn new<const K: usize>(pattern: &Pattern, stencils: &[[u32; K]]) -> Result<Self, CouplingError> {
        let blocks = pattern.rows();
        let mut slots = Vec::with_capacity(stencils.len() * K * (K + 1) / 2);
        for (element, stencil) in stencils.iter().enumerate() {
            for (i, &first) in stencil.iter().enumerate() {
                for (j, &second) in stencil.iter().enumerate().skip(i) {
                    let (a, b) = (first.min(second) as usize, first.max(second) as usize);
                    if b >= blocks {
                        return Err(CouplingError::OutOfRange { element, block: b, blocks });
                    }
                    if a == b && i != j {
                        return Err(CouplingError::Repeated { element, block: a });
                    }
                    let (slot, _) =
                        pattern.slot(a, b).ok_or(CouplingError::NotInPattern { element, first: a, second: b })?;
                    slots.push(2 * slot as u32 + u32::from(first > second));
                }
            }
        }
        Ok(Self { arity: K, blocks: stencils.concat(), slots })
    }

    /// Returns the number of stencils.
    #[must_use]
    pub fn len(&self) -> usize {
        self.blocks.len() / self.arity.max(1)
    }

    /// Whether the map is empty.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.blocks.is_empty()
    }

    /// Returns the number of blocks of unknowns per stencil.
    #[must_use]
    pub fn arity(&self) -> usize {
        self.arity
    }

    /// Returns the blocks of unknowns of stencil `at`.
    #[inline(always)]
    #[must_use]
    pub fn stencil(&self, at: usize) -> &[u32] {
        &self.blocks[at * self.arity..][..self.arity]
    }

    /// Returns the entries of `slots` for stencil `at`.
    #[inline(always)]
    pub(crate) fn slots(&self, at: usize) -> &[u32] {
        let pairs = self.arity * (self.arity + 1) / 2;
        &self.slots[at * pairs..][..pairs]
    }
}

/// The symmetric matrix JᵀJ of D×D blocks. Stores the upper triangle.
#[derive(Clone, Debug)]
pub struct NormalMatrix<const D: usize> {
    pattern: Arc<Pattern>,
    pub(crate) values: Vec<WideBlock<D>>,
}

impl<const D: usize> NormalMatrix<D> {
    const FITS: () = assert!(D <= WIDTH, "a block has at most eight rows");

    /// Creates the zero matrix of a pattern.
    #[must_use]
    pub fn zeros(pattern: Arc<Pattern>) -> Self {
        let () = Self::FITS;
        let values = vec![[[0.0; WIDTH]; D]; pattern.blocks()];
        Self { pattern, values }
    }

    /// Returns the pattern of the matrix.
    #[must_use]
    pub fn pattern(&self) -> &Arc<Pattern> {
        &self.pattern
    }

    /// Sets all entries to zero.
    pub fn clear(&mut self) {
        self.values.fill([[0.0; WIDTH]; D]);
    }

    /// Adds a matrix of the same pattern.
    pub(crate) fn add(&mut self, other: &Self) {
        let other = other.values.as_flattened().as_flattened();
        let own = self.values.as_flattened_mut().as_flattened_mut();
        own.iter_mut().zip(other).for_each(|(sum, part)| *sum += part);
    }

    /// Returns block (row, column); zero if it is not in the pattern.
    #[must_use]
    pub fn block(&self, row: usize, column: usize) -> [[f64; D]; D] {
        let slot = self.pattern.slot(row, column);
        let entry = |i: usize, j: usize| {
            slot.map_or(0.0, |(at, turned)| if turned { self.values[at][j][i] } else { self.values[at][i][j] })
        };
        std::array::from_fn(|i| std::array::from_fn(|j| entry(i, j)))
    }

    /// Computes y = (A + μ 1) x.
    pub fn multiply_damped(&self, damping: f64, x: &[[f64; D]], y: &mut [[f64; D]]) {
        dispatch(Product { matrix: self, damping, x, y });
    }

    pub(crate) fn diagonal(&self, row: usize) -> &WideBlock<D> {
        &self.values[self.pattern.diagonal(row)]
    }
}

/// Computes y = (A + μ 1) x with one register per row of a block.
struct Product<'a, const D: usize> {
    matrix: &'a NormalMatrix<D>,
    damping: f64,
    x: &'a [[f64; D]],
    y: &'a mut [[f64; D]],
}

impl<const D: usize> Kernel for Product<'_, D> {
    type Output = ();

    #[inline(always)]
    fn run<L: Level>(self) {
        let Self { matrix, damping, x, y } = self;
        let pattern = &matrix.pattern;
        // Rows as wide as a stored block. Padding of blocks only reaches padding of sums, which is never read.
        let wide: Vec<[f64; WIDTH]> =
            x.iter().map(|x| std::array::from_fn(|i| if i < D { x[i] } else { 0.0 })).collect();
        let mut below = vec![[0.0; WIDTH]; x.len()];
        for row in 0..pattern.rows() {
            let mut sums = [[0.0; WIDTH]; D];
            for (at, column) in pattern.row(row) {
                let block = &matrix.values[at];
                for i in 0..D {
                    add_product::<L>(&mut sums[i], &block[i], &wide[column]);
                }
                if column != row {
                    for i in 0..D {
                        add_scaled::<L>(&mut below[column], wide[row][i], &block[i]);
                    }
                }
            }
            for i in 0..D {
                y[row][i] = damping * x[row][i] + sums[i][..D].iter().sum::<f64>();
            }
        }
        for (y, below) in y.iter_mut().zip(&below) {
            y.iter_mut().zip(below).for_each(|(y, below)| *y += below);
        }
    }
}

/// Adds the products of entries.
#[inline(always)]
fn add_product<L: Level>(sum: &mut [f64; WIDTH], a: &[f64; WIDTH], b: &[f64; WIDTH]) {
    for c in (0..WIDTH).step_by(L::F64::LANES) {
        L::F64::load(&a[c..]).mul_add::<L>(L::F64::load(&b[c..]), L::F64::load(&sum[c..])).store(&mut sum[c..]);
    }
}

/// Adds a multiple of a row.
#[inline(always)]
fn add_scaled<L: Level>(sum: &mut [f64; WIDTH], factor: f64, row: &[f64; WIDTH]) {
    let factor = L::F64::splat(factor);
    for c in (0..WIDTH).step_by(L::F64::LANES) {
        factor.mul_add::<L>(L::F64::load(&row[c..]), L::F64::load(&sum[c..])).store(&mut sum[c..]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pattern_is_the_diagonal_and_the_coupled_blocks() {
        let pattern = Couplings::pattern(4, [[3, 0].as_slice(), &[0, 1]]).unwrap();
        assert_eq!(
            (0..4).map(|row| pattern.row(row).map(|(_, column)| column).collect()).collect::<Vec<Vec<_>>>(),
            [vec![0, 1, 3], vec![1], vec![2], vec![3]]
        );
        assert_eq!(pattern.slot(0, 3), Some((2, false)));
        assert_eq!(pattern.slot(3, 0), Some((2, true)));
        assert_eq!(pattern.slot(1, 3), None);
    }

    #[test]
    fn a_new_matrix_is_zero() {
        let pattern = Arc::new(Couplings::pattern(3, [[0, 2].as_slice()]).unwrap());
        let matrix = NormalMatrix::<2>::zeros(pattern);
        let (x, mut y) = ([[1.0, -2.0], [3.0, 0.5], [-1.0, 4.0]], [[f64::NAN; 2]; 3]);
        matrix.multiply_damped(2.0, &x, &mut y);
        assert_eq!(y, x.map(|point| point.map(|component| 2.0 * component)));
    }

    #[test]
    fn stencils_that_do_not_fit_are_rejected() {
        let pattern = Couplings::pattern(3, [[0, 1].as_slice()]).unwrap();
        assert!(matches!(Couplings::new(&pattern, &[[0, 0]]), Err(CouplingError::Repeated { element: 0, block: 0 })));
        assert!(matches!(
            Couplings::new(&pattern, &[[0, 1], [0, 7]]),
            Err(CouplingError::OutOfRange { element: 1, .. })
        ));
        assert!(matches!(
            Couplings::new(&pattern, &[[2, 1]]),
            Err(CouplingError::NotInPattern { first: 1, second: 2, .. })
        ));
        assert!(Couplings::pattern(3, [[3].as_slice()]).is_err());
    }

    #[test]
    fn products_use_both_triangles() {
        let pattern = Arc::new(Couplings::pattern(2, [[0, 1].as_slice()]).unwrap());
        let mut matrix = NormalMatrix::<2>::zeros(pattern);
        // The padding past a block's own columns must be ignored.
        for (at, value) in matrix.values.iter_mut().enumerate() {
            for i in 0..2 {
                value[i] = [f64::NAN; WIDTH];
                for j in 0..2 {
                    value[i][j] = if at == 1 { (1 + 2 * i + j) as f64 } else { f64::from(u8::from(i == j)) };
                }
            }
        }
        let mut y = [[0.0; 2]; 2];
        matrix.multiply_damped(10.0, &[[1.0, 0.0], [0.0, 1.0]], &mut y);
        assert_eq!(y, [[11.0 + 2.0, 4.0], [1.0, 11.0 + 2.0]]);
        assert_eq!(matrix.block(1, 0), [[1.0, 3.0], [2.0, 4.0]]);
    }
}
