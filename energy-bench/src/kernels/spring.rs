use energy_dsl::{Baseline, Block, Declaration, Element, Hessian, Lane, Level, Potential, Real, Vector3};
use energy_elements::HookeSpring;

use crate::assembled::{Assembled, assembled};
use crate::dual;
use crate::near_rest::STRAIN;
use crate::random::Random;
use crate::sample::Coincident;
use crate::sample::{Derivatives, Sample, number_count, points, potential};
use crate::subject::Subject;
use crate::uncompensated::{Uncompensated, UncompensatedSpring, uncompensated};
use crate::vector::{dot, negative, negative_block, scale, sub, symmetric};

/// K1: a spring ½ k (‖d‖ − L)² between two points.
#[derive(Clone, Copy, Debug)]
pub struct SpringKernel;

/// Returns an element in the form that each contender reads.
fn element_on([stiffness, rest]: [f64; 2], unknowns: &[f64]) -> Sample {
    let all = [&[stiffness, rest], unknowns].concat();
    Sample::new(&HookeSpring { K: stiffness, L: rest }, unknowns, all.clone(), all)
}

impl Subject for SpringKernel {
    const KEY: &'static str = "K1";
    const TITLE: &'static str = "spring";
    const DECLARATION: &'static Declaration = <HookeSpring as Element>::DECLARATION;
    const ROUTINE: &'static str = "hessian";
    type Element = HookeSpring;
    /// k, L, p, q.
    type Hand<T: Copy> = [T; 8];
    type HandAnswer<T: Real> = Derivatives<T, 2, 3>;
    type GeneratedAnswer<T: Real> = Hessian<T, [Vector3<T>; 2], [Block<T>; 3]>;

    fn sample(random: &mut Random) -> Sample {
        let (stiffness, rest) = (random.between(0.5, 2.0), random.between(0.5, 1.5));
        let (p, direction) = (random.vector(1.0), random.direction());
        let stretched = rest * random.between(0.7, 1.4);
        let q: [f64; 3] = std::array::from_fn(|axis| p[axis] + stretched * direction[axis]);
        element_on([stiffness, rest], &[p, q].concat())
    }

    #[inline(always)]
    fn hand<T: Real, L: Level>(&[k, rest, p0, p1, p2, q0, q1, q2]: &[T; 8]) -> Derivatives<T, 2, 3> {
        let d = sub([q0, q1, q2], [p0, p1, p2]);
        let length = dot::<T, L>(d, d).sqrt();
        let inverse = T::from_f64(1.0) / length;
        let elongation = length - rest;
        let tension = k * elongation;
        let value = T::from_f64(0.5) * tension * elongation;
        // U' = c d, U'' = c + (k − c) d̂ d̂ᵀ.
        let c = tension * inverse;
        let force = scale(c, d);
        let along = scale((k - c) * (inverse * inverse), d);
        let mut hessian: Block<T> = symmetric!(|i, j| along[i] * d[j]);
        for i in 0..3 {
            hessian[i][i] = along[i].mul_add::<L>(d[i], c);
        }
        Derivatives { value, gradient: [negative(force), force], hessian: [hessian, negative_block(&hessian), hessian] }
    }

    fn generated_numbers() -> usize {
        number_count::<HookeSpring>()
    }

    #[inline(always)]
    fn generated<S: Real, V: Lane<S>, L: Level>(numbers: &[S], stride: usize) -> Self::GeneratedAnswer<V> {
        potential::<S, HookeSpring<S>, V, L>(numbers, stride)
    }

    fn element(numbers: &[f64]) -> Self::Element {
        HookeSpring { K: numbers[0], L: numbers[1] }
    }

    #[inline]
    fn generated_plain(element: &Self::Element, unknowns: &[f64]) -> Self::GeneratedAnswer<f64> {
        element.hessian(points(unknowns))
    }

    #[inline]
    fn generated_plain_into(element: &Self::Element, unknowns: &[f64], result: &mut Self::GeneratedAnswer<f64>) {
        element.hessian_into(points(unknowns), result);
    }

    fn dual(x: &[f64]) -> Derivatives<f64, 2, 3> {
        dual::derivatives::<6, 2, 3>(&x[2..], |[p, q]| {
            let elongation = dual::norm(&dual::sub(q, p)) - x[1];
            elongation * elongation * (0.5 * x[0])
        })
    }

    fn uncompensated(samples: &[Sample]) -> Option<Uncompensated> {
        Some(uncompensated::<UncompensatedSpring, 2>(samples))
    }

    fn near_rest(sample: &Sample) -> Option<Sample> {
        let [p, q]: &[_; 2] = points(&sample.unknowns);
        let d = sub(*q, *p);
        let (stiffness, rest) = (sample.textbook[0], dot::<f64, Baseline>(d, d).sqrt() * (1.0 - STRAIN));
        Some(element_on([stiffness, rest], &sample.unknowns))
    }

    /// Both points meet: the value is k/2 L², gradient and Hessian are 0.
    fn coincident(sample: &Sample) -> Coincident {
        let (stiffness, rest, [p, _]) = (sample.textbook[0], sample.textbook[1], points(&sample.unknowns));
        Coincident::singular(sample.with_unknowns(&[*p, *p].concat()), 0.5 * stiffness * rest * rest)
    }

    fn assembled(samples: &[Sample]) -> Option<Assembled> {
        Some(assembled::<HookeSpring, 2>(samples))
    }
}
