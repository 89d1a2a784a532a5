use energy_dsl::energy;

energy! {
    /// Contact of a point with a ball of radius r: k/(3δ) max(δ − d, 0)³ of the signed distance d = ‖x − c‖ − r. Nothing from the thickness
    /// δ on, twice differentiable there; the push is k δ at the surface and grows inside. At the centre it has no direction and is flagged.
    #[audit]
    pub energy SphereContact(x: Point; c: Vec3[m], r: Scalar[m], k: Scalar[N/m], δ: Scalar[m]) {
        let d = norm(x - c) - r;
        k / (3 * δ) * max(δ - d, 0)^3
    }
}
