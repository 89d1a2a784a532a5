//! Projection of element Hessians to positive semi-definite matrices.
//!
//! The projection works on the small Hessian by an element's difference vectors (6×6 for a triangle, 3×3 for a spring),
//! one element per lane. The result equals the projection of the full Hessian; see [`Orthonormal`]. Only functions of a
//! dihedral angle are treated otherwise: `hinge.rs` replaces the parts of their Hessians one by one.

mod definite;
mod dense;
mod hinge;
mod jacobi;
mod orthonormal;
mod planar;
mod radial;

use energy_dsl::{Kernel, Lane, Level, LevelName, Mask, dispatch_at};

pub(crate) use definite::is_semi_definite;
pub use dense::change_dense;
pub(crate) use hinge::Hinges;
pub(crate) use orthonormal::Orthonormal;

/// Treatment of negative eigenvalues of element Hessians. Force laws have no Hessian; their Jacobians are used
/// unchanged.
///
/// The Hessian of a function f(θ) of one [dihedral angle](energy_dsl::Declaration::dihedral) is f″ ∇θ ∇θᵀ plus f′ times
/// a matrix for each of its two triangles. These three parts are treated one by one, in closed form. Their sum is
/// positive semi-definite, and so is its difference to the exact Hessian, but it is not the nearest such matrix.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Curvature {
    /// Keeps negative eigenvalues; the sum may be indefinite.
    #[default]
    Exact,
    /// Sets negative eigenvalues to zero, which gives the nearest positive semi-definite matrix in the Frobenius norm
    /// (Teran, Sifakis, Irving and Fedkiw 2005, §5).
    Clamped,
    /// Replaces eigenvalues by their absolute values: directions of negative curvature become as stiff as they were
    /// soft (Chen, Hsu, Liu, Panetta, Sueda and Bickel 2024). Steps are shorter where the energy is far from convex.
    Absolute,
}

impl Curvature {
    /// Returns the change of an eigenvalue.
    #[inline(always)]
    fn change<V: Lane<f64>>(self, eigenvalue: V) -> V {
        let zero = V::splat(0.0);
        let to_zero = V::select(eigenvalue.less(zero), -eigenvalue, zero);
        match self {
            Self::Exact => zero,
            Self::Clamped => to_zero,
            Self::Absolute => to_zero + to_zero,
        }
    }
}

/// The largest number of coordinates that lanes support.
pub(crate) const MOST: usize = 12;

/// A square matrix per lane.
type Square<V, const N: usize> = [[V; N]; N];

/// Returns the index of entry (i, j), i ≤ j, in the upper triangle of an n×n matrix, row by row.
#[inline(always)]
const fn upper_index(n: usize, i: usize, j: usize) -> usize {
    i * (2 * n - i + 1) / 2 + j - i
}

/// Returns the largest magnitude.
#[inline(always)]
fn largest_of<V: Lane<f64>>(numbers: &[V]) -> V {
    let mut largest = V::splat(0.0);
    for &number in numbers {
        largest = largest.max(number.abs());
    }
    largest
}

/// Returns a mask of the lanes in which all numbers are finite.
#[inline(always)]
fn are_finite<V: Lane<f64>>(numbers: &[V]) -> V::Mask {
    let zero = V::splat(0.0);
    let mut products = zero;
    for &number in numbers {
        products = products + number * zero;
    }
    products.equal(zero)
}

/// The largest number of inputs of a projection: the upper triangle, then two difference vectors.
pub(crate) const MOST_NUMBERS: usize = MOST * (MOST + 1) / 2 + 6;

/// Projection of Hessians of `n` coordinates, one per lane, some of them indefinite. It does not depend on the type of
/// element, so it is compiled once per SIMD level instead of into each element's loop.
#[derive(Debug)]
pub(crate) struct Indefinite<'a> {
    pub(crate) n: usize,
    pub(crate) curvature: Curvature,
    pub(crate) orthonormal: &'a Orthonormal,
    /// The number of difference vectors, if it is 1 or 2; otherwise 0.
    pub(crate) vectors: usize,
    /// Bit mask of the lanes with an indefinite Hessian.
    pub(crate) open: u32,
    /// Upper triangles by the difference vectors of `orthonormal`, then these vectors; each number is stored for all
    /// lanes together.
    pub(crate) numbers: &'a mut [f64],
}

impl Indefinite<'_> {
    /// Projects the upper triangles and returns a bit mask of the changed lanes. Lanes without a change keep their
    /// bits, and so do lanes with a non-finite entry.
    ///
    /// `level` is the SIMD level whose lanes the numbers are laid out for.
    pub(crate) fn change(self, level: &str) -> u32 {
        let name = level.parse::<LevelName>().ok();
        name.and_then(|name| dispatch_at(name, self)).expect("the caller runs at this SIMD level")
    }
}

impl Kernel for Indefinite<'_> {
    type Output = u32;

    #[inline(always)]
    fn run<L: Level>(self) -> u32 {
        let lanes = <L::F64 as Lane<f64>>::LANES;
        let entries = self.n * (self.n + 1) / 2;
        let mut numbers = [L::F64::splat(0.0); MOST_NUMBERS];
        for (number, stored) in numbers.iter_mut().zip(self.numbers.chunks_exact(lanes)) {
            *number = L::F64::load(stored);
        }
        let (upper, vectors) = numbers.split_at_mut(entries);
        let vectors = vectors.as_chunks::<3>().0;
        let changed =
            change::<L, _>(upper, self.n, self.curvature, self.orthonormal, &vectors[..self.vectors], self.open);
        for (number, stored) in upper.iter().zip(self.numbers.chunks_exact_mut(lanes)) {
            number.store(stored);
        }
        changed.bits()
    }
}

#[inline(always)]
fn change<L: Level, V: Lane<f64>>(
    upper: &mut [V],
    n: usize,
    curvature: Curvature,
    orthonormal: &Orthonormal,
    vectors: &[[V; 3]],
    open: u32,
) -> V::Mask {
    let mut open = V::Mask::from_bits(open) & are_finite(upper);
    let mut changed = V::Mask::none();
    match vectors {
        [vector] => {
            let (radial, with_change) = radial::change(upper, curvature, *vector);
            let chosen = open & radial;
            for entry in 0..6 {
                upper[entry] = V::select(chosen, with_change[entry], upper[entry]);
            }
            changed = chosen;
            open = open & !radial;
        }
        [first, second] => {
            let (planar, also) = planar::change::<L, V>(upper, curvature, orthonormal, [*first, *second], open);
            changed = also;
            open = open & !planar;
        }
        _ => {}
    }
    changed
        | match n {
            3 => change_rest::<L, V, 3>(upper, curvature, orthonormal, open),
            6 => change_rest::<L, V, 6>(upper, curvature, orthonormal, open),
            9 => change_rest::<L, V, 9>(upper, curvature, orthonormal, open),
            _ => change_rest::<L, V, MOST>(upper, curvature, orthonormal, open),
        }
}

/// [`change`] for Hessians without known structure.
#[inline(always)]
fn change_rest<L: Level, V: Lane<f64>, const N: usize>(
    upper: &mut [V],
    curvature: Curvature,
    orthonormal: &Orthonormal,
    open: V::Mask,
) -> V::Mask {
    if !open.any() {
        return open;
    }
    let (mut a, scale) = scaled_square::<V, N>(upper);
    orthonormal.make_orthonormal(&mut a);
    let (mut difference, changed) = jacobi::difference::<L, V, N>(&mut a, curvature);
    let changed = changed & open;
    orthonormal.make_differences(&mut difference);
    add_to(upper, &difference, scale, changed);
    changed
}

/// Returns the whole matrix, scaled by a power of two to entries of about 1, so that squares neither overflow nor
/// vanish; and the scale.
#[inline(always)]
fn scaled_square<V: Lane<f64>, const N: usize>(upper: &[V]) -> (Square<V, N>, V) {
    let scale = largest_of(upper).power_of_two_scale();
    let mut a = [[V::splat(0.0); N]; N];
    for i in 0..N {
        for j in i..N {
            let entry = upper[upper_index(N, i, j)] * scale;
            a[i][j] = entry;
            a[j][i] = entry;
        }
    }
    (a, scale)
}

/// Adds a scaled difference in the `wanted` lanes.
#[inline(always)]
fn add_to<V: Lane<f64>, const N: usize>(upper: &mut [V], difference: &Square<V, N>, scale: V, wanted: V::Mask) {
    let unscale = V::splat(1.0) / scale;
    for i in 0..N {
        for j in i..N {
            let entry = &mut upper[upper_index(N, i, j)];
            *entry = V::select(wanted, *entry + difference[i][j] * unscale, *entry);
        }
    }
}
