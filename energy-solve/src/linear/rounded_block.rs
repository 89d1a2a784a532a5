//! 3×3 blocks rounded to single precision, nine numbers each, multiplied by vectors in double precision: half the memory to read, and
//! three numbers of a column (and one that is not used) at once.

use energy_dsl::{Block, Level, Number, Vector3};

use crate::matrix::vector::widened;

/// Numbers after the last block, so that four can be read where its last column begins.
const SLACK: usize = 1;

/// Room for so many blocks.
pub(crate) fn room(blocks: usize) -> Vec<f32> {
    vec![0.0; 9 * blocks + SLACK]
}

/// Stores a block column by column. Its transpose is stored row by row.
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

/// A vector in a register of four, with a last component that means nothing.
pub(crate) type Wide = [f64; 4];

/// Vectors as [`Wide`] ones.
pub(crate) fn widen(vectors: &[Vector3<f64>]) -> Vec<Wide> {
    vectors.iter().copied().map(widened).collect()
}

/// Back again.
pub(crate) fn narrow(wide: &[Wide], vectors: &mut [Vector3<f64>]) {
    for (vector, &[x, y, z, _]) in vectors.iter_mut().zip(wide) {
        *vector = [x, y, z];
    }
}

/// Three partial sums of a vector: they do not wait for each other.
pub(crate) type Sums = [Wide; 3];

/// Adds s B v, B stored column by column.
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

/// The sum of partial sums.
#[inline(always)]
pub(crate) fn total(sums: &Sums) -> Wide {
    let mut total = [0.0; 4];
    for lane in 0..4 {
        total[lane] = sums[0][lane] + sums[1][lane] + sums[2][lane];
    }
    total
}
