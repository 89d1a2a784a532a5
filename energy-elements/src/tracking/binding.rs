use energy_dsl::energy;

energy! {
    fn motion(ξ, turn) { exp(twist(turn * angular(ξ), linear(ξ))) }

    /// E_binding with known bones: a node should move its position x to where its bones take it. The residual is T x −
    /// x̃ with x̃ = Σ η_j T_bj x, in m.
    #[audit]
    pub residual Binding(ξ: Twist; turn: Scalar[1], x: Vec3[m], x̃: Vec3[m]) {
        transform(motion(ξ, turn), x) - x̃
    }

    /// E_binding with bones as unknowns: T x − Σ η_j T_bj x, in m, over the four bones with the largest weights.
    #[audit]
    pub residual BoneBinding(ξ: Twist, b: [Twist; 4]; turn: Scalar[1], η: [Scalar[1]; 4], x: Vec3[m]) {
        transform(motion(ξ, turn), x) - sum(j in 0..4, η[j] * transform(motion(b[j], turn), x))
    }
}
