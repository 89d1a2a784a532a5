use energy_dsl::energy;

energy! {
    fn motion(ξ, turn) { exp(twist(turn * angular(ξ), linear(ξ))) }

    /// E_skeleton with bones as unknowns: ñ·(ṽ − u), in m. Linear blend skinning over the four bones with the largest
    /// weights gives ṽ = Σ η_j T_bj v and ñ = Σ η_j R_bj n. The blended normal is not normalised. With fixed bones the
    /// residual is constant: it is reported but has no effect.
    #[audit]
    pub residual SkeletonPlane(
        b: [Twist; 4]; turn: Scalar[1], η: [Scalar[1]; 4], v: Vec3[m], n: Vec3[1], u: Vec3[m]
    ) {
        let q = [motion(b[0], turn), motion(b[1], turn), motion(b[2], turn), motion(b[3], turn)];
        dot(sum(j in 0..4, η[j] * rotate(q[j], n)), sum(j in 0..4, η[j] * transform(q[j], v)) - u)
    }

    /// A vertex and its normal, moved by linear blend skinning: Σ η_j T_bj v and Σ η_j R_bj n.
    #[audit]
    pub residual SkeletonPoint(b: [Twist; 4]; turn: Scalar[1], η: [Scalar[1]; 4], v: Vec3, n: Vec3) {
        let q = [motion(b[0], turn), motion(b[1], turn), motion(b[2], turn), motion(b[3], turn)];
        [sum(j in 0..4, η[j] * transform(q[j], v)), sum(j in 0..4, η[j] * rotate(q[j], n))]
    }
}
