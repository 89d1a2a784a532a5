//! Sparse matrices with a border of dense rows and columns.

use std::sync::Arc;

use super::kinds::{KindMatrix, KindPattern};

/// The symmetric matrix [A B; Bᵀ C]: A is sparse, over the unknowns that are not shared. C is small and dense, over
/// *shared* unknowns. Shared unknowns are coupled to everything, so they are kept out of the sparse pattern.
///
/// Vectors have the increments of A's unknowns, in the order of [`KindPattern`], and then the shared ones.
///
/// A shared unknown is *minimised*, like all others, or *maximised*: the potential is concave in it, as in a pressure
/// that enforces a volume. Then the matrix that must be positive definite is the one that is left once the maximised
/// unknowns are eliminated; a negative pivot c adds b bᵀ/|c|, a positive term of rank one.
#[derive(Clone, Debug)]
pub struct BorderedMatrix {
    pub(crate) kinds: KindMatrix,
    /// The columns of B, one after the other.
    pub(crate) border: Vec<f64>,
    /// C, row by row.
    pub(crate) corner: Vec<f64>,
    /// Whether each shared increment is maximised.
    pub(crate) maximised: Vec<bool>,
    /// Whether each of them is a multiplier: the potential is linear in it.
    pub(crate) multipliers: Vec<bool>,
}

impl BorderedMatrix {
    /// Creates a zero matrix with one dense row for each entry of `maximised`, which tells whether it belongs to a
    /// maximised unknown.
    #[must_use]
    pub fn zeros(pattern: &Arc<KindPattern>, maximised: &[bool]) -> Self {
        let shared = maximised.len();
        Self {
            kinds: KindMatrix::zeros(Arc::clone(pattern)),
            border: vec![0.0; shared * pattern.increments()],
            corner: vec![0.0; shared * shared],
            maximised: maximised.to_vec(),
            multipliers: vec![false; shared],
        }
    }

    /// Marks maximised unknowns that are multipliers of constraints: their part of C is zero, and the matrix must be
    /// positive definite where the constraints keep their values.
    ///
    /// # Panics
    /// If there is not one entry per shared increment.
    #[must_use]
    pub fn with_multipliers(self, multipliers: &[bool]) -> Self {
        assert_eq!(multipliers.len(), self.shared(), "one entry per shared increment");
        Self { multipliers: multipliers.to_vec(), ..self }
    }

    /// Whether the potential is strictly concave in a shared increment.
    pub(crate) fn is_concave(&self, shared: usize) -> bool {
        self.maximised[shared] && !self.multipliers[shared]
    }

    /// Returns A.
    #[must_use]
    pub fn kinds(&self) -> &KindMatrix {
        &self.kinds
    }

    /// Returns A for modification.
    pub fn kinds_mut(&mut self) -> &mut KindMatrix {
        &mut self.kinds
    }

    /// Returns the number of dense rows.
    #[must_use]
    pub fn shared(&self) -> usize {
        self.maximised.len()
    }

    /// Returns the number of rows.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.kinds.pattern().increments() + self.shared()
    }

    /// Returns a column of B.
    #[must_use]
    pub fn border(&self, shared: usize) -> &[f64] {
        let n = self.kinds.pattern().increments();
        &self.border[shared * n..][..n]
    }

    /// Returns a column of B for modification.
    pub fn border_mut(&mut self, shared: usize) -> &mut [f64] {
        let n = self.kinds.pattern().increments();
        &mut self.border[shared * n..][..n]
    }

    /// Returns C, row by row.
    #[must_use]
    pub fn corner(&self) -> &[f64] {
        &self.corner
    }

    /// Returns C, row by row, for modification. Keep it symmetric.
    pub fn corner_mut(&mut self) -> &mut [f64] {
        &mut self.corner
    }

    /// Sets all entries to zero.
    pub fn clear(&mut self) {
        self.kinds.clear();
        self.border.fill(0.0);
        self.corner.fill(0.0);
    }

    /// Returns the entries of C in the rows and columns that are concave or not as `rows` and `columns` say, row by
    /// row.
    pub(crate) fn part_of_corner(&self, rows: bool, columns: bool) -> Vec<f64> {
        let chosen = |of: bool| (0..self.shared()).filter(move |&shared| self.is_concave(shared) == of);
        chosen(rows).flat_map(|row| chosen(columns).map(move |to| self.corner[row * self.shared() + to])).collect()
    }

    /// Computes y ← [A B; Bᵀ C] x.
    ///
    /// # Panics
    /// If the vectors do not have one number per row.
    pub fn multiply(&self, x: &[f64], y: &mut [f64]) {
        let n = self.kinds.pattern().increments();
        let ((x, shared_x), (y, shared_y)) = (x.split_at(n), y.split_at_mut(n));
        self.kinds.multiply(x, y);
        for shared in 0..self.shared() {
            let row = &self.corner[shared * self.shared()..][..self.shared()];
            shared_y[shared] = dot(self.border(shared), x) + dot(row, shared_x);
            add_scaled(y, shared_x[shared], self.border(shared));
        }
    }
}

/// Returns Σ aᵢ bᵢ.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// y ← y + s x.
pub(crate) fn add_scaled(y: &mut [f64], s: f64, x: &[f64]) {
    y.iter_mut().zip(x).for_each(|(y, x)| *y += s * x);
}
