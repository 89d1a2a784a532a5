use energy_dsl::energy;

energy! {
    /// Strain limiting along warp and weft: A k/3 (o_u³ + o_v³), where o = max(‖F u‖ − s, 0) is the stretch of a thread
    /// beyond its limit s > 1. The energy is 0 below the limit and twice differentiable at it.
    #[audit]
    #[invariant(translation, rotation)]
    pub energy ThreadLimit(x0, x1, x2: Point; rest u0, u1, u2: Vec2; k: Scalar[N/m], s: Scalar[1]) {
        rest {
            let D_m = columns(u1 - u0, u2 - u0);
            let B = adjugate(D_m);
            let d = det(D_m);
            let per_d = 1 / d;
        }
        let F = columns(x1 - x0, x2 - x0) * B;
        let o_u = per_d * max(norm(F * vector(1, 0)) - s * d, 0);
        let o_v = per_d * max(norm(F * vector(0, 1)) - s * d, 0);
        d * k / 6 * (o_u^3 + o_v^3)
    }
}
