use energy_dsl::energy;

energy! {
    /// Drag of a triangle with unit normal n in a uniform wind: ⅓ (c_n |n·s|³ + c_t ‖t‖³). It applies the cross-flow
    /// principle, which treats the flows across and along a surface as independent (Hoerner 1965, Fluid-Dynamic Drag,
    /// §3).
    ///
    /// s is the displacement of the triangle's middle relative to that of the air, w; t is the tangential part of s. c
    /// = ½ ρ C A for the air density ρ, the drag coefficient C and the area A.
    ///
    /// With velocities as displacements this is Rayleigh's dissipation function: the force is minus its gradient, c_n
    /// |n·s| (n·s) n + c_t ‖t‖ t. On an inclined surface, the part of the normal force across the wind is lift.
    #[audit]
    pub energy WindDrag(u0, u1, u2: Point; n: Vec3[1], w: Vec3[m], c_n: Scalar[N/m^2], c_t: Scalar[N/m^2]) {
        let s = (u0 + u1 + u2) / 3 - w;
        let a = dot(n, s);
        (c_n * abs(a)^3 + c_t * norm(s - a * n)^3) / 3
    }
}
