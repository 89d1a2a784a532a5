use energy_dsl::energy;

energy! {
    /// Distance of a moved surface point to a measured one along the moved normal, n̂·(v̂ − u): the data term of tracking a body
    /// that four nodes move (Newcombe et al. 2015; Yu et al. 2017). Node j moves by exp(ξ_j), ξ = (θ, t), a turn by 2‖θ‖ about θ and a
    /// shift by t; the nodes' motions are blended as dual quaternions (Kavan et al. 2008) with the weights w, each with the sign that
    /// brings its motion into the hemisphere of the first one's. v and n are the point and its unit normal at rest, u the measured point.
    #[audit]
    pub residual PointToPlane(ξ: [Twist; 4]; w: [Scalar[1]; 4], v: Vec3[m], n: Vec3[1], u: Vec3[m]) {
        let B = unit(sum(j in 0..4, w[j] * exp(ξ[j])));
        dot(rotate(B, n), transform(B, v) - u)
    }
}
