use energy_dsl::energy;

energy! {
    /// Point-to-plane distance n̂·(v̂ − u) of a moved surface point to a measured point u, along the moved normal. It
    /// is the data term for tracking a body that four nodes move (Newcombe et al. 2015; Yu et al. 2017). v and n are
    /// the point and its unit normal at rest.
    ///
    /// Node j moves by exp(ξ_j), ξ = (θ, t): a rotation by 2‖θ‖ about θ, then a translation by t. The motions are
    /// blended as dual quaternions with the weights w (Kavan et al. 2008). Each gets the sign that brings it into the
    /// hemisphere of the first motion.
    #[audit]
    pub residual PointToPlane(ξ: [Twist; 4]; w: [Scalar[1]; 4], v: Vec3[m], n: Vec3[1], u: Vec3[m]) {
        let B = unit(sum(j in 0..4, w[j] * exp(ξ[j])));
        dot(rotate(B, n), transform(B, v) - u)
    }
}
