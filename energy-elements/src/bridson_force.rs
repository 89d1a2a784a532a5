use energy_dsl::energy;

energy! {
    /// Bridson's bending force as printed (Bridson et al. 2003): F_i = K ‖E‖²/(‖N₁‖ + ‖N₂‖) (sin θ/2 − sin θ₀/2) u_i
    /// with u_i = −∂θ/∂x_i.
    ///
    /// Its prefactor depends on the positions, so the force is not a gradient and ∂f/∂x is not symmetric.
    /// `BridsonBending` has a potential.
    #[audit]
    pub force BridsonForce(x1, x2, x3, x4: Point; K: Scalar[J], θ0: Scalar[rad]) {
        let E = x4 - x3;
        let N1 = cross(E, x1 - x3);
        let N2 = cross(x2 - x3, E);
        let θ = dihedral(x1, x2, x3, x4);
        let f = "K ‖E‖²/(‖N1‖ + ‖N2‖) (sin(θ/2) − sin(θ₀/2))";
        [-f * gradient(θ, x1), -f * gradient(θ, x2), -f * gradient(θ, x3), -f * gradient(θ, x4)]
    }
}
