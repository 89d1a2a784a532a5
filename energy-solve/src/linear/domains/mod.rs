//! Domains of consecutive rows, into which solvers divide large symmetric matrices.
//!
//! Threads relax domains independently, exchange the vectors on their borders, and meet at barriers. The domains depend
//! on the matrix alone, never on the number of threads, so that results do not either.

mod couplings;
mod diagonal;
mod per_domain;
mod right_hand_scale;
mod triangle;

use std::ops::Range;

use energy_dsl::{BLOCK_NUMBERS, BlockSum, Kernel, Level};

use crate::matrix::block_matrix::BlockMatrix;
use crate::matrix::cross_blocks::CrossBlocks;
use crate::matrix::pattern::Pattern;

pub(crate) use self::couplings::Couplings;
pub(crate) use self::diagonal::{InverseFactor, inverse_factor, invert, rounded, scaled, unscaled};
pub(crate) use self::per_domain::PerDomain;
pub(crate) use self::right_hand_scale::RightHandScale;
use self::triangle::Blocks;
pub(crate) use self::triangle::{Triangle, scaled_block};
pub(crate) use crate::matrix::precision::Precision;

/// A 3-vector padded to a register of four; the last component is ignored.
pub(crate) type Wide<T> = [T; 4];

/// Approximate number of rows per domain. Each further domain weakens the relaxation and costs iterations.
const DOMAIN: usize = 8192;

/// Returns the rows of each domain.
pub(crate) fn ranges(rows: usize) -> Vec<Range<usize>> {
    let domains = (rows / DOMAIN).max(usize::from(rows > 0));
    (0..domains).map(|domain| domain * rows / domains..(domain + 1) * rows / domains).collect()
}

/// Creates the domains of these ranges of rows, which make up the pattern.
pub(crate) fn create_domains<T: Precision>(
    pattern: &Pattern,
    ranges: &[Range<usize>],
) -> Vec<(Triangle<T>, Couplings<T>)> {
    let triangles: Vec<_> = ranges.iter().map(|rows| Triangle::new(pattern, rows.clone())).collect();
    let couplings = Couplings::all(pattern, &CrossBlocks::default(), &triangles.iter().collect::<Vec<_>>());
    triangles.into_iter().zip(couplings).collect()
}

/// Lets the domains take blocks that the pattern lacks: all of the next matrix, in place of those of the last.
pub(crate) fn extend<'a, T: Precision + 'a>(
    domains: impl Iterator<Item = (&'a mut Triangle<T>, &'a mut Couplings<T>)>,
    pattern: &Pattern,
    cross: &CrossBlocks,
) {
    let (mut triangles, couplings): (Vec<_>, Vec<_>) = domains.unzip();
    if cross.is_empty() && triangles.iter().all(|triangle| !triangle.is_extended()) {
        return;
    }
    triangles.iter_mut().for_each(|triangle| triangle.extend(pattern, cross));
    let triangles: Vec<_> = triangles.iter().map(|triangle| &**triangle).collect();
    for (couplings, extended) in couplings.into_iter().zip(Couplings::all(pattern, cross, &triangles)) {
        *couplings = extended;
    }
}

/// Reads a domain's part of a matrix and of the blocks that it lacks, scaled by C⁻¹ of each row.
pub(crate) struct Scaling<'a, T, M> {
    pub(crate) triangle: &'a mut Triangle<T>,
    pub(crate) couplings: &'a mut Couplings<T>,
    pub(crate) inverses: &'a [InverseFactor<T>],
    pub(crate) matrix: &'a BlockMatrix<M>,
    pub(crate) cross: &'a CrossBlocks,
}

impl<T: Precision, M: Precision> Kernel for Scaling<'_, T, M> {
    type Output = ();

    #[inline(always)]
    fn run<L: Level>(self) {
        self.triangle.scale::<M, L>(self.inverses, self.matrix, self.cross);
        self.couplings.scale::<M, L>(self.inverses, self.matrix, self.cross);
    }
}

/// v ← v − Bᵀ u.
#[inline(always)]
pub(crate) fn subtract_transposed<T: Precision, L: Level>(v: &mut Wide<T>, block: &[T; BLOCK_NUMBERS], u: &Wide<T>) {
    let mut sum = *v;
    for row in 0..3 {
        let factor = -u[row];
        for lane in 0..4 {
            sum[lane] = block[3 * row + lane].mul_add::<L>(factor, sum[lane]);
        }
    }
    *v = sum;
}

/// Returns `from` minus the products of a row's blocks with rows of `v`.
#[inline(always)]
pub(crate) fn minus_products<T: Precision, L: Level>(
    mut blocks: Blocks<'_, T>,
    from: Wide<T>,
    v: &[Wide<T>],
) -> Wide<T> {
    // The nearest row was computed just before in a backward sweep. It comes last, so that the others do not wait for
    // it.
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

/// Returns its argument. `black_box` keeps LLVM from scalarising the registers; the unused lane is free.
#[inline(always)]
pub(crate) fn keep_vector<T>(registers: T) -> T {
    std::hint::black_box(registers)
}

/// Returns the sum of the first three of four sums.
#[inline(always)]
pub(crate) fn sum_of_three(sums: [f64; 4]) -> f64 {
    let [x, y, z, _] = keep_vector(sums);
    x + y + z
}

/// Adds the products of components, in double precision.
#[inline(always)]
pub(crate) fn add_products<T: Precision>(sums: &mut [f64; 4], a: &Wide<T>, b: &Wide<T>) {
    for lane in 0..4 {
        let product: f64 = (a[lane] * b[lane]).into();
        sums[lane] += product;
    }
}
