use energy_macros::energy;

energy! {
    /// St. Venant–Kirchhoff membrane on a triangle: A (μ ‖E‖² + λ/2 tr² E), E = (FᵀF − 1)/2 the Green strain. λ and μ are per length: for
    /// Young's modulus Y, Poisson's ratio ν and thickness h in plane stress, λ = Y h ν/(1 − ν²), μ = Y h/(2 (1 + ν)). The rest shape
    /// is given by material coordinates in its plane, of positive area; a polynomial, regular everywhere.
    #[audit]
    #[invariant(translation, rotation)]
    #[rest_state(zero_force)]
    pub energy StVK(x0, x1, x2: Point; rest u0, u1, u2: Vec2; λ, μ: Scalar[N/m]) {
        rest {
            let D_m = columns(u1 - u0, u2 - u0);
            // Scaled, so that triangles of any size are computed near 1.
            let s = power_of_two(det(D_m));
            let B = adjugate(D_m) * s;
            let d = (det(D_m) * s)^2;
            let per_d = 1 / (2 * d);
            let A = det(D_m) / 2;
        }
        // F = D D_m⁻¹, its division by s det D_m left to the end: edges that are exact give an exact zero at rest.
        let F = columns(x1 - x0, x2 - x0) * B;
        let E = per_d * (transpose(F) * F - d * identity(2));
        A * (μ * ddot(E, E) + λ / 2 * trace(E)^2)
    }
}
