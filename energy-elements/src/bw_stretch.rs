use energy_dsl::energy;

energy! {
    /// Stretch of a triangle along warp and weft, k/2 A² ((‖w_u‖ − b_u)² + (‖w_v‖ − b_v)²) with [w_u w_v] = D D_m⁻¹
    /// (Baraff & Witkin 1998, whose condition carries the area A).
    ///
    /// The division by det D_m = 2A cancels against A², so the code has no division.
    #[audit]
    #[invariant(translation, rotation)]
    pub energy BaraffWitkinStretch(x0, x1, x2: Point; rest u0, u1, u2: Vec2; k: Scalar, b_u, b_v: Scalar) {
        rest {
            let D_m = columns(u1 - u0, u2 - u0);
            let B = adjugate(D_m);
            let warp = b_u * det(D_m);
            let weft = b_v * det(D_m);
        }
        // det D_m times [w_u w_v].
        let F = columns(x1 - x0, x2 - x0) * B;
        k / 8 * ((norm(F * vector(1, 0)) - warp)^2 + (norm(F * vector(0, 1)) - weft)^2)
    }
}
