//! Domains of consecutive rows, into which the solvers of symmetric systems divide large matrices among threads: what each relaxes on its own, what
//! couples it with others, and where they meet. The domains depend on the matrix alone, never on the number of threads.

mod couplings;
mod meeting;
mod triangle;

use std::ops::Range;

use energy_dsl::{Block, Level, Real, Vector3};

use crate::pattern::Pattern;

pub(crate) use self::couplings::Couplings;
pub(crate) use self::meeting::{Meeting, Shared};
pub(crate) use self::triangle::{SLACK, Triangle, scaled_block};

/// What numbers are stored and computed in: `f32` or `f64`.
pub trait Precision: Real + Into<f64> + Send + Sync {}

impl Precision for f32 {}
impl Precision for f64 {}

/// A vector of three in a register of four, with a last component that means nothing.
pub(crate) type Wide<T> = [T; 4];

/// Rows of a domain, about. A domain is what one thread at least relaxes on its own, so more of them cost iterations.
const DOMAIN: usize = 8192;

/// The rows of each domain.
pub(crate) fn ranges(rows: usize) -> Vec<Range<usize>> {
    let domains = (rows / DOMAIN).max(usize::from(rows > 0));
    (0..domains).map(|domain| domain * rows / domains..(domain + 1) * rows / domains).collect()
}

/// Domains of these consecutive rows, which make up the pattern.
pub(crate) fn divided<T: Precision>(pattern: &Pattern, ranges: &[Range<usize>]) -> Vec<(Triangle<T>, Couplings<T>)> {
    let triangles: Vec<_> = ranges.iter().map(|rows| Triangle::new(pattern, rows.clone())).collect();
    let couplings = Couplings::all(pattern, ranges, &triangles);
    triangles.into_iter().zip(couplings).collect()
}

/// C⁻¹ with C Cᵀ = D, C lower triangular; `None` where D is not positive definite.
#[inline(always)]
pub(crate) fn inverse_factor(diagonal: &Block<f64>) -> Option<Block<f64>> {
    let [[a, ..], [b, d, _], [c, e, f]] = *diagonal;
    let first = a.sqrt();
    let (second_first, third_first) = (b / first, c / first);
    let second = (d - second_first * second_first).sqrt();
    let third_second = (e - third_first * second_first) / second;
    let third = (f - third_first * third_first - third_second * third_second).sqrt();
    // A negative pivot has no root, a vanishing one no reciprocal.
    let [x, y, z] = [1.0 / first, 1.0 / second, 1.0 / third];
    let yx = -second_first * x * y;
    let zy = -third_second * y * z;
    let zx = -(third_first * x + third_second * yx) * z;
    let finite = x.is_finite() && y.is_finite() && z.is_finite() && zx.is_finite();
    (finite && x > 0.0 && y > 0.0 && z > 0.0).then_some([[x, 0.0, 0.0], [yx, y, 0.0], [zx, zy, z]])
}

/// C⁻¹ b.
#[inline(always)]
pub(crate) fn scaled(inverse: &Block<f64>, [u, v, w]: &Vector3<f64>) -> Vector3<f64> {
    let [[a, ..], [d, e, _], [f, g, h]] = inverse;
    [a * u, d * u + e * v, f * u + g * v + h * w]
}

/// C⁻ᵀ x.
#[inline(always)]
pub(crate) fn unscaled(inverse: &Block<f64>, [u, v, w]: &Vector3<f64>) -> Vector3<f64> {
    let [[a, ..], [b, c, _], [d, e, f]] = inverse;
    [a * u + b * v + d * w, c * v + e * w, f * w]
}

/// The sum of three partial sums, which do not wait for each other.
#[inline(always)]
pub(crate) fn total<T: Precision>(sums: &[Wide<T>; 3]) -> Wide<T> {
    let mut total = sums[0];
    for lane in 0..4 {
        total[lane] = sums[0][lane] + (sums[1][lane] + sums[2][lane]);
    }
    total
}

/// Subtracts B v from the sum of three, B stored column by column (and followed by one more number).
#[inline(always)]
pub(crate) fn subtract_product<T: Precision, L: Level>(sums: &mut [Wide<T>; 3], block: &[T], v: &Wide<T>) {
    for column in 0..3 {
        let factor = -v[column];
        for lane in 0..4 {
            sums[column][lane] = block[3 * column + lane].mul_add::<L>(factor, sums[column][lane]);
        }
    }
}

/// The sum of the first three of four sums.
#[inline(always)]
pub(crate) fn of_three(sums: [f64; 4]) -> f64 {
    // What is added up for nothing costs nothing, but without it compilers take registers apart.
    let [x, y, z, _] = std::hint::black_box(sums);
    x + y + z
}

/// Adds products of components, in doubles.
#[inline(always)]
pub(crate) fn add_products<T: Precision>(sums: &mut [f64; 4], a: &Wide<T>, b: &Wide<T>) {
    for lane in 0..4 {
        let product: f64 = (a[lane] * b[lane]).into();
        sums[lane] += product;
    }
}
