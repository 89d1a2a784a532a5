//! Potentials of weighted sums of points: their Hessians are computed in these sums, and expanded with the weights.

use energy_dsl::energy;

use crate::unknowns::check;

energy! {
    /// Two midpoints at a distance.
    energy Midpoints(a, b, c, d: Point; k, r: Scalar) {
        let e = (a + b) / 2 - (c + d) / 2;
        k * ((r^2 / norm_squared(e))^2 + norm_squared(e) / r^2 - 2)
    }

    /// A brick with one point of quadrature.
    energy MeanEdges(a, b, c, d, e, f, g, h: Point; μ, λ: Scalar) {
        let u = (b + c + f + g - a - d - e - h) / 4;
        let v = (c + d + g + h - a - b - e - f) / 4;
        let w = (e + f + g + h - a - b - c - d) / 4;
        let J = det(columns(u, v, w));
        μ * (norm_squared(u) + norm_squared(v) + norm_squared(w)) / J^2 + λ * (J - 1)^2
    }

    /// A gap between the centres of two triangles.
    energy Gap(a0, a1, a2, b0, b1, b2: Point; k, δ: Scalar) {
        let g = (a0 + a1 + a2 - b0 - b1 - b2) / 3;
        let n = cross((a1 + b1 - a0 - b0) / 2, (a2 + b2 - a0 - b0) / 2);
        let r = sqrt((dot(g, unit(n))^2 + norm_squared(g)) / 2) / δ;
        k * (1 - (1 + r) * exp(-r)) * norm(n) / 2
    }

    /// A Gauss point between two edges.
    #[vertex]
    energy GaussPoint(a, b, c, d: Point; k: Scalar) {
        let g = 0.2113248654051871 * a + 0.7886751345948129 * c - (0.2113248654051871 * b + 0.7886751345948129 * d);
        k * norm(g)^3
    }

    /// The same with unknowns of another kind.
    energy Offset(a, b, c: Point, s: Scalar; k: Scalar) {
        let g = 0.3 * a + 0.7 * b - c;
        k * norm(g)^3 * exp(0.25 * s)
    }

    /// A length of a mean edge.
    constraint MeanLength(a, b, c, d: Point; L: Scalar) = norm(0.4 * a + 0.6 * b - 0.3 * c - 0.7 * d) - L;
}

/// Compiled code has the bits of the tape of the same text.
#[test]
fn compiled_expansions_have_the_bits_of_tapes() {
    check::<Midpoints<f64>>();
    check::<MeanEdges<f64>>();
    check::<Gap<f64>>();
    check::<GaussPoint<f64>>();
    check::<Offset<f64>>();
    check::<MeanLength<f64>>();
}
