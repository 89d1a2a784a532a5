use energy_dsl::{Block, Declaration, Element, Hessian, Lane, Level, Potential, Real, Vector3};
use energy_elements::StVK;

use crate::assembled::{Assembled, assembled};
use crate::dual;
use crate::random::Random;
use crate::sample::Coincident;
use crate::sample::{Derivatives, Sample, number_count, points, potential};
use crate::subject::Subject;
use crate::vector::{add, block, dot, negative, scale, scale_add, sub, symmetric};

/// K4: a St. Venant–Kirchhoff membrane A (μ ‖E‖² + λ/2 tr² E) on a triangle.
#[derive(Clone, Copy, Debug)]
pub struct StVKKernel;

impl Subject for StVKKernel {
    const KEY: &'static str = "K4";
    const TITLE: &'static str = "StVK triangle";
    const DECLARATION: &'static Declaration = <StVK as Element>::DECLARATION;
    const ROUTINE: &'static str = "hessian";
    type Element = StVK;
    /// λ A, μ A, the metric D_m⁻¹ D_m⁻ᵀ (entries 11, 12, 22), x0 to x2. The textbook formula reads λ, μ, A, D_m⁻¹ by
    /// rows, x0 to x2.
    type Hand<T: Copy> = [T; 14];
    type HandAnswer<T: Real> = Derivatives<T, 3, 6>;
    type GeneratedAnswer<T: Real> = Hessian<T, [Vector3<T>; 3], [Block<T>; 6]>;

    fn sample(random: &mut Random) -> Sample {
        let (lambda, mu) = (random.between(0.5, 2.0), random.between(0.5, 2.0));
        let (u0, width) = ([random.between(-1.0, 1.0), random.between(-1.0, 1.0)], random.between(0.5, 1.5));
        let u1 = [u0[0] + width, u0[1] + random.between(-0.3, 0.3)];
        let u2 = [u0[0] + width * random.between(0.1, 0.9), u0[1] + random.between(0.6, 1.5)];
        let (x0, [x, y, z]) = (random.vector(1.0), random.frame());
        let mut moved = |u: [f64; 2]| -> [f64; 3] {
            let mut stretched = || random.between(0.8, 1.25);
            let (along, across) = ((u[0] - u0[0]) * stretched(), (u[1] - u0[1]) * stretched());
            let out = 0.2 * stretched();
            std::array::from_fn(|i| x0[i] + along * x[i] + across * y[i] + out * z[i])
        };
        let unknowns = [x0, moved(u1), moved(u2)].concat();

        let (d1, d2) = ([u1[0] - u0[0], u1[1] - u0[1]], [u2[0] - u0[0], u2[1] - u0[1]]);
        let det = d1[0] * d2[1] - d2[0] * d1[1];
        let area = det / 2.0;
        let inverse = [[d2[1] / det, -d2[0] / det], [-d1[1] / det, d1[0] / det]];
        let metric = |i: usize, j: usize| inverse[i][0] * inverse[j][0] + inverse[i][1] * inverse[j][1];
        let prepared = [lambda * area, mu * area, metric(0, 0), metric(0, 1), metric(1, 1)];
        let hand = [&prepared, unknowns.as_slice()].concat();
        let textbook = [&[lambda, mu, area], inverse.as_flattened(), &unknowns].concat();
        let element = StVK::new(u0, u1, u2, lambda, mu).expect("the rest shape is not degenerate");
        Sample::new(&element, &unknowns, hand, textbook)
    }

    /// The rest metric is G. The deformed edges are D = (d₁, d₂), and K = DᵀD.
    ///
    /// ```text
    /// tr E = tr Y/2,  ‖E‖² = tr Y²/4                  with Y = G K − 1
    /// U_D  = D M                                      with M = (μ Y + λ tr E) G
    /// U_ij = M_ij + G_ij Φ + μ q_j q_iᵀ + λ q_i q_jᵀ  with q = D G, Φ = μ D G Dᵀ
    /// ```
    #[inline(always)]
    fn hand<T: Real, L: Level>(
        &[lambda, mu, g11, g12, g22, x0, x1, x2, y0, y1, y2, z0, z1, z2]: &[T; 14],
    ) -> Derivatives<T, 3, 6> {
        let (one, half) = (T::from_f64(1.0), T::from_f64(0.5));
        let origin = [x0, x1, x2];
        let (d1, d2) = (sub([y0, y1, y2], origin), sub([z0, z1, z2], origin));
        let (k11, k12, k22) = (dot::<T, L>(d1, d1), dot::<T, L>(d1, d2), dot::<T, L>(d2, d2));
        let y11 = g11.mul_add::<L>(k11, g12.mul_add::<L>(k12, -one));
        let y12 = g11.mul_add::<L>(k12, g12 * k22);
        let y21 = g12.mul_add::<L>(k11, g22 * k12);
        let y22 = g12.mul_add::<L>(k12, g22.mul_add::<L>(k22, -one));
        let trace = half * (y11 + y22);
        let squares = y11.mul_add::<L>(y11, y22 * y22);
        let four_norm = y12.mul_add::<L>(y21 + y21, squares);
        let pressure = lambda * trace;
        let value = mu.mul_add::<L>(T::from_f64(0.25) * four_norm, half * pressure * trace);

        let (z11, z22) = (mu.mul_add::<L>(y11, pressure), mu.mul_add::<L>(y22, pressure));
        let (z12, z21) = (mu * y12, mu * y21);
        let m11 = z11.mul_add::<L>(g11, z12 * g12);
        let m12 = z11.mul_add::<L>(g12, z12 * g22);
        let m22 = z21.mul_add::<L>(g12, z22 * g22);
        let f1 = scale_add::<T, L>(m11, d1, scale(m12, d2));
        let f2 = scale_add::<T, L>(m12, d1, scale(m22, d2));

        let q1 = scale_add::<T, L>(g11, d1, scale(g12, d2));
        let q2 = scale_add::<T, L>(g12, d1, scale(g22, d2));
        let (mu_q1, mu_q2) = (scale(mu, q1), scale(mu, q2));
        let phi: Block<T> = symmetric!(|i, j| d1[i].mul_add::<L>(mu_q1[j], d2[i] * mu_q2[j]));
        let lambda_q1 = scale(lambda, q1);
        let (both_q1, both_q2) = (add(lambda_q1, mu_q1), scale_add::<T, L>(lambda, q2, mu_q2));
        let mut h11: Block<T> = symmetric!(|i, j| g11.mul_add::<L>(phi[i][j], both_q1[i] * q1[j]));
        let mut h22: Block<T> = symmetric!(|i, j| g22.mul_add::<L>(phi[i][j], both_q2[i] * q2[j]));
        let mut h12: Block<T> = block!(|i, j| {
            let products = mu_q2[i].mul_add::<L>(q1[j], lambda_q1[i] * q2[j]);
            g12.mul_add::<L>(phi[i][j], products)
        });
        for i in 0..3 {
            h11[i][i] = h11[i][i] + m11;
            h22[i][i] = h22[i][i] + m22;
            h12[i][i] = h12[i][i] + m12;
        }
        let h01: Block<T> = block!(|i, j| -(h11[i][j] + h12[j][i]));
        let h02: Block<T> = block!(|i, j| -(h12[i][j] + h22[i][j]));
        let h00: Block<T> = symmetric!(|i, j| -(h01[i][j] + h02[i][j]));
        Derivatives { value, gradient: [negative(add(f1, f2)), f1, f2], hessian: [h00, h01, h02, h11, h12, h22] }
    }

    fn generated_numbers() -> usize {
        number_count::<StVK>()
    }

    #[inline(always)]
    fn generated<S: Real, V: Lane<S>, L: Level>(numbers: &[S], stride: usize) -> Self::GeneratedAnswer<V> {
        potential::<S, StVK<S>, V, L>(numbers, stride)
    }

    fn element(numbers: &[f64]) -> Self::Element {
        <StVK as energy_dsl::PackedPotential<f64>>::load::<f64>(numbers, 1)
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
        let (lambda, mu, area, b) = (x[0], x[1], x[2], &x[3..7]);
        dual::derivatives::<9, 3, 6>(&x[7..], |[x0, x1, x2]| {
            let (d1, d2) = (dual::sub(x1, x0), dual::sub(x2, x0));
            let f1: [_; 3] = std::array::from_fn(|i| d1[i] * b[0] + d2[i] * b[2]);
            let f2: [_; 3] = std::array::from_fn(|i| d1[i] * b[1] + d2[i] * b[3]);
            let e11 = (dual::dot(&f1, &f1) - 1.0) * 0.5;
            let e12 = dual::dot(&f1, &f2) * 0.5;
            let e22 = (dual::dot(&f2, &f2) - 1.0) * 0.5;
            let trace = e11 + e22;
            let norm = e11 * e11 + e12 * e12 * 2.0 + e22 * e22;
            (norm * mu + trace * trace * (0.5 * lambda)) * area
        })
    }

    /// All points meet. The potential is regular there: E = −1/2, so U = A (μ + λ)/2, ∂U/∂x = 0 and ∂²U/∂xᵢ∂xⱼ = −A (μ
    /// + λ) Gᵢⱼ.
    fn coincident(sample: &Sample) -> Coincident {
        let (lambda, mu) = (sample.hand[0], sample.hand[1]);
        let (g11, g12, g22) = (sample.hand[2], sample.hand[3], sample.hand[4]);
        let [x0, _, _]: &[_; 3] = points(&sample.unknowns);
        // The gradients of the barycentric coordinates add up to 0.
        let metric = [g11 + 2.0 * g12 + g22, -(g11 + g12), -(g12 + g22), g11, g12, g22];
        let mut hessian = [[[0.0; 3]; 3]; 6];
        for (block, g) in hessian.iter_mut().zip(metric) {
            for i in 0..3 {
                block[i][i] = -(lambda + mu) * g;
            }
        }
        let expected = [&[0.5 * (lambda + mu)], [0.0; 9].as_slice(), hessian.as_flattened().as_flattened()].concat();
        Coincident { sample: sample.with_unknowns(&[*x0; 3].concat()), expected }
    }

    fn assembled(samples: &[Sample]) -> Option<Assembled> {
        Some(assembled::<StVK, 3>(samples))
    }
}
