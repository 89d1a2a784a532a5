use energy_dsl::energy;

energy! {
    /// Quadratic bending of a hinge, k (θ − θ₀)² (Grinspun et al. 2003, with the weight ‖e‖/h̄ in k). It has no factor
    /// ½ and does not wrap around at ±π.
    #[audit]
    #[invariant(translation, rotation)]
    pub energy QuadraticHinge(x1, x2, x3, x4: Point; k: Scalar[J], θ0: Scalar[rad]) {
        let θ = dihedral(x1, x2, x3, x4);
        "k (θ − θ₀)²"
    }
}
