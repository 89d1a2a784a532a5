use energy_dsl::energy;

energy! {
    /// Orthotropic St. Venant–Kirchhoff membrane on a triangle: A (½ C_u E_uu² + ½ C_v E_vv² + ½ C_uv (E_uu + E_vv)² +
    /// 2 C_ss E_uv²). E = (FᵀF − 1)/2 is the Green strain along warp (u) and weft (v), the axes of the rest
    /// coordinates.
    ///
    /// Stiffnesses are per length: moduli times thickness. The stiffness matrix of warp and weft has C_u + C_uv and C_v
    /// + C_uv on its diagonal and C_uv off it, so it is positive definite for all positive parameters. A polynomial,
    /// regular everywhere.
    #[audit]
    #[invariant(translation, rotation)]
    #[rest_state(zero_force)]
    pub energy OrthotropicStVK(x0, x1, x2: Point; rest u0, u1, u2: Vec2; C_u, C_v, C_uv, C_ss: Scalar[N/m]) {
        rest {
            let D_m = columns(u1 - u0, u2 - u0);
            let B = scaled_adjugate(D_m);
            let d = scaled_det(D_m)^2;
            let per_d = 1 / (2 * d);
            let A = det(D_m) / 2;
        }
        // F = D D_m⁻¹ times the scaled det D_m. Dividing last gives an exact zero at rest if edges are exact.
        let F = columns(x1 - x0, x2 - x0) * B;
        let C = transpose(F) * F - d * identity(2);
        let c_u = C * vector(1, 0);
        let c_v = C * vector(0, 1);
        let E_uu = per_d * c_u.x;
        let E_uv = per_d * c_u.y;
        let E_vv = per_d * c_v.y;
        A * (C_u / 2 * E_uu^2 + C_v / 2 * E_vv^2 + C_uv / 2 * (E_uu + E_vv)^2 + 2 * C_ss * E_uv^2)
    }
}
