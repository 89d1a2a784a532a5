//! 3×3 blocks in single precision, multiplied by vectors in double precision.
//!
//! This halves the memory traffic. A column is read as four numbers, of which the last is ignored.

use energy_dsl::{Block, Level, Number, Vector3};

use crate::matrix::vector::widened;

/// Padding after the last block, so that its last column can be read as four numbers.
const SLACK: usize = 1;

/// Creates storage for `blocks` blocks.
pub(crate) fn zeros(blocks: usize) -> Vec<f32> {
    vec![0.0; 9 * blocks + SLACK]
}

/// Stores a block column by column, or the transpose of a block that is stored row by row.
pub(crate) fn store_columns(numbers: &mut [f32], place: usize, block: &Block<f64>) {
    let numbers = &mut numbers[9 * place..][..9];
    for row in 0..3 {
        for column in 0..3 {
            numbers[3 * column + row] = block[row][column] as f32;
        }
    }
}

/// Stores a block row by row.
pub(crate) fn store_rows(numbers: &mut [f32], place: usize, block: &Block<f64>) {
    let numbers = &mut numbers[9 * place..][..9];
    for row in 0..3 {
        for column in 0..3 {
            numbers[3 * row + column] = block[row][column] as f32;
        }
    }
}

/// A 3-vector padded to a register of four; the last component is ignored.
pub(crate) type Wide = [f64; 4];

/// Pads vectors to [`Wide`] ones.
pub(crate) fn widen(vectors: &[Vector3<f64>]) -> Vec<Wide> {
    vectors.iter().copied().map(widened).collect()
}

/// Drops the padding.
pub(crate) fn narrow(wide: &[Wide], vectors: &mut [Vector3<f64>]) {
    for (vector, &[x, y, z, _]) in vectors.iter_mut().zip(wide) {
        *vector = [x, y, z];
    }
}

/// Three partial sums of a vector, one per column of a block, which are independent for instruction-level parallelism.
pub(crate) type Sums = [Wide; 3];

/// Adds s B v, with B stored column by column.
#[inline(always)]
pub(crate) fn add_times<L: Level>(sums: &mut Sums, scale: f64, numbers: &[f32], place: usize, v: &Wide) {
    let block = &numbers[9 * place..][..9 + SLACK];
    let v = [scale * v[0], scale * v[1], scale * v[2]];
    for column in 0..3 {
        for lane in 0..4 {
            let entry = f64::from(block[3 * column + lane]);
            sums[column][lane] = Number::mul_add::<L>(entry, v[column], sums[column][lane]);
        }
    }
}

/// Adds up the partial sums.
#[inline(always)]
pub(crate) fn total(sums: &Sums) -> Wide {
    let mut total = [0.0; 4];
    for lane in 0..4 {
        total[lane] = sums[0][lane] + sums[1][lane] + sums[2][lane];
    }
    total
}
