use energy_dsl::energy;

energy! {
    /// The potential whose force on point i is K′ (sin θ/2 − sin θ₀/2) uᵢ with uᵢ = −∂θ/∂xᵢ (after Bridson et al.
    /// 2003). K′ = K ‖Ē‖²/(‖N̄₁‖ + ‖N̄₂‖) is a constant of the rest shape:
    ///
    /// U = K′ (2 (cos θ₀/2 − cos θ/2) − (θ − θ₀) sin θ₀/2).
    ///
    /// With Δ = θ − θ₀ this equals K′ (4 cos(θ₀/2) sin²(Δ/4) − 2 sin(θ₀/2) (Δ/2 − sin Δ/2)), which does not cancel near
    /// rest.
    #[audit]
    pub energy BridsonBending(x1, x2, x3, x4: Point; K_prime: Scalar[J], θ0: Scalar[rad]) {
        let Δ = dihedral(x1, x2, x3, x4) - θ0;
        "K′ (2 cos(θ₀/2) one_minus_cos(Δ/2) − 2 sin(θ₀/2) x_minus_sin(Δ/2))"
    }
}
