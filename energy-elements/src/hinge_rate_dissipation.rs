use energy_dsl::energy;

energy! {
    /// Dissipation function of a hinge in proportion to the rate of its angle: c/2 (Σ gᵢ·wᵢ)² with the gradients gᵢ =
    /// ∂θ/∂xᵢ, fixed, and g₃ = −(g₁ + g₂ + g₄).
    ///
    /// With velocities as displacements w this is Rayleigh's dissipation function: the force is minus its gradient,
    /// which is that of [`HingeDamping`](crate::HingeDamping). It does not resist rigid motions. Its Hessian is
    /// constant.
    #[audit]
    #[invariant(translation)]
    pub energy HingeRateDissipation(w1, w2, w3, w4: Point; g1, g2, g4: Vec3[1/m], c: Scalar[J]) {
        let rate = dot(g1, w1 - w3) + dot(g2, w2 - w3) + dot(g4, w4 - w3);
        c / 2 * rate^2
    }
}
