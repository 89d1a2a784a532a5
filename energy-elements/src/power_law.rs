use energy_dsl::energy;

energy! {
    /// Power of the distance of two points (Khungurn 2019, §4). Where they coincide the value is its limit; the gradient is for
    /// α > 1, the Hessian for α ≥ 2; otherwise they are 0 and flagged.
    #[audit]
    pub energy PowerLaw(p_k, p_l: Point; α: Scalar[1]) = "‖p_k − p_ℓ‖^α";
}
