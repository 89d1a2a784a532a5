//! Domains of consecutive rows, into which the solvers of symmetric systems divide large matrices among threads: what each relaxes on its own, what
//! couples it with others, and where they meet. The domains depend on the matrix alone, never on the number of threads.

mod couplings;
mod diagonal;
mod meeting;
mod triangle;
mod unit;

use std::ops::Range;

use energy_dsl::{BLOCK_NUMBERS, BlockSum, Kernel, Level};

use crate::matrix::block_matrix::BlockMatrix;
use crate::matrix::pattern::Pattern;

pub(crate) use self::couplings::Couplings;
pub(crate) use self::diagonal::{InverseFactor, inverse_factor, invert, rounded, scaled, unscaled};
pub(crate) use self::meeting::{Meeting, Shared};
use self::triangle::Blocks;
pub(crate) use self::triangle::{Triangle, scaled_block};
pub(crate) use self::unit::Unit;
pub(crate) use crate::matrix::precision::Precision;

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

/// Takes over a domain's part of a matrix, scaled by C⁻¹ of each row.
pub(crate) struct Scaling<'a, T, M> {
    pub(crate) triangle: &'a mut Triangle<T>,
    pub(crate) couplings: &'a mut Couplings<T>,
    pub(crate) inverses: &'a [InverseFactor<T>],
    pub(crate) matrix: &'a BlockMatrix<M>,
}

impl<T: Precision, M: Precision> Kernel for Scaling<'_, T, M> {
    type Output = ();

    #[inline(always)]
    fn run<L: Level>(self) {
        self.triangle.scale::<M, L>(self.inverses, self.matrix);
        self.couplings.scale::<M, L>(self.inverses, self.matrix);
    }
}

/// v ← v − Bᵀ u.
#[inline(always)]
pub(crate) fn subtract_turned<T: Precision, L: Level>(v: &mut Wide<T>, block: &[T; BLOCK_NUMBERS], u: &Wide<T>) {
    let mut sum = *v;
    for row in 0..3 {
        let factor = -u[row];
        for lane in 0..4 {
            sum[lane] = block[3 * row + lane].mul_add::<L>(factor, sum[lane]);
        }
    }
    *v = sum;
}

/// A vector less the products of a row's blocks with later rows of another one.
#[inline(always)]
pub(crate) fn less_products<T: Precision, L: Level>(
    mut blocks: Blocks<'_, T>,
    from: Wide<T>,
    v: &[Wide<T>],
) -> Wide<T> {
    // The nearest row, computed just before when going back, comes last: the others do not have to wait for it.
    let nearest = blocks.next();
    let mut sum = T::Sum::<L>::zero();
    for (block, column) in blocks {
        sum.add(block, &v[column]);
    }
    let (total, mut less) = (sum.total(), from);
    for lane in 0..4 {
        less[lane] = less[lane] - total[lane];
    }
    match nearest {
        Some((block, column)) => T::Sum::<L>::less(less, block, &v[column]),
        None => less,
    }
}

/// The same: compilers take registers apart that are not needed whole, though what is computed for nothing costs nothing.
#[inline(always)]
pub(crate) fn whole<T>(registers: T) -> T {
    std::hint::black_box(registers)
}

/// The sum of the first three of four sums.
#[inline(always)]
pub(crate) fn of_three(sums: [f64; 4]) -> f64 {
    let [x, y, z, _] = whole(sums);
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
