use energy_macros::energy;

energy! {
    /// Shear of a triangle, k/2 A² (w_u·w_v)², [w_u w_v] = D D_m⁻¹ (Baraff & Witkin 1998: the condition carries the area A). A
    /// polynomial, regular everywhere.
    #[audit]
    #[invariant(translation, rotation)]
    #[rest_state(zero_force)]
    pub energy BaraffWitkinShear(x0, x1, x2: Point; rest u0, u1, u2: Vec2; k: Scalar) {
        rest {
            let D_m = columns(u1 - u0, u2 - u0);
            let B = adjugate(D_m);
            let per_d = 1 / det(D_m);
        }
        // det D_m times [w_u w_v]; A = det D_m/2.
        let F = columns(x1 - x0, x2 - x0) * B;
        k / 8 * (per_d * dot(F * vector(1, 0), F * vector(0, 1)))^2
    }
}
