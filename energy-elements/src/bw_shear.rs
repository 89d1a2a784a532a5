use energy_dsl::energy;

energy! {
    /// Shear of a triangle, k/2 A² (w_u·w_v)² with [w_u w_v] = D D_m⁻¹ (Baraff & Witkin 1998, whose condition carries
    /// the area A). A polynomial, regular everywhere.
    #[audit]
    #[invariant(translation, rotation)]
    #[rest_state(zero_force)]
    pub energy BaraffWitkinShear(x0, x1, x2: Point; rest u0, u1, u2: Vec2; k: Scalar) {
        rest {
            let D_m = columns(u1 - u0, u2 - u0);
            // Scaling by a power of two brings triangles of any size near 1.
            let d = det(D_m);
            let s = power_of_two(d);
            let B = adjugate(D_m) * s;
            // A²/2 for w that are too large by the factor s det D_m. If A⁻² overflows, this is not finite and the rest
            // shape is refused.
            let A2 = d^2 / (8 * (d * s)^4);
            let weight = A2 * (A2 * (1 / A2));
        }
        let F = columns(x1 - x0, x2 - x0) * B;
        k * weight * dot(F * vector(1, 0), F * vector(0, 1))^2
    }
}
