use energy_dsl::{Baseline, Block, Declaration, Element, Hessian, Lane, Level, Potential, Real, Vector3};
use energy_elements::QuadraticHinge;

use crate::assembled::{Assembled, assembled};
use crate::dual;
use crate::near_rest::STRAIN;
use crate::random::Random;
use crate::sample::Coincident;
use crate::sample::{Derivatives, Sample, number_count, points, potential};
use crate::subject::Subject;
use crate::uncompensated::{Uncompensated, UncompensatedHinge, uncompensated};
use crate::vector::{add, block, cross, dot, negative_block, scale, scale_add, sub, symmetric};

/// K3: a hinge k (θ − θ₀)² of two triangles that share an edge. The weight ‖e‖²/A is part of k.
#[derive(Clone, Copy, Debug)]
pub struct HingeKernel;

/// Returns an element in the form that each contender reads.
fn element_on([stiffness, rest]: [f64; 2], unknowns: &[f64]) -> Sample {
    let all = [&[stiffness, rest], unknowns].concat();
    Sample::new(&QuadraticHinge { k: stiffness, θ0: rest }, unknowns, all.clone(), all)
}

impl Subject for HingeKernel {
    const KEY: &'static str = "K3";
    const TITLE: &'static str = "hinge";
    const DECLARATION: &'static Declaration = <QuadraticHinge as Element>::DECLARATION;
    const ROUTINE: &'static str = "hessian";
    type Element = QuadraticHinge;
    /// k, θ₀, x1 to x4.
    type Hand<T: Copy> = [T; 14];
    type HandAnswer<T: Real> = Derivatives<T, 4, 10>;
    type GeneratedAnswer<T: Real> = Hessian<T, [Vector3<T>; 4], [Block<T>; 10]>;

    fn sample(random: &mut Random) -> Sample {
        let (stiffness, rest) = (random.between(0.5, 2.0), random.between(-1.0, 1.0));
        let (x3, [x, y, z]) = (random.vector(1.0), random.frame());
        let edge = random.between(0.7, 1.5);
        let angle = rest + random.between(0.1, 0.6);
        let mut apex = |turn: f64| -> [f64; 3] {
            let (along, height) = (edge * random.between(0.1, 0.9), random.between(0.5, 1.5));
            let (sine, cosine) = turn.sin_cos();
            std::array::from_fn(|i| x3[i] + along * x[i] + height * (cosine * y[i] + sine * z[i]))
        };
        let (x1, x2) = (apex(0.0), apex(std::f64::consts::PI + angle));
        let x4: [f64; 3] = std::array::from_fn(|i| x3[i] + edge * x[i]);
        element_on([stiffness, rest], &[x1, x2, x3, x4].concat())
    }

    /// The edge is e. The vectors a and b lead from its start to the apexes.
    ///
    /// ```text
    /// θ_a  = g₁ = −‖e‖ N₁/‖N₁‖²              with N₁ = e × a
    /// θ_b  = g₂ =  ‖e‖ N₂/‖N₂‖²              with N₂ = e × b
    /// θ_e  = −t₁ g₁ − t₂ g₂                  with t₁ = a·e/‖e‖², t₂ = b·e/‖e‖²
    /// θ_aa = −(g₁ h₁ᵀ + h₁ g₁ᵀ)/‖h₁‖²        with the height h₁ = a − t₁ e
    /// θ_ea = −g₁ eᵀ/‖e‖² − t₁ θ_aa
    /// ```
    ///
    /// In the plane normal to e, θ is a difference of polar angles: this gives θ_aa. The symmetry of Σ h gᵀ gives θ_ee.
    #[inline(always)]
    fn hand<T: Real, L: Level>(
        &[k, rest, a0, a1, a2, b0, b1, b2, o0, o1, o2, e0, e1, e2]: &[T; 14],
    ) -> Derivatives<T, 4, 10> {
        let origin = [o0, o1, o2];
        let (e, a, b) = (sub([e0, e1, e2], origin), sub([a0, a1, a2], origin), sub([b0, b1, b2], origin));
        let (n1, n2) = (cross::<T, L>(e, a), cross::<T, L>(e, b));
        let (ee, s1, s2) = (dot::<T, L>(e, e), dot::<T, L>(n1, n1), dot::<T, L>(n2, n2));
        let length = ee.sqrt();
        // One division serves 1/‖e‖, 1/‖N₁‖² and 1/‖N₂‖².
        let s12 = s1 * s2;
        let per_all = T::from_f64(1.0) / (length * s12);
        let per_length = per_all * s12;
        let length_per_all = length * per_all;
        let (per_s1, per_s2) = (length_per_all * s2, length_per_all * s1);
        let per_ee = per_length * per_length;
        let (t1, t2) = (dot::<T, L>(a, e) * per_ee, dot::<T, L>(b, e) * per_ee);
        let (h1, h2) = (scale_add::<T, L>(-t1, e, a), scale_add::<T, L>(-t2, e, b));
        let angle = (-(length * dot::<T, L>(b, n1))).atan2::<L>(-dot::<T, L>(n1, n2));

        let off = angle - rest;
        let moment = k * off;
        let slope = moment + moment;
        let (g1, g2) = (scale(-(length * per_s1), n1), scale(length * per_s2, n2));
        let (f1, f2) = (scale(slope, g1), scale(slope, g2));
        let f_e = scale_add::<T, L>(-t1, f1, scale(-t2, f2));

        // U_aa = 2 k g₁ g₁ᵀ + slope θ_aa = g₁ yᵀ + y g₁ᵀ.
        let y1 = scale_add::<T, L>(-(slope * ee * per_s1), h1, scale(k, g1));
        let y2 = scale_add::<T, L>(-(slope * ee * per_s2), h2, scale(k, g2));
        let h_aa: Block<T> = symmetric!(|i, j| g1[i].mul_add::<L>(y1[j], y1[i] * g1[j]));
        let h_bb: Block<T> = symmetric!(|i, j| g2[i].mul_add::<L>(y2[j], y2[i] * g2[j]));
        let stiff = scale(k + k, g1);
        let h_ab: Block<T> = block!(|i, j| stiff[i] * g2[j]);
        // −U_ae and −U_be. U_aa and U_ab already contain the terms of θ_e θ_aᵀ.
        let along = scale(per_ee, e);
        let m_ae: Block<T> = block!(|i, j| t1.mul_add::<L>(h_aa[i][j], t2.mul_add::<L>(h_ab[i][j], along[i] * f1[j])));
        let m_be: Block<T> = block!(|i, j| t2.mul_add::<L>(h_bb[i][j], t1.mul_add::<L>(h_ab[j][i], along[i] * f2[j])));
        let v1 = scale_add::<T, L>(t1, along, scale(-per_ee, h1));
        let v2 = scale_add::<T, L>(t2, along, scale(-per_ee, h2));
        let h_ee: Block<T> = symmetric!(|i, j| {
            let inner = v1[i].mul_add::<L>(f1[j], v2[i] * f2[j]);
            t1.mul_add::<L>(m_ae[j][i], t2.mul_add::<L>(m_be[j][i], inner))
        });

        let h_ao: Block<T> = block!(|i, j| m_ae[i][j] - (h_aa[i][j] + h_ab[i][j]));
        let h_bo: Block<T> = block!(|i, j| m_be[i][j] - (h_bb[i][j] + h_ab[j][i]));
        let h_oe: Block<T> = block!(|i, j| m_ae[i][j] + m_be[i][j] - h_ee[i][j]);
        let h_oo: Block<T> = symmetric!(|i, j| -(h_ao[i][j] + h_bo[i][j] + h_oe[j][i]));
        let f_ab = add(f1, f2);
        Derivatives {
            value: moment * off,
            gradient: [f1, f2, sub([T::from_f64(0.0); 3], add(f_ab, f_e)), f_e],
            hessian: [h_aa, h_ab, h_ao, negative_block(&m_ae), h_bb, h_bo, negative_block(&m_be), h_oo, h_oe, h_ee],
        }
    }

    fn generated_numbers() -> usize {
        number_count::<QuadraticHinge>()
    }

    #[inline(always)]
    fn generated<S: Real, V: Lane<S>, L: Level>(numbers: &[S], stride: usize) -> Self::GeneratedAnswer<V> {
        potential::<S, QuadraticHinge<S>, V, L>(numbers, stride)
    }

    fn element(numbers: &[f64]) -> Self::Element {
        QuadraticHinge { k: numbers[0], θ0: numbers[1] }
    }

    #[inline]
    fn generated_plain(element: &Self::Element, unknowns: &[f64]) -> Self::GeneratedAnswer<f64> {
        element.hessian(points(unknowns))
    }

    #[inline]
    fn generated_plain_into(element: &Self::Element, unknowns: &[f64], result: &mut Self::GeneratedAnswer<f64>) {
        element.hessian_into(points(unknowns), result);
    }

    fn dual(x: &[f64]) -> Derivatives<f64, 4, 10> {
        dual::derivatives::<12, 4, 10>(&x[2..], |[x1, x2, x3, x4]| {
            let (e, a, b) = (dual::sub(x4, x3), dual::sub(x1, x3), dual::sub(x2, x3));
            let (n1, n2) = (dual::cross(&e, &a), dual::cross(&b, &e));
            let sine = dual::dot(&dual::cross(&n1, &n2), &e);
            let cosine = dual::dot(&n1, &n2) * dual::norm(&e);
            let off = num_dual::DualNum::atan2(&sine, cosine) - x[1];
            off * off * x[0]
        })
    }

    fn uncompensated(samples: &[Sample]) -> Option<Uncompensated> {
        Some(uncompensated::<UncompensatedHinge, 4>(samples))
    }

    /// Moves the first apex so that the triangles are almost coplanar: θ is about [`STRAIN`].
    fn near_rest(sample: &Sample) -> Option<Sample> {
        let [x1, x2, x3, x4]: &[_; 4] = points(&sample.unknowns);
        let (e, a, b) = (sub(*x4, *x3), sub(*x1, *x3), sub(*x2, *x3));
        let product = |v, w| dot::<f64, Baseline>(v, w);
        let ee = product(e, e);
        let height = scale_add::<f64, Baseline>(-product(b, e) / ee, e, b);
        let up = scale(STRAIN / ee.sqrt(), cross::<f64, Baseline>(e, height));
        let flat = add(scale(product(a, e) / ee, e), sub(up, height));
        Some(element_on([sample.textbook[0], 0.0], &[add(*x3, flat), *x2, *x3, *x4].concat()))
    }

    /// The shared edge vanishes: θ and its derivatives are 0.
    fn coincident(sample: &Sample) -> Coincident {
        let (stiffness, rest, [x1, x2, x3, _]) = (sample.textbook[0], sample.textbook[1], points(&sample.unknowns));
        Coincident::singular(sample.with_unknowns(&[*x1, *x2, *x3, *x3].concat()), stiffness * rest * rest)
    }

    fn assembled(samples: &[Sample]) -> Option<Assembled> {
        Some(assembled::<QuadraticHinge, 4>(samples))
    }
}
