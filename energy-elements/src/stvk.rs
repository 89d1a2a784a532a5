use energy_dsl::energy;

energy! {
    /// St. Venant–Kirchhoff membrane on a triangle: A (μ ‖E‖² + λ/2 tr² E) with the Green strain E = (FᵀF − 1)/2.
    ///
    /// λ and μ are per length. For Young's modulus Y, Poisson's ratio ν and thickness h in plane stress, λ = Y h ν/(1 −
    /// ν²) and μ = Y h/(2 (1 + ν)). The rest shape is given by planar coordinates and must have a positive area. A
    /// polynomial, regular everywhere.
    #[audit]
    #[invariant(translation, rotation)]
    #[rest_state(zero_force)]
    pub energy StVK(x0, x1, x2: Point; rest u0, u1, u2: Vec2; λ, μ: Scalar[N/m]) {
        rest {
            let d1 = u1 - u0;
            let d2 = u2 - u0;
            let double_area = det(columns(d1, d2));
            let n = norm_squared(d1);
            // Scaling by a power of two brings triangles of any size near 1.
            let s = power_of_two(n);
            // p d2 − q d1 is perpendicular to d1; m is its squared length.
            let p = n * s;
            let q = dot(d1, d2) * s;
            let m = p * (double_area * s) * double_area;
            let half_n = n / 2;
            let half_m = m / 2;
            let per_n = 1 / n;
            let per_m = 1 / m;
            let per_nm = 1 / (sqrt(2 * n) * sqrt(m));
            let A = double_area / 2;
        }
        // E along and across the first rest edge, where the rest metric is diagonal; only p d2 − q d1 can cancel.
        // Dividing after the subtraction of n and m gives an exact zero at rest for exactly representable edges.
        let a = x1 - x0;
        let b = p * (x2 - x0) - q * a;
        let along = per_n * (norm_squared(a) / 2 - half_n);
        let across = per_m * (norm_squared(b) / 2 - half_m);
        let shear = per_nm * dot(a, b);
        (μ * double_area * (along^2 + across^2 + shear^2) + λ * A * (along + across)^2) / 2
    }
}
