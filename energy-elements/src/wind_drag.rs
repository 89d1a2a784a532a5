use energy_dsl::energy;

energy! {
    /// Drag of a triangle with unit normal n in an even wind, by the independence of the flow across and along a surface (cross-flow
    /// principle; Hoerner 1965, Fluid-Dynamic Drag, §3): ⅓ (c_n |n·s|³ + c_t ‖t‖³) of the displacement s of its middle beyond that of the
    /// air, w, and of t, the part of s along the surface. c = ½ ρ C A, with the density ρ of the air, the coefficient C and the area A. Of
    /// displacements in a unit of time, that is velocities, it is Rayleigh's dissipation function: its gradient is minus the force,
    /// c_n |n·s| (n·s) n + c_t ‖t‖ t. An inclined surface is lifted by the part of its normal force that is across the wind.
    #[audit]
    pub energy WindDrag(u0, u1, u2: Point; n: Vec3[1], w: Vec3[m], c_n: Scalar[N/m^2], c_t: Scalar[N/m^2]) {
        let s = (u0 + u1 + u2) / 3 - w;
        let a = dot(n, s);
        (c_n * abs(a)^3 + c_t * norm(s - a * n)^3) / 3
    }
}
