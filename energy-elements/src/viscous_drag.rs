use energy_dsl::energy;

energy! {
    /// Drag in proportion to velocity, −c v: the damping of the mass–spring cloth model.
    #[audit]
    pub force ViscousDrag(_x: Point, v: Velocity; c: Scalar[N s/m]) { -c * v }
}
