use energy_dsl::energy;

energy! {
    /// Distance of two points (Khungurn 2019, §4). Where they coincide, the derivatives are taken as 0 and flagged.
    #[audit]
    pub energy Distance(p_k, p_l: Point) = "‖p_k − p_ℓ‖";
}
