use energy_dsl::energy;

energy! {
    fn motion(ξ, turn) { exp(twist(turn * angular(ξ), linear(ξ))) }

    /// The sign that brings a motion into the hemisphere of the pivot. q and −q are the same motion but blend
    /// differently.
    fn hemisphere(q, pivot) { if dot(real(q), real(pivot)) >= 0 { 1 } else { -1 } }

    fn distance(B, v, n, u) { dot(rotate(B, n), transform(B, v) - u) }

    fn blend4(ξ, turn, w) {
        let q = [motion(ξ[0], turn), motion(ξ[1], turn), motion(ξ[2], turn), motion(ξ[3], turn)];
        unit(w[0] * q[0] + sum(k in 1..4, w[k] * hemisphere(q[k], q[0]) * q[k]))
    }

    fn blend8(ξ, turn, w) {
        let q = [
            motion(ξ[0], turn), motion(ξ[1], turn), motion(ξ[2], turn), motion(ξ[3], turn),
            motion(ξ[4], turn), motion(ξ[5], turn), motion(ξ[6], turn), motion(ξ[7], turn)
        ];
        unit(w[0] * q[0] + sum(k in 1..8, w[k] * hemisphere(q[k], q[0]) * q[k]))
    }

    /// E_nonrigid for a vertex that one node moves: n̂·(v̂ − u), in m. v̂ and n̂ are the moved point and normal, u is
    /// the measured point.
    #[audit]
    pub residual NonrigidPlane1(ξ: [Twist; 1]; turn: Scalar[1], v: Vec3[m], n: Vec3[1], u: Vec3[m]) {
        distance(motion(ξ[0], turn), v, n, u)
    }

    /// E_nonrigid for a vertex that four nodes move: n̂·(v̂ − u), in m. v and n are the vertex and its unit normal at
    /// rest, u is the measured point.
    ///
    /// The motions are blended as dual quaternions (Kavan et al. 2008), qhat = Σ s_k w_k q_k/‖…‖. The sign s_k brings
    /// q_k into the hemisphere of the first motion. The derivative treats the signs and the weights w as constants.
    #[audit]
    pub residual NonrigidPlane4(
        ξ: [Twist; 4]; turn: Scalar[1], w: [Scalar[1]; 4], v: Vec3[m], n: Vec3[1], u: Vec3[m]
    ) {
        distance(blend4(ξ, turn, w), v, n, u)
    }

    /// [`NonrigidPlane4`] for a vertex that eight nodes move.
    #[audit]
    pub residual NonrigidPlane8(
        ξ: [Twist; 8]; turn: Scalar[1], w: [Scalar[1]; 8], v: Vec3[m], n: Vec3[1], u: Vec3[m]
    ) {
        distance(blend8(ξ, turn, w), v, n, u)
    }

    /// [`NonrigidPlane1`] with a fixed normal m, the n̂ of the last step: only the point moves.
    #[audit]
    pub residual FrozenPlane1(ξ: [Twist; 1]; turn: Scalar[1], v: Vec3[m], m: Vec3[1], u: Vec3[m]) {
        dot(m, transform(motion(ξ[0], turn), v) - u)
    }

    /// [`NonrigidPlane4`] with a fixed normal m, the n̂ of the last step: only the point moves.
    #[audit]
    pub residual FrozenPlane4(
        ξ: [Twist; 4]; turn: Scalar[1], w: [Scalar[1]; 4], v: Vec3[m], m: Vec3[1], u: Vec3[m]
    ) {
        dot(m, transform(blend4(ξ, turn, w), v) - u)
    }

    /// [`NonrigidPlane8`] with a fixed normal m, the n̂ of the last step: only the point moves.
    #[audit]
    pub residual FrozenPlane8(
        ξ: [Twist; 8]; turn: Scalar[1], w: [Scalar[1]; 8], v: Vec3[m], m: Vec3[1], u: Vec3[m]
    ) {
        dot(m, transform(blend8(ξ, turn, w), v) - u)
    }
}
