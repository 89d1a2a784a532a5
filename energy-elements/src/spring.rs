use energy_dsl::energy;

energy! {
    /// Witkin's spring of rest length L: C = ‖p_k − p_l‖ − L (Witkin & Baraff 1997; Khungurn 2019, §5).
    ///
    /// Its energy is ½ k_s C². Its damping force acts along the spring only and makes ∂f/∂x unsymmetric. With L = 0 it
    /// is regular everywhere.
    #[audit]
    #[invariant(translation, rotation)]
    #[even]
    pub constraint Spring(p_k, p_l: Point; L: Scalar[m]) = "‖p_k − p_ℓ‖ − L";
}
