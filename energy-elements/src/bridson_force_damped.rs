use energy_dsl::energy;

energy! {
    /// Bridson's bending force with damping (Bridson et al. 2003): `BridsonForce` and −k_d ‖E‖ (Σ u_j·v_j) u_i.
    ///
    /// In this form the damping does not depend on the sign convention of θ. The rate Σ u_j·v_j depends on velocity
    /// differences only.
    #[audit]
    pub force BridsonForceDamped(
        x1, x2, x3, x4: Point, v1, v2, v3, v4: Velocity;
        K: Scalar[J], k_d: Scalar[N s], θ0: Scalar[rad]
    ) {
        let E = x4 - x3;
        let N1 = cross(E, x1 - x3);
        let N2 = cross(x2 - x3, E);
        let θ = dihedral(x1, x2, x3, x4);
        let u1 = -gradient(θ, x1);
        let u2 = -gradient(θ, x2);
        let u3 = -gradient(θ, x3);
        let u4 = -gradient(θ, x4);
        // Σ u_j = 0, so velocities enter as differences to v3.
        let rate = dot(u1, v1 - v3) + dot(u2, v2 - v3) + dot(u4, v4 - v3);
        let f = "K ‖E‖²/(‖N1‖ + ‖N2‖) (sin(θ/2) − sin(θ₀/2)) − k_d ‖E‖ rate";
        [f * u1, f * u2, f * u3, f * u4]
    }
}
