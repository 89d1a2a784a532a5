use energy_dsl::energy;

energy! {
    fn motion(ξ, turn) { exp(twist(turn * angular(ξ), linear(ξ))) }

    fn hemisphere(q, pivot) { if dot(real(q), real(pivot)) >= 0 { 1 } else { -1 } }

    fn numbers(q) { [real(q).w, imaginary(real(q)), dual(q).w, imaginary(dual(q))] }

    fn sum4(ξ, turn, w) {
        let q = [motion(ξ[0], turn), motion(ξ[1], turn), motion(ξ[2], turn), motion(ξ[3], turn)];
        w[0] * q[0] + sum(k in 1..4, w[k] * hemisphere(q[k], q[0]) * q[k])
    }

    fn sum8(ξ, turn, w) {
        let q = [
            motion(ξ[0], turn), motion(ξ[1], turn), motion(ξ[2], turn), motion(ξ[3], turn),
            motion(ξ[4], turn), motion(ξ[5], turn), motion(ξ[6], turn), motion(ξ[7], turn)
        ];
        w[0] * q[0] + sum(k in 1..8, w[k] * hemisphere(q[k], q[0]) * q[k])
    }

    /// The motion of a node as eight numbers (w, x, y, z | w, x, y, z): q = (cos φ, θ sin φ/‖θ‖) with φ = turn ‖θ‖,
    /// then ½ (0, t) q.
    #[audit]
    pub residual TwistMotion(ξ: Twist; turn: Scalar[1]) {
        numbers(motion(ξ, turn))
    }

    /// The steps of blending four motions: the sum b = Σ s_k w_k q_k (8 rows), the unit dual quaternion (8), a moved
    /// point v̂ (3) and a moved normal n̂ (3).
    #[audit]
    pub residual BlendedMotion4(ξ: [Twist; 4]; turn: Scalar[1], w: [Scalar[1]; 4], v: Vec3, n: Vec3) {
        let b = sum4(ξ, turn, w);
        let B = unit(b);
        [real(b).w, imaginary(real(b)), dual(b).w, imaginary(dual(b)),
         real(B).w, imaginary(real(B)), dual(B).w, imaginary(dual(B)), transform(B, v), rotate(B, n)]
    }

    /// A vertex and its normal, moved by one node.
    #[audit]
    pub residual BlendedPoint1(ξ: [Twist; 1]; turn: Scalar[1], v: Vec3, n: Vec3) {
        let B = motion(ξ[0], turn);
        [transform(B, v), rotate(B, n)]
    }

    /// A vertex and its normal, moved by the blend of four nodes. See [`NonrigidPlane4`](crate::NonrigidPlane4).
    #[audit]
    pub residual BlendedPoint4(ξ: [Twist; 4]; turn: Scalar[1], w: [Scalar[1]; 4], v: Vec3, n: Vec3) {
        let B = unit(sum4(ξ, turn, w));
        [transform(B, v), rotate(B, n)]
    }

    /// A vertex and its normal, moved by the blend of eight nodes. See [`NonrigidPlane8`](crate::NonrigidPlane8).
    #[audit]
    pub residual BlendedPoint8(ξ: [Twist; 8]; turn: Scalar[1], w: [Scalar[1]; 8], v: Vec3, n: Vec3) {
        let B = unit(sum8(ξ, turn, w));
        [transform(B, v), rotate(B, n)]
    }
}
