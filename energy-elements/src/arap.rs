use energy_dsl::energy;

energy! {
    /// As-rigid-as-possible membrane on a triangle (Sorkine & Alexa 2007): A μ/2 ((s₁ − 1)² + (s₂ − 1)²) with the
    /// singular values s of F = D D_m⁻¹.
    ///
    /// With I = tr FᵀF and J = ‖w_u × w_v‖ it is computed as half the sum of (s₁ + s₂ − 2)² and (s₁ − s₂)², where s₁ +
    /// s₂ − 2 = (I + 2J − 4)/(√(I + 2J) + 2). Both squares keep their digits near rest. Where J = 0, the derivatives of
    /// J are taken as 0 and flagged.
    #[audit]
    #[invariant(translation, rotation)]
    #[rest_state(zero_force)]
    pub energy AsRigidAsPossible(x0, x1, x2: Point; rest u0, u1, u2: Vec2; μ: Scalar[N/m]) {
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
        // J − 1, and I − 2.
        let j = (area - d) * per_d;
        let i = ((uu - d2) + (vv - d2)) * per_d2;
        // (s₁ + s₂)², and (s₁² − s₂²)².
        let square = I + 2 * J;
        let anisotropy = ((uu - vv) * per_d2)^2 + (2 * dot(f_u, f_v) * per_d2)^2;
        let squares = ((i + 2 * j) / (sqrt(square) + 2))^2 + anisotropy / square;
        d * μ / 4 * computed_as(I - 2 * sqrt(square) + 2, squares / 2)
    }
}
