use energy_dsl::energy;

energy! {
    /// Coulomb's friction of a point on a surface with unit normal n, made smooth (Kikuchi and Oden 1988, §10.3): λ (√(‖t‖² + ε²) − ε) of the
    /// sliding t, the part of the displacement u beyond that of the surface, w, along the surface. λ is the coefficient of friction times
    /// the normal force, ε the sliding at which the resistance is λ/√2. Of displacements in a unit of time, that is velocities, it is
    /// Rayleigh's dissipation function: its gradient is minus the force.
    #[audit]
    pub energy SlidingFriction(u: Point; n: Vec3[1], w: Vec3[m], λ: Scalar[N], ε: Scalar[m]) {
        // n × (u − w) has the length of t without the cancellation of u − w − (n·(u − w)) n.
        let t = cross(n, u - w);
        // √(‖t‖² + ε²) as a length: no scale of velocities is too large or too small for its derivatives.
        let s = norm(vector(t.x, t.y, t.z, ε));
        λ * norm_squared(t) / (s + ε)
    }
}
