//! The formulas of the timed elements as papers print them, over the numbers of num-dual.

use nalgebra::Const;
use num_dual::{Dual2Vec, DualNum};
use verify::sample::Sample;

/// Second-order dual numbers: they carry a gradient and a Hessian by `N` coordinates.
pub(super) type Second<const N: usize> = Dual2Vec<f64, Const<N>>;

/// A formula of points, parameters and rest shape.
pub(super) type Plain<D> = fn(&[[D; 3]], &[f64], &[f64]) -> D;

/// Returns the Hessian by one evaluation, row by row.
pub(super) fn hessian<const N: usize>(formula: Plain<Second<N>>, sample: &Sample) -> Vec<f64> {
    let number = |coordinate: usize| Second::<N>::from_re(sample.positions[coordinate]).derivative(coordinate);
    let points: [[Second<N>; 3]; 4] = std::array::from_fn(|point| {
        std::array::from_fn(|axis| if 3 * point < N { number(3 * point + axis) } else { Second::from_re(0.0) })
    });
    let value = formula(&points[..N / 3], &sample.parameters, &sample.rest);
    value.v2.0.map_or_else(|| vec![0.0; N * N], |matrix| matrix.as_slice().to_vec())
}

/// A number type of num-dual over doubles.
pub(super) trait Dual: DualNum<Primitive = f64> + Copy {}

impl<D: DualNum<Primitive = f64> + Copy> Dual for D {}

fn sub<D: Dual>(a: &[D; 3], b: &[D; 3]) -> [D; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn dot<D: Dual>(a: &[D; 3], b: &[D; 3]) -> D {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross<D: Dual>(a: &[D; 3], b: &[D; 3]) -> [D; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn norm<D: Dual>(a: &[D; 3]) -> D {
    dot(a, a).sqrt()
}

/// ‖p − q‖.
pub(super) fn distance<D: Dual>(x: &[[D; 3]], _: &[f64], _: &[f64]) -> D {
    norm(&sub(&x[0], &x[1]))
}

/// K/2 (‖p − q‖ − L)².
pub(super) fn spring<D: Dual>(x: &[[D; 3]], p: &[f64], _: &[f64]) -> D {
    (norm(&sub(&x[1], &x[0])) - p[1]).powi(2) * (p[0] / 2.0)
}

/// −κ (r − d̂)² ln(r/d̂) for r < d̂, else 0.
pub(super) fn barrier<D: Dual>(x: &[[D; 3]], p: &[f64], _: &[f64]) -> D {
    let r = norm(&sub(&x[0], &x[1]));
    if r.re() < p[1] { (r - p[1]).powi(2) * (r / p[1]).ln() * -p[0] } else { D::zero() }
}

/// k/2 (1 − â·b̂).
pub(super) fn hair_bend<D: Dual>(x: &[[D; 3]], p: &[f64], _: &[f64]) -> D {
    let (a, b) = (sub(&x[1], &x[0]), sub(&x[2], &x[1]));
    (-(dot(&a, &b) / (dot(&a, &a) * dot(&b, &b)).sqrt()) + 1.0) * (p[0] / 2.0)
}

/// The dihedral angle θ = atan2(−‖E‖ b·(E × a), −(E × a)·(E × b)).
pub(super) fn dihedral<D: Dual>(x: &[[D; 3]], _: &[f64], _: &[f64]) -> D {
    let (e, a, b) = (sub(&x[3], &x[2]), sub(&x[0], &x[2]), sub(&x[1], &x[2]));
    let (m, n) = (cross(&e, &a), cross(&e, &b));
    let (sine, cosine) = (-(norm(&e) * dot(&b, &m)), -dot(&m, &n));
    // num-dual's atan2 divides by its second argument.
    if cosine.re().abs() >= sine.re().abs() {
        return sine.atan2(cosine);
    }
    -(cosine / sine).atan() + std::f64::consts::FRAC_PI_2.copysign(sine.re())
}

/// K′ (2 (cos θ₀/2 − cos θ/2) − (θ − θ₀) sin θ₀/2).
pub(super) fn bridson<D: Dual>(x: &[[D; 3]], p: &[f64], _: &[f64]) -> D {
    let (angle, half) = (dihedral(x, p, &[]), p[1] / 2.0);
    (-((angle * 0.5).cos() * 2.0) + 2.0 * half.cos() - (angle - p[1]) * half.sin()) * p[0]
}

/// ¾ k per area ‖Σ c x‖² with the cotangents c of the rest shape.
pub(super) fn flat_bending<D: Dual>(x: &[[D; 3]], p: &[f64], rest: &[f64]) -> D {
    let at = |point: usize| [rest[3 * point], rest[3 * point + 1], rest[3 * point + 2]];
    let [r1, r2, r3, r4] = [at(0), at(1), at(2), at(3)];
    let (e, back) = (sub(&r4, &r3), sub(&r3, &r4));
    let (n1, n2) = (norm(&cross(&e, &sub(&r1, &r3))), norm(&cross(&e, &sub(&r2, &r3))));
    let at3 = dot(&e, &sub(&r1, &r3)) / n1 + dot(&e, &sub(&r2, &r3)) / n2;
    let at4 = dot(&back, &sub(&r1, &r4)) / n1 + dot(&back, &sub(&r2, &r4)) / n2;
    let apart = dot(&e, &e) / n2;
    let (a, b, c) = (sub(&x[2], &x[0]), sub(&x[3], &x[0]), sub(&x[1], &x[0]));
    let k: [D; 3] = std::array::from_fn(|axis| a[axis] * at4 + b[axis] * at3 - c[axis] * apart);
    dot(&k, &k) * (1.5 * p[0] / (n1 + n2))
}

/// The deformation of a triangle: rest area, columns of F = [a b] D⁻¹, and J.
struct Deformed<D> {
    area: f64,
    u: [D; 3],
    v: [D; 3],
    a: [D; 3],
    b: [D; 3],
}

impl<D: Dual> Deformed<D> {
    fn new(x: &[[D; 3]], rest: &[f64]) -> Self {
        let (du, dv) = ([rest[2] - rest[0], rest[3] - rest[1]], [rest[4] - rest[0], rest[5] - rest[1]]);
        let det = du[0] * dv[1] - du[1] * dv[0];
        let (a, b) = (sub(&x[1], &x[0]), sub(&x[2], &x[0]));
        let u = std::array::from_fn(|axis| a[axis] * (dv[1] / det) - b[axis] * (du[1] / det));
        let v = std::array::from_fn(|axis| b[axis] * (du[0] / det) - a[axis] * (dv[0] / det));
        Self { area: det / 2.0, u, v, a, b }
    }

    /// I = tr FᵀF.
    fn trace(&self) -> D {
        dot(&self.u, &self.u) + dot(&self.v, &self.v)
    }

    /// J, the ratio of areas.
    fn ratio(&self) -> D {
        norm(&cross(&self.a, &self.b)) / (2.0 * self.area)
    }
}

/// A (μ E:E + λ/2 (tr E)²), E = (FᵀF − 1)/2.
pub(super) fn stvk<D: Dual>(x: &[[D; 3]], p: &[f64], rest: &[f64]) -> D {
    let f = Deformed::new(x, rest);
    let (uu, vv) = ((dot(&f.u, &f.u) - 1.0) * 0.5, (dot(&f.v, &f.v) - 1.0) * 0.5);
    let uv = dot(&f.u, &f.v) * 0.5;
    ((uu * uu + vv * vv + uv * uv * 2.0) * p[1] + (uu + vv).powi(2) * (p[0] / 2.0)) * f.area
}

/// A μ/2 (I − 2 √(I + 2 J) + 2).
pub(super) fn arap<D: Dual>(x: &[[D; 3]], p: &[f64], rest: &[f64]) -> D {
    let f = Deformed::new(x, rest);
    let trace = f.trace();
    (trace - (trace + f.ratio() * 2.0).sqrt() * 2.0 + 2.0) * (f.area * p[0] / 2.0)
}

/// A/2 (μ (I − 2 − ln((I + 1)/3)) + λ ((J − α)² − (1 − α)²)), α = 1 + 2μ/(3λ).
pub(super) fn stable_neo_hookean_log<D: Dual>(x: &[[D; 3]], p: &[f64], rest: &[f64]) -> D {
    let (f, alpha) = (Deformed::new(x, rest), 1.0 + 2.0 * p[1] / (3.0 * p[0]));
    let trace = f.trace();
    let shape = (trace - 2.0 - ((trace + 1.0) / 3.0).ln()) * p[1];
    let area = ((f.ratio() - alpha).powi(2) - (1.0 - alpha).powi(2)) * p[0];
    (shape + area) * (f.area / 2.0)
}

/// A/2 (μ (I − 2 − 2 ln J) + λ ln² J).
pub(super) fn neo_hookean<D: Dual>(x: &[[D; 3]], p: &[f64], rest: &[f64]) -> D {
    let f = Deformed::new(x, rest);
    let log = f.ratio().ln();
    ((f.trace() - 2.0 - log * 2.0) * p[1] + log * log * p[0]) * (f.area / 2.0)
}
