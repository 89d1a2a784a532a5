use energy_dsl::energy;

energy! {
    /// Witkin's spring without rest length: C = p_k − p_l (Witkin & Baraff 1997; Khungurn 2019, §5). The constraint is
    /// a vector, so energy and damping have no singular point.
    ///
    /// Its energy is ½ k_s ‖C‖²; its damping force is −k_d (v_k − v_l).
    #[audit]
    pub constraint ZeroLengthSpring(p_k, p_l: Point) = "p_k − p_ℓ";
}
