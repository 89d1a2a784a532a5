use energy_dsl::energy;

energy! {
    /// Witkin's spring without rest length: C = p_k − p_l, a vector, so that neither energy nor damping has a singular point
    /// (Witkin & Baraff 1997; Khungurn 2019, §5). Its energy is ½ k_s ‖C‖², its damping force −k_d (v_k − v_l).
    #[audit]
    pub constraint ZeroLengthSpring(p_k, p_l: Point) = "p_k − p_ℓ";
}
