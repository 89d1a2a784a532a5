use std::sync::Arc;

use energy_dsl::{Block, Vector3};

use crate::block_jacobi::{inverse, is_positive_definite};
use crate::matrix::BlockMatrix;
use crate::pattern::{Pattern, Storage};
use crate::preconditioner::{Preconditioner, SingularBlock};
use crate::vector::{block_times, transposed_times};

/// How much the diagonal is strengthened, relative to itself, after a factorisation met a pivot that is not positive definite: nothing
/// at first, then this, then ten times as much, ….
const FIRST_SHIFT: f64 = 1e-3;

/// Incomplete Cholesky factorisation by 3×3 blocks without fill, A ≈ Uᵀ D⁻¹ U with U of the pattern of A's upper triangle and D its diagonal
/// (Meijerink and van der Vorst 1977; where a pivot fails, shifted as by Manteuffel 1980).
///
/// Made for matrices that change and patterns that do not: [`IncompleteCholesky::factor`] reuses everything else.
#[derive(Clone, Debug)]
pub struct IncompleteCholesky {
    pattern: Arc<Pattern>,
    /// By row, each pair of its blocks that changes a block of another row: U_kiᵀ D_k U_kj for A_ij.
    updates: Vec<Update>,
    update_start: Vec<u32>,
    /// U.
    upper: Vec<Block<f64>>,
    /// D⁻¹.
    inverses: Vec<Block<f64>>,
    shift: f64,
}

/// Blocks `left`ᵀ and `right` change block `to`.
#[derive(Clone, Copy, Debug)]
struct Update {
    left: u32,
    right: u32,
    to: u32,
}

impl IncompleteCholesky {
    /// Prepares for matrices of a pattern.
    ///
    /// # Panics
    /// When it is not the upper triangle of a symmetric one.
    #[must_use]
    pub fn new(pattern: &Arc<Pattern>) -> Self {
        assert_eq!(pattern.storage(), Storage::Upper, "only symmetric matrices have Cholesky factors");
        let (mut updates, mut update_start) = (Vec::new(), vec![0]);
        for row in 0..pattern.rows() {
            let blocks: Vec<(usize, usize)> = pattern.row(row).skip(1).collect();
            for (place, &(left, i)) in blocks.iter().enumerate() {
                for &(right, j) in &blocks[place..] {
                    if let Some((to, _)) = pattern.place(i, j) {
                        let [left, right, to] = [left, right, to].map(crate::pattern::index);
                        updates.push(Update { left, right, to });
                    }
                }
            }
            update_start.push(crate::pattern::index(updates.len()));
        }
        Self {
            pattern: Arc::clone(pattern),
            updates,
            update_start,
            upper: Vec::new(),
            inverses: vec![[[0.0; 3]; 3]; pattern.rows()],
            shift: 0.0,
        }
    }

    /// Factors a matrix of the pattern.
    ///
    /// # Errors
    /// When a diagonal block is not positive definite: then the matrix is not.
    ///
    /// # Panics
    /// When the matrix has another pattern.
    pub fn factor(&mut self, matrix: &BlockMatrix) -> Result<(), SingularBlock> {
        assert!(Arc::ptr_eq(&self.pattern, matrix.pattern()), "the matrix has another pattern");
        if let Some(row) = (0..self.pattern.rows()).find(|&row| !is_positive_definite(matrix.diagonal(row))) {
            return Err(SingularBlock { row });
        }
        self.shift = 0.0;
        loop {
            match self.factor_shifted(matrix) {
                Ok(()) => return Ok(()),
                Err(row) if self.shift > 1.0 => return Err(SingularBlock { row }),
                Err(_) => self.shift = if self.shift == 0.0 { FIRST_SHIFT } else { 10.0 * self.shift },
            }
        }
    }

    /// By how much the diagonal had to be strengthened, relative to itself.
    #[must_use]
    pub fn shift(&self) -> f64 {
        self.shift
    }

    /// The row whose pivot is not positive definite, if there is one.
    fn factor_shifted(&mut self, matrix: &BlockMatrix) -> Result<(), usize> {
        self.upper.clear();
        self.upper.extend_from_slice(matrix.values());
        for row in 0..self.pattern.rows() {
            let pivot = &mut self.upper[self.pattern.diagonal(row)];
            if self.shift > 0.0 {
                for (own, kept) in pivot.iter_mut().flatten().zip(matrix.diagonal(row).iter().flatten()) {
                    *own += self.shift * kept;
                }
            }
            let factor = if is_positive_definite(pivot) { inverse(pivot) } else { None };
            let inverse = factor.ok_or(row)?;
            self.inverses[row] = inverse;
            let (start, end) = (self.update_start[row] as usize, self.update_start[row + 1] as usize);
            let (mut last, mut scaled) = (u32::MAX, [[0.0; 3]; 3]);
            for &Update { left, right, to } in &self.updates[start..end] {
                if left != last {
                    // (D⁻¹ U_ki)ᵀ, for all that follow.
                    scaled = transposed_product(&self.upper[left as usize], &inverse);
                    last = left;
                }
                subtract_product(&scaled, &self.upper[right as usize].clone(), &mut self.upper[to as usize]);
            }
        }
        Ok(())
    }
}

impl Preconditioner for IncompleteCholesky {
    fn is_positive_definite(&self) -> bool {
        true
    }

    fn apply(&self, r: &[Vector3<f64>], z: &mut [Vector3<f64>]) {
        z.copy_from_slice(r);
        for row in 0..self.pattern.rows() {
            let part = block_times(&self.inverses[row], &z[row]);
            for (slot, column) in self.pattern.row(row).skip(1) {
                subtract(&mut z[column], transposed_times(&self.upper[slot], &part));
            }
        }
        for row in (0..self.pattern.rows()).rev() {
            let mut sum = z[row];
            for (slot, column) in self.pattern.row(row).skip(1) {
                subtract(&mut sum, block_times(&self.upper[slot], &z[column]));
            }
            z[row] = block_times(&self.inverses[row], &sum);
        }
    }
}

#[inline(always)]
fn subtract(sum: &mut Vector3<f64>, part: Vector3<f64>) {
    for axis in 0..3 {
        sum[axis] -= part[axis];
    }
}

/// Aᵀ B.
#[inline(always)]
fn transposed_product(a: &Block<f64>, b: &Block<f64>) -> Block<f64> {
    let mut product = [[0.0; 3]; 3];
    for i in 0..3 {
        for j in 0..3 {
            product[i][j] = a[0][i] * b[0][j] + a[1][i] * b[1][j] + a[2][i] * b[2][j];
        }
    }
    product
}

/// C ← C − A B.
#[inline(always)]
fn subtract_product(a: &Block<f64>, b: &Block<f64>, c: &mut Block<f64>) {
    for i in 0..3 {
        for j in 0..3 {
            c[i][j] -= a[i][0] * b[0][j] + a[i][1] * b[1][j] + a[i][2] * b[2][j];
        }
    }
}
