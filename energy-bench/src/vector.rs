//! Vectors and 3×3 blocks for hand-derived code. Loops have fixed bounds and are always inlined, so that they are
//! compiled for the caller's level.

use energy_dsl::{Block, Level, Real, Vector3};

/// a − b.
#[inline(always)]
pub fn sub<T: Real>(a: Vector3<T>, b: Vector3<T>) -> Vector3<T> {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// a + b.
#[inline(always)]
pub fn add<T: Real>(a: Vector3<T>, b: Vector3<T>) -> Vector3<T> {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// s a.
#[inline(always)]
pub fn scale<T: Real>(s: T, a: Vector3<T>) -> Vector3<T> {
    [s * a[0], s * a[1], s * a[2]]
}

/// s a + b.
#[inline(always)]
pub fn scale_add<T: Real, L: Level>(s: T, a: Vector3<T>, b: Vector3<T>) -> Vector3<T> {
    [s.mul_add::<L>(a[0], b[0]), s.mul_add::<L>(a[1], b[1]), s.mul_add::<L>(a[2], b[2])]
}

/// −a.
#[inline(always)]
pub fn negative<T: Real>(a: Vector3<T>) -> Vector3<T> {
    [-a[0], -a[1], -a[2]]
}

/// a·b.
#[inline(always)]
pub fn dot<T: Real, L: Level>(a: Vector3<T>, b: Vector3<T>) -> T {
    a[2].mul_add::<L>(b[2], a[1].mul_add::<L>(b[1], a[0] * b[0]))
}

/// a × b.
#[inline(always)]
pub fn cross<T: Real, L: Level>(a: Vector3<T>, b: Vector3<T>) -> Vector3<T> {
    [
        a[1].mul_add::<L>(b[2], -(a[2] * b[1])),
        a[2].mul_add::<L>(b[0], -(a[0] * b[2])),
        a[0].mul_add::<L>(b[1], -(a[1] * b[0])),
    ]
}

/// a × b + c.
#[inline(always)]
pub fn cross_add<T: Real, L: Level>(a: Vector3<T>, b: Vector3<T>, c: Vector3<T>) -> Vector3<T> {
    [
        a[1].mul_add::<L>(b[2], (-a[2]).mul_add::<L>(b[1], c[0])),
        a[2].mul_add::<L>(b[0], (-a[0]).mul_add::<L>(b[2], c[1])),
        a[0].mul_add::<L>(b[1], (-a[1]).mul_add::<L>(b[0], c[2])),
    ]
}

/// Builds a block from all nine entries.
macro_rules! block {
    (|$i:ident, $j:ident| $entry:expr) => {{
        let mut block = [[energy_dsl::Number::from_f64(0.0); 3]; 3];
        for $i in 0..3 {
            for $j in 0..3 {
                block[$i][$j] = $entry;
            }
        }
        block
    }};
}

/// Builds a symmetric block from its entries with i ≤ j.
macro_rules! symmetric {
    (|$i:ident, $j:ident| $entry:expr) => {{
        let mut block = [[energy_dsl::Number::from_f64(0.0); 3]; 3];
        for $i in 0..3 {
            for $j in $i..3 {
                let entry = $entry;
                block[$i][$j] = entry;
                block[$j][$i] = entry;
            }
        }
        block
    }};
}

pub(crate) use {block, symmetric};

/// −a.
#[inline(always)]
pub fn negative_block<T: Real>(a: &Block<T>) -> Block<T> {
    block!(|i, j| -a[i][j])
}
