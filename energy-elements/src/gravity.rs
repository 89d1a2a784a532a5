use energy_dsl::energy;

energy! {
    /// Weight of a point mass in a uniform field: −m g·x.
    #[audit]
    pub energy Gravity(x: Point; m: Scalar[kg], g: Vec3[m/s^2]) { -m * dot(g, x) }
}
