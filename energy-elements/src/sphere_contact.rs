use energy_dsl::energy;

energy! {
    /// Contact of a point with a ball of radius r: k/(3δ) max(δ − d, 0)³ of the signed distance d = ‖x − c‖ − r.
    ///
    /// The energy is 0 beyond the thickness δ and twice differentiable there. The force is k δ at the surface and grows
    /// inside. At the centre the direction is undefined and flagged.
    #[audit]
    pub energy SphereContact(x: Point; c: Vec3[m], r: Scalar[m], k: Scalar[N/m], δ: Scalar[m]) {
        let d = norm(x - c) - r;
        k / (3 * δ) * max(δ - d, 0)^3
    }
}
