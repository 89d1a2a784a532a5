//! Vectors with one 3-vector per vertex, and single 3×3 blocks.

use energy_dsl::{Block, Vector3};

use crate::matrix::precision::Precision;

/// Returns Σ aᵢ · bᵢ over all vertices.
#[must_use]
pub fn dot(a: &[Vector3<f64>], b: &[Vector3<f64>]) -> f64 {
    a.iter().zip(b).map(|(p, q)| p[0] * q[0] + p[1] * q[1] + p[2] * q[2]).sum()
}

/// y ← y + s x.
pub(crate) fn add_scaled(y: &mut [Vector3<f64>], s: f64, x: &[Vector3<f64>]) {
    for (yi, xi) in y.iter_mut().zip(x) {
        for axis in 0..3 {
            yi[axis] += s * xi[axis];
        }
    }
}

/// y ← x + s y.
pub(crate) fn scale_and_add(y: &mut [Vector3<f64>], s: f64, x: &[Vector3<f64>]) {
    for (yi, xi) in y.iter_mut().zip(x) {
        for axis in 0..3 {
            yi[axis] = xi[axis] + s * yi[axis];
        }
    }
}

/// Pads a vector with a zero to fill a SIMD register.
#[inline(always)]
pub(crate) fn widened<T: Precision>([u, v, w]: Vector3<f64>) -> [T; 4] {
    [T::from_f64(u), T::from_f64(v), T::from_f64(w), T::from_f64(0.0)]
}

/// Returns B v.
#[inline]
pub(crate) fn block_times(block: &Block<f64>, v: &Vector3<f64>) -> Vector3<f64> {
    std::array::from_fn(|row| block[row][0] * v[0] + block[row][1] * v[1] + block[row][2] * v[2])
}

/// Returns Bᵀ.
pub(crate) fn transposed<T: Copy>(block: &Block<T>) -> Block<T> {
    std::array::from_fn(|row| std::array::from_fn(|column| block[column][row]))
}

/// A ← A + s B.
pub(crate) fn add_scaled_block(sum: &mut Block<f64>, s: f64, block: &Block<f64>) {
    for row in 0..3 {
        for column in 0..3 {
            sum[row][column] += s * block[row][column];
        }
    }
}
