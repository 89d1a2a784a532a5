use energy_dsl::{Baseline, Block, Declaration, Element, Hessian, Lane, Level, Potential, Real, Vector3};
use energy_elements::HairBend;

use crate::assembled::{Assembled, assembled};
use crate::dual;
use crate::near_rest::STRAIN;
use crate::random::Random;
use crate::sample::Coincident;
use crate::sample::{Derivatives, Sample, number_count, points, potential};
use crate::subject::Subject;
use crate::uncompensated::{Uncompensated, UncompensatedHairBend, uncompensated};
use crate::vector::{add, block, dot, negative, negative_block, scale, scale_add, sub, symmetric};

/// K2: bending k/2 (1 − â·b̂) of a hair at the middle of three points.
#[derive(Clone, Copy, Debug)]
pub struct HairBendKernel;

/// Returns an element in the form that each contender reads.
fn element_on(stiffness: f64, unknowns: &[f64]) -> Sample {
    let all = [&[stiffness], unknowns].concat();
    Sample::new(&HairBend { k: stiffness }, unknowns, all.clone(), all)
}

impl Subject for HairBendKernel {
    const KEY: &'static str = "K2";
    const TITLE: &'static str = "hair bend";
    const DECLARATION: &'static Declaration = <HairBend as Element>::DECLARATION;
    const ROUTINE: &'static str = "hessian";
    type Element = HairBend;
    /// k, p0, p1, p2.
    type Hand<T: Copy> = [T; 10];
    type HandAnswer<T: Real> = Derivatives<T, 3, 6>;
    type GeneratedAnswer<T: Real> = Hessian<T, [Vector3<T>; 3], [Block<T>; 6]>;

    fn sample(random: &mut Random) -> Sample {
        let stiffness = random.between(0.5, 2.0);
        let (p0, [x, y, _]) = (random.vector(1.0), random.frame());
        let (angle, first, second) = (random.between(0.2, 2.0), random.between(0.5, 1.5), random.between(0.5, 1.5));
        let (sine, cosine) = angle.sin_cos();
        let p1: [f64; 3] = std::array::from_fn(|i| p0[i] + first * x[i]);
        let p2: [f64; 3] = std::array::from_fn(|i| p1[i] + second * (cosine * x[i] + sine * y[i]));
        element_on(stiffness, &[p0, p1, p2].concat())
    }

    /// The value is C (c − 1) with C = −k/2 and c = s a·b, the cosine, where s = 1/(‖a‖ ‖b‖).
    ///
    /// ```text
    /// c_a  = s b − c a/‖a‖²
    /// c_ab = s − a/‖a‖² c_bᵀ − s b bᵀ/‖b‖²
    /// c_aa = −(a wᵀ + w aᵀ)/‖a‖² − c/‖a‖²    with w = s b − 3/2 c a/‖a‖²
    /// ```
    #[inline(always)]
    fn hand<T: Real, L: Level>(&[k, x0, x1, x2, y0, y1, y2, z0, z1, z2]: &[T; 10]) -> Derivatives<T, 3, 6> {
        let (a, b) = (sub([y0, y1, y2], [x0, x1, x2]), sub([z0, z1, z2], [y0, y1, y2]));
        let (aa, bb) = (dot::<T, L>(a, a), dot::<T, L>(b, b));
        // One division and one square root serve all terms: 1/‖a‖² = ‖b‖² s².
        let s = T::from_f64(1.0) / (aa * bb).sqrt();
        let (per_aa, per_bb) = (bb * s * s, aa * s * s);
        let cosine = dot::<T, L>(a, b) * s;
        let c = T::from_f64(-0.5) * k;
        let value = c * (cosine - T::from_f64(1.0));
        let (cs, c_cosine) = (c * s, c * cosine);
        let (on_a, on_b) = (c_cosine * per_aa, c_cosine * per_bb);
        let (of_a, of_b) = (scale(cs, a), scale(cs, b));
        let grad_a = scale_add::<T, L>(-on_a, a, of_b);
        let grad_b = scale_add::<T, L>(-on_b, b, of_a);
        let half = T::from_f64(0.5);
        let to_a = scale(-per_aa, scale_add::<T, L>(-(half * on_a), a, grad_a));
        let to_b = scale(-per_bb, scale_add::<T, L>(-(half * on_b), b, grad_b));
        let mut h_aa: Block<T> = symmetric!(|i, j| a[i].mul_add::<L>(to_a[j], to_a[i] * a[j]));
        let mut h_bb: Block<T> = symmetric!(|i, j| b[i].mul_add::<L>(to_b[j], to_b[i] * b[j]));
        let (left, right) = (scale(-per_aa, a), scale(-per_bb, of_b));
        let mut h_ab: Block<T> = block!(|i, j| left[i].mul_add::<L>(grad_b[j], b[i] * right[j]));
        for i in 0..3 {
            h_aa[i][i] = h_aa[i][i] - on_a;
            h_bb[i][i] = h_bb[i][i] - on_b;
            h_ab[i][i] = h_ab[i][i] + cs;
        }
        let h01: Block<T> = block!(|i, j| h_ab[i][j] - h_aa[i][j]);
        let h12: Block<T> = block!(|i, j| h_ab[i][j] - h_bb[i][j]);
        let h11: Block<T> = symmetric!(|i, j| -(h01[i][j] + h12[j][i]));
        Derivatives {
            value,
            gradient: [negative(grad_a), sub(grad_a, grad_b), grad_b],
            hessian: [h_aa, h01, negative_block(&h_ab), h11, h12, h_bb],
        }
    }

    fn generated_numbers() -> usize {
        number_count::<HairBend>()
    }

    #[inline(always)]
    fn generated<S: Real, V: Lane<S>, L: Level>(numbers: &[S], stride: usize) -> Self::GeneratedAnswer<V> {
        potential::<S, HairBend<S>, V, L>(numbers, stride)
    }

    fn element(numbers: &[f64]) -> Self::Element {
        HairBend { k: numbers[0] }
    }

    #[inline]
    fn generated_plain(element: &Self::Element, unknowns: &[f64]) -> Self::GeneratedAnswer<f64> {
        element.hessian(points(unknowns))
    }

    #[inline]
    fn generated_plain_into(element: &Self::Element, unknowns: &[f64], result: &mut Self::GeneratedAnswer<f64>) {
        element.hessian_into(points(unknowns), result);
    }

    fn dual(x: &[f64]) -> Derivatives<f64, 3, 6> {
        dual::derivatives::<9, 3, 6>(&x[1..], |[p0, p1, p2]| {
            let (a, b) = (dual::sub(p1, p0), dual::sub(p2, p1));
            let cosine = dual::dot(&a, &b) / (dual::norm(&a) * dual::norm(&b));
            (-cosine + 1.0) * (0.5 * x[0])
        })
    }

    fn uncompensated(samples: &[Sample]) -> Option<Uncompensated> {
        Some(uncompensated::<UncompensatedHairBend, 3>(samples))
    }

    fn near_rest(sample: &Sample) -> Option<Sample> {
        let [p0, p1, p2]: &[_; 3] = points(&sample.unknowns);
        let (a, b) = (sub(*p1, *p0), sub(*p2, *p1));
        let straight = add(*p1, scale_add::<f64, Baseline>(STRAIN, b, a));
        Some(element_on(sample.textbook[0], &[*p0, *p1, straight].concat()))
    }

    /// The first segment vanishes: value, gradient and Hessian are 0.
    fn coincident(sample: &Sample) -> Coincident {
        let [_, p1, p2]: &[_; 3] = points(&sample.unknowns);
        Coincident::singular(sample.with_unknowns(&[*p1, *p1, *p2].concat()), 0.0)
    }

    fn assembled(samples: &[Sample]) -> Option<Assembled> {
        Some(assembled::<HairBend, 3>(samples))
    }
}
