//! Square matrices, one per lane.

use energy_dsl::Lane;

/// A square matrix per lane: an array, or a vector for sizes that are not known when this is compiled.
pub(super) trait Square<V>: Clone {
    /// Returns the number of rows.
    fn size(&self) -> usize;
    /// Returns entry (i, j).
    fn at(&self, i: usize, j: usize) -> V;
    /// Sets entry (i, j).
    fn set(&mut self, i: usize, j: usize, entry: V);
    /// Returns a matrix of zeros of the same size.
    fn zeros(&self) -> Self;
}

impl<V: Lane<f64>, const N: usize> Square<V> for [[V; N]; N] {
    #[inline(always)]
    fn size(&self) -> usize {
        N
    }

    #[inline(always)]
    fn at(&self, i: usize, j: usize) -> V {
        self[i][j]
    }

    #[inline(always)]
    fn set(&mut self, i: usize, j: usize, entry: V) {
        self[i][j] = entry;
    }

    #[inline(always)]
    fn zeros(&self) -> Self {
        [[V::splat(0.0); N]; N]
    }
}

/// A square matrix of any size, row by row.
#[derive(Clone)]
pub(super) struct AnySquare<V> {
    size: usize,
    entries: Vec<V>,
}

impl<V: Lane<f64>> AnySquare<V> {
    #[inline(always)]
    pub(super) fn zeros_of(size: usize) -> Self {
        Self { size, entries: vec![V::splat(0.0); size * size] }
    }
}

impl<V: Lane<f64>> Square<V> for AnySquare<V> {
    #[inline(always)]
    fn size(&self) -> usize {
        self.size
    }

    #[inline(always)]
    fn at(&self, i: usize, j: usize) -> V {
        self.entries[i * self.size + j]
    }

    #[inline(always)]
    fn set(&mut self, i: usize, j: usize, entry: V) {
        self.entries[i * self.size + j] = entry;
    }

    #[inline(always)]
    fn zeros(&self) -> Self {
        Self::zeros_of(self.size)
    }
}
