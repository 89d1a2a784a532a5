//! Semi-definite Hessians of functions f(θ) of one dihedral angle, in closed form. This is in the spirit of Wu and Kim
//! 2023, *An Eigenanalysis of Angle-Based Deformation Energies*, but treats the two triangles one by one.
//!
//! Let the edge of a hinge have the length L and the unit vector ê. Each of its triangles has
//!
//! - an apex at the height h above the edge, with its foot at the fraction s of the edge,
//! - the unit normal n and, in its plane, the unit vector t from the edge to the apex,
//! - displacements d of the edge vector, and w of the apex relative to its foot.
//!
//! The first and second derivatives of θ along a displacement are sums over both triangles, with opposite signs if both
//! normals are along edge × apex:
//!
//! ```text
//! θ′ = Σ ± α,   θ″ = Σ ∓ 2 (α μ + β ρ),
//! α = n·w/h,   β = n·d/L,   μ = t·w/h,   ρ = ê·w/h + ½ t·d/L.
//! ```
//!
//! So ∇²θ = Σ ± S with S = −(A Bᵀ + B Aᵀ). The columns of A are the gradients of α and β, those of B the gradients of
//! μ and ρ. All columns of A are orthogonal to those of B, because n is orthogonal to t and ê. With G = Aᵀ A and
//! W = Bᵀ B, S² = A W Aᵀ + B G Bᵀ. The absolute value of S is the root of this matrix:
//!
//! ```text
//! |S| = A K_A Aᵀ + B K_B Bᵀ,   K_A G K_A = W,   K_B W K_B = G.
//! ```
//!
//! K_A and K_B are the geometric means of G⁻¹ and W, and of W⁻¹ and G. For 2×2 matrices they are
//!
//! ```text
//! K_A = (√(det W/det G) adj G + W)/z,   K_B = (√(det G/det W) adj W + G)/z,
//! z² = tr G W + 2 √(det G det W).
//! ```
//!
//! The Hessian H = f″ ∇θ ∇θᵀ + f′ ∇²θ is replaced by ½ (H + |H|) or by |H|, with
//!
//! ```text
//! |H| = |f″| ∇θ ∇θᵀ + |f′| (|S₁| + |S₂|).
//! ```
//!
//! Both are positive semi-definite, and so are their differences to H. Neither is the nearest such matrix, which has
//! no closed form. On nearly regular triangles, the trace of ½ (H + |H|) is larger than that of the nearest
//! matrix by 5 % for f′ = f″/10, and by 19 % for f′ = f″.

use energy_dsl::{Kernel, Lane, Level, Mask};

use super::definite::TOLERANCE;
use super::{Curvature, are_finite, upper_index};

/// Number of entries of the upper triangle of a reduced Hessian, which has 9 coordinates.
const ENTRIES: usize = 45;

/// First coordinates of the difference vectors: the edge x₄ − x₃, and the apexes x₁ − x₃ and x₂ − x₃.
const EDGE: usize = 0;
const APEXES: [usize; 2] = [3, 6];

/// Makes Hessians of functions of one dihedral angle positive semi-definite, one per lane. All hinges share this code:
/// a kernel is not inlined into each element's loop.
pub(crate) struct Hinges<'a, V> {
    pub(crate) curvature: Curvature,
    /// The edge, and both apexes.
    pub(crate) vectors: [[V; 3]; 3],
    /// Gradient by these vectors.
    pub(crate) gradient: &'a [V],
    /// Upper triangle of the Hessian by these vectors. Lanes without a change keep their bits.
    pub(crate) upper: &'a mut [V],
}

/// Bit masks of lanes.
pub(crate) struct HingeLanes {
    /// Lanes that were treated. The others have a degenerate triangle, or one so small or large that products of
    /// lengths could underflow or overflow.
    pub(crate) treated: u32,
    /// Lanes that were changed.
    pub(crate) changed: u32,
}

impl<V: Lane<f64>> Kernel for Hinges<'_, V> {
    type Output = HingeLanes;

    #[inline(always)]
    fn run<L: Level>(self) -> HingeLanes {
        let Self { curvature, vectors: [edge, first, second], gradient, upper } = self;
        let (zero, one) = (V::splat(0.0), V::splat(1.0));
        let edge = Edge::new::<L>(edge);
        let wings = [Wing::new::<L>(&edge, first), Wing::new::<L>(&edge, second)];
        let treated = edge.moderate & wings[0].moderate & wings[1].moderate;

        // The part of the Hessian by one apex is f″ n nᵀ/h² ∓ f′ (n tᵀ + t nᵀ)/h², the gradient ± f′ n/h.
        let Wing { n, per_height, .. } = wings[0];
        let by_apex = [gradient[APEXES[0]], gradient[APEXES[0] + 1], gradient[APEXES[0] + 2]];
        let per_squares = [per_height * per_height, wings[1].per_height * wings[1].per_height];
        let slope = dot::<L, V>(n, by_apex).abs() / per_height;
        let bend = along::<L, V>(upper, APEXES[0], n) / per_squares[0];

        // H is semi-definite only if f″ ≥ 0 and f′ = 0, or f′ is a rounding error: no eigenvalue is below −|f′| Σ ‖S‖,
        // and ‖∇θ‖² is Σ 1/h² or more.
        let tolerated = V::splat(TOLERANCE) * bend * (per_squares[0] + per_squares[1]);
        let least = slope * (wings[0].bound + wings[1].bound);
        let changed = treated & tolerated.less(least) & are_finite(upper);
        if !changed.any() {
            return HingeLanes { treated: treated.bits(), changed: 0 };
        }

        let (kept, added) = match curvature {
            Curvature::Exact => (one, zero),
            Curvature::Clamped => (V::splat(0.5), V::splat(0.5)),
            Curvature::Absolute => (zero, one),
        };
        let absolute = absolute::<L, V>(&edge, &wings, slope * added, bend.abs() * added);
        for entry in 0..ENTRIES {
            let with_change = kept.mul_add::<L>(upper[entry], absolute[entry]);
            upper[entry] = V::select(changed, with_change, upper[entry]);
        }
        HingeLanes { treated: treated.bits(), changed: changed.bits() }
    }
}

/// The edge of a hinge.
struct Edge<V: Lane<f64>> {
    vector: [V; 3],
    /// ê.
    unit: [V; 3],
    /// Length L.
    length: V,
    /// 1/L².
    per_squared: V,
    /// Mask of the lanes where no product underflows or overflows.
    moderate: V::Mask,
}

impl<V: Lane<f64>> Edge<V> {
    #[inline(always)]
    fn new<L: Level>(vector: [V; 3]) -> Self {
        let squared = dot::<L, V>(vector, vector);
        let (length, per_squared) = (squared.sqrt(), V::splat(1.0) / squared);
        let unit = scaled(vector, length * per_squared);
        Self { vector, unit, length, per_squared, moderate: squared.is_moderate(2) }
    }
}

/// A triangle of a hinge.
struct Wing<V: Lane<f64>> {
    n: [V; 3],
    t: [V; 3],
    /// The fraction s of the edge at the foot of the height.
    foot: V,
    /// 1/h.
    per_height: V,
    /// r = h/L.
    ratio: V,
    /// Upper triangle of K_A/h², for the form in n·w and r n·d.
    normal: [V; 3],
    /// Upper triangle of K_B/h², for the form in t·w and ê·w + ½ r t·d.
    planar: [V; 3],
    /// Upper bound of ‖S‖: z/h², the sum of its two positive eigenvalues.
    bound: V,
    /// Mask of the lanes where no product underflows or overflows.
    moderate: V::Mask,
}

impl<V: Lane<f64>> Wing<V> {
    #[inline(always)]
    fn new<L: Level>(edge: &Edge<V>, apex: [V; 3]) -> Self {
        let (one, two, half) = (V::splat(1.0), V::splat(2.0), V::splat(0.5));
        let normal = cross::<L, V>(edge.vector, apex);
        let area_squared = dot::<L, V>(normal, normal);
        let per_area = one / area_squared.sqrt();
        let n = scaled(normal, per_area);
        let t = cross::<L, V>(n, edge.unit);
        let per_height = edge.length * per_area;
        let ratio = area_squared * per_area * edge.per_squared;
        let foot = dot::<L, V>(edge.vector, apex) * edge.per_squared;

        // In terms of all four points and in units of 1/h², with C = 1 + s² + (1 − s)², k = 1 − 2 s and r = h/L:
        // G = [C, k r; k r, 2 r²] and W = [C, ½ k r; ½ k r, C + ½ r²].
        let squared = ratio * ratio;
        let (c, k) = (two * foot.mul_add::<L>(foot - one, one), one - two * foot);
        let (g_off, g_last) = (k * ratio, two * squared);
        let (w_off, w_last) = (half * g_off, half.mul_add::<L>(squared, c));
        let (det_g, det_w) = (V::splat(3.0) * squared, c.mul_add::<L>(c, V::splat(0.75) * squared));
        let trace = c.mul_add::<L>(c, (k * k).mul_add::<L>(squared, g_last * w_last));
        let root = (det_g * det_w).sqrt();
        let z = two.mul_add::<L>(root, trace).sqrt();

        let (p, q) = (root / det_g, root / det_w);
        let k_a = [p.mul_add::<L>(g_last, c), w_off - p * g_off, p.mul_add::<L>(c, w_last)];
        let k_b = [q.mul_add::<L>(w_last, c), g_off - q * w_off, q.mul_add::<L>(c, g_last)];
        let per_squared = per_height * per_height;
        let scale = per_squared / z;
        Self {
            n,
            t,
            foot,
            per_height,
            ratio,
            normal: scaled(k_a, scale),
            planar: scaled(k_b, scale),
            bound: per_squared * z,
            moderate: area_squared.is_moderate(4) & squared.is_moderate(2) & c.is_moderate(2),
        }
    }
}

/// Returns the upper triangle of |f″| g gᵀ + |f′| (|S₁| + |S₂|).
#[inline(always)]
fn absolute<L: Level, V: Lane<f64>>(edge: &Edge<V>, wings: &[Wing<V>; 2], slope: V, bend: V) -> [V; ENTRIES] {
    let mut upper = [V::splat(0.0); ENTRIES];
    for side in 0..2 {
        let Wing { n, t, foot, per_height, ratio, normal, planar, .. } = &wings[side];
        // The blocks of the form by w and d.
        let [a_first, a_off, a_last] = scaled(*normal, slope);
        let a_first = bend.mul_add::<L>(*per_height * *per_height, a_first);
        let [b_first, b_off, b_last] = scaled(*planar, slope);
        let by_t = sum::<L, V>(b_first, *t, scaled(edge.unit, b_off));
        let by_unit = sum::<L, V>(b_off, *t, scaled(edge.unit, b_last));
        let half_ratio = V::splat(0.5) * *ratio;
        let (ww_n, wd_n, dd_n) =
            (scaled(*n, a_first), scaled(*n, a_off * *ratio), scaled(*n, a_last * *ratio * *ratio));
        let (wd_t, dd_t) = (scaled(by_unit, half_ratio), scaled(*t, b_last * half_ratio * half_ratio));
        let apex = APEXES[side];
        for i in 0..3 {
            for j in 0..3 {
                // w is the displacement of the apex minus s d.
                let ww = ww_n[i].mul_add::<L>(n[j], by_t[i].mul_add::<L>(t[j], by_unit[i] * edge.unit[j]));
                let wd = wd_n[i].mul_add::<L>(n[j], wd_t[i] * t[j]);
                let dw = wd_n[j].mul_add::<L>(n[i], wd_t[j] * t[i]);
                let mixed = (-*foot).mul_add::<L>(ww, dw);
                upper[upper_index(9, EDGE + i, apex + j)] = mixed;
                if i <= j {
                    upper[upper_index(9, apex + i, apex + j)] = ww;
                    let dd = dd_n[i].mul_add::<L>(n[j], dd_t[i] * t[j]);
                    let of_edge = &mut upper[upper_index(9, EDGE + i, EDGE + j)];
                    *of_edge = *of_edge + (-*foot).mul_add::<L>(wd + mixed, dd);
                }
            }
        }
    }
    // The part of g gᵀ between the triangles: θ changes by α₁ − α₂ if both normals are edge × apex.
    let [first, second] = wings;
    let between = scaled(first.n, -bend * first.per_height * second.per_height);
    let feet = first.foot * second.foot;
    for i in 0..3 {
        for j in 0..3 {
            let product = between[i] * second.n[j];
            let mirrored = between[j] * second.n[i];
            upper[upper_index(9, APEXES[0] + i, APEXES[1] + j)] = product;
            let by_first = &mut upper[upper_index(9, EDGE + i, APEXES[0] + j)];
            *by_first = (-second.foot).mul_add::<L>(mirrored, *by_first);
            let by_second = &mut upper[upper_index(9, EDGE + i, APEXES[1] + j)];
            *by_second = (-first.foot).mul_add::<L>(product, *by_second);
            if i <= j {
                let of_edge = &mut upper[upper_index(9, EDGE + i, EDGE + j)];
                *of_edge = feet.mul_add::<L>(product + mirrored, *of_edge);
            }
        }
    }
    upper
}

/// Returns nᵀ H n for the diagonal block of three coordinates.
#[inline(always)]
fn along<L: Level, V: Lane<f64>>(upper: &[V], first: usize, n: [V; 3]) -> V {
    let mut product = [V::splat(0.0); 3];
    for i in 0..3 {
        for j in 0..3 {
            let entry = upper[upper_index(9, first + i.min(j), first + i.max(j))];
            product[i] = entry.mul_add::<L>(n[j], product[i]);
        }
    }
    dot::<L, V>(n, product)
}

#[inline(always)]
fn dot<L: Level, V: Lane<f64>>(a: [V; 3], b: [V; 3]) -> V {
    a[2].mul_add::<L>(b[2], a[1].mul_add::<L>(b[1], a[0] * b[0]))
}

/// Returns a × b. Each component is accurate even if its products cancel, as in needle triangles (Kahan).
#[inline(always)]
fn cross<L: Level, V: Lane<f64>>(a: [V; 3], b: [V; 3]) -> [V; 3] {
    let mut cross = [V::splat(0.0); 3];
    for i in 0..3 {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        let product = a[k] * b[j];
        cross[i] = a[j].fused_mul_sub::<L>(b[k], product) - a[k].product_error::<L>(b[j]);
    }
    cross
}

#[inline(always)]
fn scaled<V: Lane<f64>>(vector: [V; 3], factor: V) -> [V; 3] {
    [vector[0] * factor, vector[1] * factor, vector[2] * factor]
}

/// Returns factor · a + b.
#[inline(always)]
fn sum<L: Level, V: Lane<f64>>(factor: V, a: [V; 3], b: [V; 3]) -> [V; 3] {
    [factor.mul_add::<L>(a[0], b[0]), factor.mul_add::<L>(a[1], b[1]), factor.mul_add::<L>(a[2], b[2])]
}
