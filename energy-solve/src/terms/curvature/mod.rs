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
mod square;

use energy_dsl::{Kernel, Lane, Level, LevelName, Mask, Number, dispatch_at};

pub(crate) use definite::is_semi_definite;
pub use dense::change_dense;
pub(crate) use dense::change_upper;
pub(crate) use hinge::Hinges;
pub(crate) use orthonormal::Orthonormal;
use square::{AnySquare, Square};

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

/// The largest number of coordinates whose matrices are arrays.
const MOST: usize = 12;

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

/// How Hessians are projected.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Projection<'a> {
    pub(crate) curvature: Curvature,
    pub(crate) orthonormal: &'a Orthonormal,
    /// Number of coordinates.
    pub(crate) n: usize,
    /// The number of difference vectors, if it is 1 or 2; otherwise 0.
    pub(crate) vectors: usize,
}

impl Projection<'_> {
    /// Projects the Hessians of all lanes: upper triangles, then vectors, each number for all lanes together. Returns a
    /// bit mask of the changed lanes.
    pub(crate) fn change_all<L: Level>(self, numbers: &mut [f64]) -> u32 {
        let open = u32::MAX >> (32 - <L::F64 as Lane<f64>>::LANES);
        Indefinite { projection: self, open, numbers }.change(L::NAME)
    }

    /// Projects the Hessians of some elements, as many at a time as there are lanes. `first` returns the number of an
    /// element's first number; its others follow at a `stride`: first those of the upper triangle, then those of the
    /// vectors. Calls `changed` for each element that was changed.
    pub(crate) fn change_some<L: Level>(
        self,
        elements: &[usize],
        (numbers, stride): (&mut [f64], usize),
        first: impl Fn(usize) -> usize,
        mut changed: impl FnMut(usize),
    ) {
        let lanes = <L::F64 as Lane<f64>>::LANES;
        let upper = self.n * (self.n + 1) / 2;
        let mut stored = vec![0.0; (upper + 3 * self.vectors) * lanes];
        for chunk in elements.chunks(lanes) {
            let open = u32::MAX >> (32 - chunk.len());
            for lane in 0..lanes {
                // Surplus lanes repeat the last element.
                let own = numbers[first(chunk[lane.min(chunk.len() - 1)])..].iter().step_by(stride);
                stored[lane..].iter_mut().step_by(lanes).zip(own).for_each(|(stored, number)| *stored = *number);
            }
            let bits = Indefinite { projection: self, open, numbers: &mut stored }.change(L::NAME);
            for (lane, &element) in chunk.iter().enumerate().filter(|(lane, _)| bits >> lane & 1 == 1) {
                let own = numbers[first(element)..].iter_mut().step_by(stride).take(upper);
                own.zip(stored[lane..].iter().step_by(lanes)).for_each(|(number, stored)| *number = *stored);
                changed(element);
            }
        }
    }
}

/// Projection of Hessians, one per lane, some of them indefinite. It does not depend on the type of element, so it is
/// compiled once per SIMD level instead of into each element's loop.
#[derive(Debug)]
struct Indefinite<'a> {
    projection: Projection<'a>,
    /// Bit mask of the lanes with an indefinite Hessian.
    open: u32,
    /// Upper triangles by the difference vectors of `orthonormal`, then these vectors; each number is stored for all
    /// lanes together.
    numbers: &'a mut [f64],
}

impl Indefinite<'_> {
    /// Projects the upper triangles and returns a bit mask of the changed lanes. Lanes without a change keep their
    /// bits, and so do lanes with a non-finite entry.
    ///
    /// `level` is the SIMD level whose lanes the numbers are laid out for.
    fn change(self, level: &str) -> u32 {
        let name = level.parse::<LevelName>().ok();
        name.and_then(|name| dispatch_at(name, self)).expect("the caller runs at this SIMD level")
    }

    #[inline(always)]
    fn store<V: Lane<f64>>(self, upper: &[V]) {
        for (number, stored) in upper.iter().zip(self.numbers.chunks_exact_mut(V::LANES)) {
            number.store(stored);
        }
    }
}

impl Kernel for Indefinite<'_> {
    type Output = u32;

    #[inline(always)]
    fn run<L: Level>(self) -> u32 {
        let Projection { curvature, orthonormal, n, vectors } = self.projection;
        let lanes = <L::F64 as Lane<f64>>::LANES;
        let entries = n * (n + 1) / 2;
        if n > MOST {
            let mut upper = vec![L::F64::splat(0.0); entries];
            for (number, stored) in upper.iter_mut().zip(self.numbers.chunks_exact(lanes)) {
                *number = L::F64::load(stored);
            }
            let open = <L::F64 as Number>::Mask::from_bits(self.open) & are_finite(&upper);
            let changed = change_rest::<L, _, _>(&mut upper, AnySquare::zeros_of(n), curvature, orthonormal, open);
            self.store(&upper);
            return changed.bits();
        }
        let mut numbers = [L::F64::splat(0.0); MOST * (MOST + 1) / 2 + 6];
        for (number, stored) in numbers.iter_mut().zip(self.numbers.chunks_exact(lanes)) {
            *number = L::F64::load(stored);
        }
        let (upper, known) = numbers.split_at_mut(entries);
        let known = &known.as_chunks::<3>().0[..vectors];
        let changed = change::<L, _>(upper, n, curvature, orthonormal, known, self.open);
        self.store(upper);
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
            3 => change_rest::<L, V, _>(upper, [[V::splat(0.0); 3]; 3], curvature, orthonormal, open),
            6 => change_rest::<L, V, _>(upper, [[V::splat(0.0); 6]; 6], curvature, orthonormal, open),
            9 => change_rest::<L, V, _>(upper, [[V::splat(0.0); 9]; 9], curvature, orthonormal, open),
            _ => change_rest::<L, V, _>(upper, [[V::splat(0.0); MOST]; MOST], curvature, orthonormal, open),
        }
}

/// [`change`] for Hessians without known structure; `zeros` has their size.
#[inline(always)]
fn change_rest<L: Level, V: Lane<f64>, A: Square<V>>(
    upper: &mut [V],
    zeros: A,
    curvature: Curvature,
    orthonormal: &Orthonormal,
    open: V::Mask,
) -> V::Mask {
    if !open.any() {
        return open;
    }
    let mut a = zeros;
    let scale = fill_scaled(&mut a, upper);
    orthonormal.make_orthonormal(&mut a);
    let (mut difference, changed) = jacobi::difference::<L, V, A>(&mut a, curvature);
    let changed = changed & open;
    orthonormal.make_differences(&mut difference);
    add_to(upper, &difference, scale, changed);
    changed
}

/// Fills a matrix, scaled by a power of two to entries of about 1, so that squares neither overflow nor vanish. Returns
/// the scale.
#[inline(always)]
fn fill_scaled<V: Lane<f64>, A: Square<V>>(a: &mut A, upper: &[V]) -> V {
    let (n, scale) = (a.size(), largest_of(upper).power_of_two_scale());
    for i in 0..n {
        for j in i..n {
            let entry = upper[upper_index(n, i, j)] * scale;
            a.set(i, j, entry);
            a.set(j, i, entry);
        }
    }
    scale
}

/// Adds a scaled difference in the `wanted` lanes.
#[inline(always)]
fn add_to<V: Lane<f64>, A: Square<V>>(upper: &mut [V], difference: &A, scale: V, wanted: V::Mask) {
    let (n, unscale) = (difference.size(), V::splat(1.0) / scale);
    for i in 0..n {
        for j in i..n {
            let entry = &mut upper[upper_index(n, i, j)];
            *entry = V::select(wanted, *entry + difference.at(i, j) * unscale, *entry);
        }
    }
}
