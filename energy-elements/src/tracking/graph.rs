use energy_dsl::energy;

energy! {
    fn motion(ξ, turn) { exp(twist(turn * angular(ξ), linear(ξ))) }

    /// E_graph: two neighbouring nodes should move the position x of the second node to the same point. The residual is
    /// T_i x − T_j x, in m. It also connects parts of a body that meet at a joint x.
    #[audit]
    pub residual GraphEdge(ξ_i, ξ_j: Twist; turn: Scalar[1], x: Vec3[m]) {
        transform(motion(ξ_i, turn), x) - transform(motion(ξ_j, turn), x)
    }
}
