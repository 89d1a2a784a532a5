use energy_dsl::energy;

energy! {
    /// Power of the distance of two points (Khungurn 2019, §4). Where they coincide, the value is its limit, and so are
    /// the gradient for α > 1 and the Hessian for α ≥ 2. Otherwise they are taken as 0 and flagged.
    #[audit]
    pub energy PowerLaw(p_k, p_l: Point; α: Scalar[1]) = "‖p_k − p_ℓ‖^α";
}
