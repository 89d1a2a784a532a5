use energy_dsl::energy;

energy! {
    /// Smoothed Coulomb friction of a point on a surface with unit normal n (Kikuchi and Oden 1988, §10.3): λ (√(‖t‖² +
    /// ε²) − ε).
    ///
    /// The sliding t is the tangential part of u − w, the displacement relative to the surface's. λ is the coefficient
    /// of friction times the normal force; ε is the sliding at which the resistance is λ/√2.
    ///
    /// With velocities as displacements this is Rayleigh's dissipation function: the force is minus its gradient.
    #[audit]
    pub energy SlidingFriction(u: Point; n: Vec3[1], w: Vec3[m], λ: Scalar[N], ε: Scalar[m]) {
        // n × (u − w) has the length of t but avoids the cancellation in u − w − (n·(u − w)) n.
        let t = cross(n, u - w);
        // √(‖t‖² + ε²) as a norm: its derivatives neither overflow nor underflow at any scale of velocity.
        let s = norm(vector(t.x, t.y, t.z, ε));
        λ * norm_squared(t) / (s + ε)
    }
}
