use energy_dsl::energy;

energy! {
    /// Stable neo-Hookean membrane on a triangle without a logarithm: A (μ/2 (I − 2) − μ (J − 1) + λ/2 (J − 1)²) with I
    /// = tr FᵀF and J = ‖w_u × w_v‖ (after Smith et al. 2018).
    ///
    /// I − 2J = (s₁ − s₂)² comes from the anisotropy of FᵀF, which keeps its digits near rest. Where J = 0, the
    /// derivatives of J are taken as 0 and flagged.
    #[audit]
    #[invariant(translation, rotation)]
    #[rest_state(zero_force)]
    pub energy StableNeoHookean(x0, x1, x2: Point; rest u0, u1, u2: Vec2; λ, μ: Scalar[N/m]) {
        rest {
            let D_m = columns(u1 - u0, u2 - u0);
            let d = det(D_m);
            let B = scaled_adjugate(D_m);
            let d2 = scaled_det(D_m)^2;
            let per_d = 1 / d;
            let per_d2 = 1 / d2;
        }
        let a = x1 - x0;
        let b = x2 - x0;
        let F = columns(a, b) * B;
        let f_u = F * vector(1, 0);
        let f_v = F * vector(0, 1);
        let uu = norm_squared(f_u);
        let vv = norm_squared(f_v);
        let I = (uu + vv) * per_d2;
        let area = norm(cross(a, b));
        let J = area * per_d;
        // J − 1, and I − 2J from (s₁² − s₂²)² and (s₁ + s₂)² = I + 2J.
        let j = valued_as(J - 1, (area - d) * per_d);
        let anisotropy = ((uu - vv) * per_d2)^2 + (2 * dot(f_u, f_v) * per_d2)^2;
        let shape = computed_as(I - 2 * J, anisotropy / (I + 2 * J));
        d / 4 * (μ * shape + λ * j^2)
    }
}
