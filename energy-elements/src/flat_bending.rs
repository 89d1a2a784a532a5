use energy_dsl::energy;

energy! {
    /// Bending of two triangles that are flat at rest, for isometric deformations: 3 k/(4 (A₁ + A₂)) ‖Σ cᵢ xᵢ‖² with
    /// the weights c of the cotangent Laplacian (Bergou, Wardetzky, Harmon, Zorin and Grinspun 2006, §4). x1 and x2 are
    /// opposite the edge x3–x4.
    ///
    /// The energy is quadratic, so its Hessian is constant. For small angles it equals a hinge of energy ¾ k ‖e‖²/(A₁ +
    /// A₂) θ².
    #[audit]
    #[invariant(translation, rotation)]
    pub energy FlatBending(x1, x2, x3, x4: Point; rest X1, X2, X3, X4: Vec3; k: Scalar[J]) {
        rest {
            let e = X4 - X3;
            let n1 = norm(cross(e, X1 - X3));
            let n2 = norm(cross(e, X2 - X3));
            // Sums of the cotangents at X3 and at X4 over both triangles.
            let at3 = dot(e, X1 - X3) / n1 + dot(e, X2 - X3) / n2;
            let at4 = dot(X3 - X4, X1 - X4) / n1 + dot(X3 - X4, X2 - X4) / n2;
            let apart2 = norm_squared(e) / n2;
            let per_area = 2 / (n1 + n2);
        }
        // c₃ is the cotangent sum at X4 and c₄ the one at X3. Each triangle adds −‖e‖²/(2A) to c₁ + c₂ = −(c₃ + c₄), so
        // Σ c = 0.
        let K = at4 * (x3 - x1) + at3 * (x4 - x1) - apart2 * (x2 - x1);
        3 / 4 * k * per_area * norm_squared(K)
    }
}
