use energy_dsl::energy;

energy! {
    /// Contact of a point with a half-space: k/(3δ) max(δ − d, 0)³ of the signed distance d = n·(x − c). n is the
    /// outward unit normal, c a point of the surface.
    ///
    /// The energy is 0 beyond the thickness δ and twice differentiable there. The force is k δ at the surface and grows
    /// inside.
    #[audit]
    pub energy PlaneContact(x: Point; c: Vec3[m], n: Vec3[1], k: Scalar[N/m], δ: Scalar[m]) {
        let d = dot(n, x - c);
        k / (3 * δ) * max(δ - d, 0)^3
    }
}
