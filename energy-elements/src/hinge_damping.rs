use energy_dsl::energy;

energy! {
    /// Damping of a hinge in proportion to the rate of its angle, −c θ̇ ∂θ/∂xᵢ. It does not resist rigid motions.
    ///
    /// If c is β times the stiffness of the angle, this is Rayleigh damping of the hinge at rest. ∂f/∂x is not
    /// symmetric.
    #[audit]
    pub force HingeDamping(x1, x2, x3, x4: Point, v1, v2, v3, v4: Velocity; c: Scalar[J s]) {
        let θ = dihedral(x1, x2, x3, x4);
        let g1 = gradient(θ, x1);
        let g2 = gradient(θ, x2);
        let g3 = gradient(θ, x3);
        let g4 = gradient(θ, x4);
        // Σ g = 0, so velocities enter as differences to v3.
        let rate = dot(g1, v1 - v3) + dot(g2, v2 - v3) + dot(g4, v4 - v3);
        [-c * rate * g1, -c * rate * g2, -c * rate * g3, -c * rate * g4]
    }
}
