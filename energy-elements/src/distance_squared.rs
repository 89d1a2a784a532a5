use energy_dsl::energy;

energy! {
    /// Squared distance of two points (Khungurn 2019, §4): a polynomial, regular everywhere.
    #[audit]
    pub energy DistanceSquared(p_k, p_l: Point) = "‖p_k − p_ℓ‖²";
}
