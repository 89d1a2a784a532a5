use energy_dsl::energy;

energy! {
    /// Membrane of two families of yarns on a triangle: A (f(ε_u) + f(ε_v) + K ε_u ε_v + g(s)).
    ///
    /// With the deformed unit vectors w_u and w_v along warp and weft, ε = ‖w‖ − 1 is the engineering strain of a
    /// yarn. The tension f′ is per *original* width. Textile testers print both of these. With one k, a, b, m, c and w
    /// for each direction,
    ///
    /// f′(ε) = k ε + a ε³ + b ε⁵ for 0 ≤ ε ≤ m, and continues with its slope at m beyond,
    /// f″(ε) = k + (k − c) ε/w for −w ≤ ε ≤ 0, and c below −w.
    ///
    /// So yarns that are pushed together buckle: their stiffness falls from k to c over the strain w. K couples the
    /// directions; a sheet whose sides can move contracts by K/f″ of its strain.
    ///
    /// s = w_u·w_v is the sine of the angle of shear γ where yarns keep their lengths, and (1 + ε_u)(1 + ε_v) sin γ in
    /// general. Unlike sin γ, it is regular for collapsed triangles. The shear force is g′(s) = k_s s + a_s s³ + b_s s⁵
    /// up to |s| = m_s, and continues with its slope there.
    ///
    /// All derivatives up to the second are continuous. The energy is convex in (ε_u, ε_v, s) if all parameters are
    /// positive, c ≤ k, and K² ≤ min(k_u, c_u) min(k_v, c_v). A yarn of length 0 has no direction; this is flagged.
    ///
    /// The form follows the curves of the KES-F testers (Kawabata 1980, *The Standardization and Analysis of Hand
    /// Evaluation*), which start with a slope k and stiffen up to a largest load.
    #[audit(domain(K = 0..0.5))]
    #[invariant(translation, rotation)]
    #[rest_state(zero_force)]
    pub energy YarnMembrane(
        x0, x1, x2: Point; rest u0, u1, u2: Vec2;
        k_u, a_u, b_u: Scalar[N/m], m_u: Scalar[1], c_u: Scalar[N/m], w_u: Scalar[1],
        k_v, a_v, b_v: Scalar[N/m], m_v: Scalar[1], c_v: Scalar[N/m], w_v: Scalar[1],
        K, k_s, a_s, b_s: Scalar[N/m], m_s: Scalar[1]
    ) {
        rest {
            let D_m = columns(u1 - u0, u2 - u0);
            let B = scaled_adjugate(D_m);
            let l = scaled_det(D_m);
            let per_l = 1 / l;
            let A = det(D_m) / 2;
        }
        fn polynomial(e, k, a, b) { e^2 * (k / 2 + e^2 * (a / 4 + e^2 * b / 6)) }
        fn beyond(e, k, a, b, m) {
            let t = e - m;
            let tension = m * (k + m^2 * (a + m^2 * b));
            let slope = k + m^2 * (3 * a + 5 * m^2 * b);
            polynomial(m, k, a, b) + t * (tension + slope / 2 * t)
        }
        fn buckled(e, k, c, w) {
            let t = e + w;
            w^2 * (2 * k + c) / 6 - t * ((k + c) / 2 * w - c / 2 * t)
        }
        // Both sides of e = 0 have the same derivatives up to the second: rest is no kink.
        fn yarn(e, k, a, b, m, c, w) {
            let n = min(e, 0);
            let p = max(e, 0);
            let near = k / 2 * e^2 + (k - c) / (6 * w) * n^3 + p^4 * (a / 4 + p^2 * b / 6);
            if e < m { if e > -w { near } else { buckled(e, k, c, w) } } else { beyond(e, k, a, b, m) }
        }
        // F = D D_m⁻¹ times the scaled det D_m. Dividing last gives an exact zero at rest if edges are exact.
        let F = columns(x1 - x0, x2 - x0) * B;
        let p = F * vector(1, 0);
        let q = F * vector(0, 1);
        let e_u = (norm(p) - l) * per_l;
        let e_v = (norm(q) - l) * per_l;
        let s = dot(p, q) * per_l^2;
        let r = abs(s);
        let shear = if r < m_s { polynomial(s, k_s, a_s, b_s) } else { beyond(r, k_s, a_s, b_s, m_s) };
        A * (yarn(e_u, k_u, a_u, b_u, m_u, c_u, w_u) + yarn(e_v, k_v, a_v, b_v, m_v, c_v, w_v) + K * e_u * e_v + shear)
    }
}
