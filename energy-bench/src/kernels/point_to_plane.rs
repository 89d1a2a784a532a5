use energy_dsl::{
    Baseline, Declaration, Element, Lane, Level, Mask, PackedResidual, Real, Residual, ResidualJacobian, Vector3,
};
use energy_elements::PointToPlane;
use nalgebra::SVector;
use num_dual::gradient;

use crate::assembled::Assembled;
use crate::dual::{Dual, cross as dual_cross, dot as dual_dot};
use crate::random::Random;
use crate::sample::Coincident;
use crate::sample::{Row, Sample, number_count, residual};
use crate::subject::Subject;
use crate::vector::{add, cross, cross_add, dot, scale, scale_add, sub};

/// K5: signed distance r = n̂·(v̂ − u) of a point to a plane, and its gradient. The hats denote motion by the blend of
/// four twists.
#[derive(Clone, Copy, Debug)]
pub struct PointToPlaneKernel;

/// The twist of a node and terms of its motion.
#[derive(Clone, Copy)]
struct Node<T> {
    weight: T,
    turn: Vector3<T>,
    shift: Vector3<T>,
    /// cos ‖θ‖.
    cosine: T,
    /// sin ‖θ‖/‖θ‖. `slope` is its derivative, (cos ‖θ‖ − sin ‖θ‖/‖θ‖)/‖θ‖², as a factor of θ.
    sinc: T,
    slope: T,
    /// θ sin ‖θ‖/‖θ‖.
    axis: Vector3<T>,
}

/// Returns sin ‖θ‖/‖θ‖ and (cos ‖θ‖ − sin ‖θ‖/‖θ‖)/‖θ‖², given y = ‖θ‖².
#[inline(always)]
fn sinc<T: Real, L: Level>(y: T) -> (T, T) {
    /// (−1)^k/(2 k + 1)!.
    const SINC: [f64; 8] = [
        1.0,
        -1.0 / 6.0,
        1.0 / 120.0,
        -1.0 / 5040.0,
        1.0 / 362_880.0,
        -1.0 / 39_916_800.0,
        1.0 / 6_227_020_800.0,
        -1.0 / 1_307_674_368_000.0,
    ];
    /// (−1)^k 2 k/(2 k + 1)! for k ≥ 1.
    const SLOPE: [f64; 8] = [
        -2.0 / 6.0,
        4.0 / 120.0,
        -6.0 / 5040.0,
        8.0 / 362_880.0,
        -10.0 / 39_916_800.0,
        12.0 / 6_227_020_800.0,
        -14.0 / 1_307_674_368_000.0,
        16.0 / 355_687_428_096_000.0,
    ];
    let (mut sinc, mut slope) = (T::from_f64(SINC[7]), T::from_f64(SLOPE[7]));
    for k in (0..7).rev() {
        sinc = sinc.mul_add::<L>(y, T::from_f64(SINC[k]));
        slope = slope.mul_add::<L>(y, T::from_f64(SLOPE[k]));
    }
    // The series hold for ‖θ‖ ≤ π/4: a rotation by up to a right angle, as θ is half of its rotation vector.
    let small = y.less_or_equal(T::from_f64(0.62));
    if small.all() { (sinc, slope) } else { large::<T, L>(y, small, sinc, slope) }
}

#[cold]
#[inline(never)]
fn large<T: Real, L: Level>(y: T, small: T::Mask, sinc: T, slope: T) -> (T, T) {
    let angle = y.sqrt();
    let (sine, cosine) = angle.sin_cos::<L>();
    let quotient = sine / angle;
    (T::select(small, sinc, quotient), T::select(small, slope, (cosine - quotient) / y))
}

#[inline(always)]
fn node<T: Real, L: Level>(weight: T, twist: &[T]) -> Node<T> {
    let (turn, shift) = ([twist[0], twist[1], twist[2]], [twist[3], twist[4], twist[5]]);
    let y = dot::<T, L>(turn, turn);
    let (sinc, slope) = sinc::<T, L>(y);
    Node { weight, turn, shift, cosine: y.mul_add::<L>(slope, sinc), sinc, slope, axis: scale(sinc, turn) }
}

impl Subject for PointToPlaneKernel {
    const KEY: &'static str = "K5";
    const TITLE: &'static str = "point to plane";
    const DECLARATION: &'static Declaration = <PointToPlane as Element>::DECLARATION;
    const ROUTINE: &'static str = "jacobian";
    type Element = PointToPlane;
    /// w, v, n, u, then four times θ and t.
    type Hand<T: Copy> = [T; 37];
    type HandAnswer<T: Real> = Row<T, 24>;
    type GeneratedAnswer<T: Real> = ResidualJacobian<T, [T; 1], [T; 24]>;

    fn sample(random: &mut Random) -> Sample {
        let w = [0.0; 4].map(|_| random.between(0.2, 1.0));
        let (v, n) = (random.vector(1.0), random.direction());
        let (turn, shift) = (random.direction().map(|x| 0.3 * x), random.vector(0.3));
        let mut unknowns = Vec::new();
        for _ in 0..4 {
            let (more_turn, more_shift) = (random.vector(0.1), random.vector(0.1));
            unknowns.extend(add(turn, more_turn));
            unknowns.extend(add(shift, more_shift));
        }
        let u = add(add(v, shift), random.vector(0.5));
        let element = PointToPlane { w, v, n, u };
        let all = [&w, v.as_slice(), &n, &u, &unknowns].concat();
        Sample::new(&element, &unknowns, all.clone(), all)
    }

    /// The unit real part of the blend is (w, p), twice its dual part is (W, X).
    ///
    /// ```text
    /// n̂ = n + 2 (w m + p × m)      with m = p × n
    /// τ = w X − W p + p × X        the translation
    /// r = n·v + n̂·(τ − u)          because rotations preserve dot products
    /// ```
    ///
    /// The gradient with respect to these eight numbers loses the part that normalisation removes. Then it is pulled
    /// back to each twist.
    #[inline(always)]
    fn hand<T: Real, L: Level>(x: &[T; 37]) -> Row<T, 24> {
        let nodes = [
            node::<T, L>(x[0], &x[13..19]),
            node::<T, L>(x[1], &x[19..25]),
            node::<T, L>(x[2], &x[25..31]),
            node::<T, L>(x[3], &x[31..37]),
        ];
        let (v, n, u) = ([x[4], x[5], x[6]], [x[7], x[8], x[9]], [x[10], x[11], x[12]]);
        let zero = T::from_f64(0.0);
        let (mut w, mut p, mut dual_w, mut dual_x) = (zero, [zero; 3], zero, [zero; 3]);
        for (k, node) in nodes.iter().enumerate() {
            let weighted = scale(node.weight, node.axis);
            let weighted_cosine = node.weight * node.cosine;
            // The product (0, t) (cos, axis) of quaternions.
            let inner = -dot::<T, L>(node.shift, weighted);
            let outer = cross_add::<T, L>(node.shift, weighted, scale(weighted_cosine, node.shift));
            (w, p, dual_w, dual_x) = if k == 0 {
                (weighted_cosine, weighted, inner, outer)
            } else {
                (w + weighted_cosine, add(p, weighted), dual_w + inner, add(dual_x, outer))
            };
        }
        let per_length = T::from_f64(1.0) / w.mul_add::<L>(w, dot::<T, L>(p, p)).sqrt();
        let (w, p, dual_w, dual_x) =
            (w * per_length, scale(per_length, p), dual_w * per_length, scale(per_length, dual_x));

        let two_n = add(n, n);
        let two_m = cross::<T, L>(p, two_n);
        let normal = cross_add::<T, L>(p, two_m, scale_add::<T, L>(w, two_m, n));
        let shift = cross_add::<T, L>(p, dual_x, scale_add::<T, L>(w, dual_x, scale(-dual_w, p)));
        let d = sub(shift, u);
        let moved = dot::<T, L>(normal, d);
        let value = dot::<T, L>(n, v) + moved;

        let inner = cross_add::<T, L>(d, p, scale(w, d));
        let by_p = cross_add::<T, L>(two_m, d, cross::<T, L>(two_n, inner));
        let by_p = cross_add::<T, L>(dual_x, normal, scale_add::<T, L>(-dual_w, normal, by_p));
        let by_w = dot::<T, L>(d, two_m) + dot::<T, L>(normal, dual_x);
        // Component of the gradient along (w, p) and (W, X), which normalisation removes.
        let radial = moved - dot::<T, L>(n, d) + dot::<T, L>(normal, shift);
        let radial = -(radial + radial);
        let by_p = scale(per_length, scale_add::<T, L>(radial, p, by_p));
        let by_w = per_length * radial.mul_add::<L>(w, by_w);
        let by_dual_w = -per_length * dot::<T, L>(normal, p);
        let by_dual_x = scale(per_length, cross_add::<T, L>(normal, p, scale(w, normal)));

        let mut jacobian = [zero; 24];
        for (k, node) in nodes.iter().enumerate() {
            let Node { weight, turn, shift, cosine, sinc, slope, axis } = *node;
            let to_cosine = dot::<T, L>(shift, by_dual_x) + by_w;
            let to_axis = sub(scale_add::<T, L>(-by_dual_w, shift, by_p), cross::<T, L>(shift, by_dual_x));
            let sinc = weight * sinc;
            let along = (weight * slope).mul_add::<L>(dot::<T, L>(turn, to_axis), -(sinc * to_cosine));
            let by_shift = cross_add::<T, L>(axis, by_dual_x, scale(-by_dual_w, axis));
            let by_shift = scale(weight, scale_add::<T, L>(cosine, by_dual_x, by_shift));
            for i in 0..3 {
                jacobian[6 * k + i] = sinc.mul_add::<L>(to_axis[i], along * turn[i]);
                jacobian[6 * k + 3 + i] = by_shift[i];
            }
        }
        Row { value, jacobian }
    }

    fn generated_numbers() -> usize {
        number_count::<PointToPlane>()
    }

    #[inline(always)]
    fn generated<S: Real, V: Lane<S>, L: Level>(numbers: &[S], stride: usize) -> Self::GeneratedAnswer<V> {
        residual::<S, PointToPlane<S>, V, L>(numbers, stride)
    }

    fn element(numbers: &[f64]) -> Self::Element {
        <PointToPlane as PackedResidual<f64>>::load::<f64>(numbers, 1)
    }

    #[inline]
    fn generated_plain(element: &Self::Element, unknowns: &[f64]) -> Self::GeneratedAnswer<f64> {
        element.jacobian(unknowns.try_into().expect("24 unknowns"))
    }

    #[inline]
    fn generated_plain_into(element: &Self::Element, unknowns: &[f64], result: &mut Self::GeneratedAnswer<f64>) {
        element.jacobian_into(unknowns.try_into().expect("24 unknowns"), result);
    }

    fn dual(x: &[f64]) -> Row<f64, 24> {
        let unknowns = SVector::<f64, 24>::from_column_slice(&x[13..]);
        let (value, gradient) = gradient(|ξ| textbook(&x[..13], |i| ξ[i]), &unknowns);
        Row { value, jacobian: gradient.into() }
    }

    /// No rotations, a regular point: with the normalised weights c and T = Σ c t, r = n·(v + T − u),
    /// ∂r/∂θₖ = cₖ n × (tₖ + T − 2 u) and ∂r/∂tₖ = cₖ n.
    fn coincident(sample: &Sample) -> Coincident {
        let vector = |numbers: &[f64], i: usize| [numbers[i], numbers[i + 1], numbers[i + 2]];
        let x = &sample.textbook;
        let (v, n, u) = (vector(x, 4), vector(x, 7), vector(x, 10));
        let total: f64 = x[..4].iter().sum();
        let mut unknowns = sample.unknowns.clone();
        let mut shift = [0.0; 3];
        for k in 0..4 {
            unknowns[6 * k..6 * k + 3].fill(0.0);
            shift = add(shift, scale(x[k] / total, vector(&unknowns, 6 * k + 3)));
        }
        let mut expected = vec![dot::<f64, Baseline>(n, sub(add(v, shift), u))];
        for k in 0..4 {
            let (weight, t) = (x[k] / total, vector(&unknowns, 6 * k + 3));
            expected.extend(scale(weight, cross::<f64, Baseline>(n, sub(add(t, shift), add(u, u)))));
            expected.extend(scale(weight, n));
        }
        Coincident { sample: sample.with_unknowns(&unknowns), expected }
    }

    fn assembled(_samples: &[Sample]) -> Option<Assembled> {
        None
    }
}

/// Product of two quaternions.
fn product<D: Dual>(a: &[D; 4], b: &[D; 4]) -> [D; 4] {
    let (p, q) = ([a[1], a[2], a[3]], [b[1], b[2], b[3]]);
    let across = dual_cross(&p, &q);
    let entry = |i: usize| a[0] * q[i] + b[0] * p[i] + across[i];
    [a[0] * b[0] - dual_dot(&p, &q), entry(0), entry(1), entry(2)]
}

fn textbook<D: Dual>(x: &[f64], unknown: impl Fn(usize) -> D) -> D {
    let zero = D::from(0.0);
    let (mut real, mut dual) = ([zero; 4], [zero; 4]);
    for k in 0..4 {
        let entry = |i: usize| unknown(6 * k + i);
        let turn = [entry(0), entry(1), entry(2)];
        let angle = dual_dot(&turn, &turn).sqrt();
        let sinc = angle.sin() / angle;
        let rotation = [angle.cos(), turn[0] * sinc, turn[1] * sinc, turn[2] * sinc];
        let motion = product(&[zero, entry(3), entry(4), entry(5)], &rotation);
        for i in 0..4 {
            real[i] += rotation[i] * x[k];
            dual[i] += motion[i] * (0.5 * x[k]);
        }
    }
    let per_length = real.iter().map(|&a| a * a).fold(zero, |sum, square| sum + square).sqrt().recip();
    let (real, dual) = (real.map(|a| a * per_length), dual.map(|a| a * per_length));
    let conjugate = [real[0], -real[1], -real[2], -real[3]];
    let shift = product(&dual, &conjugate);
    let p = [real[1], real[2], real[3]];
    let rotated = |v: &[f64]| -> [D; 3] {
        let v = [D::from(v[0]), D::from(v[1]), D::from(v[2])];
        let first = dual_cross(&p, &v);
        let second = dual_cross(&p, &first);
        std::array::from_fn(|i| v[i] + (real[0] * first[i] + second[i]) * 2.0)
    };
    let (point, normal) = (rotated(&x[4..7]), rotated(&x[7..10]));
    let off: [D; 3] = std::array::from_fn(|i| point[i] + shift[i + 1] * 2.0 - x[10 + i]);
    dual_dot(&normal, &off)
}
