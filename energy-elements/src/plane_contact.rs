use energy_dsl::energy;

energy! {
    /// Contact of a point with a half-space, n the unit normal out of it and c a point of its surface: k/(3δ) max(δ − d, 0)³ of the signed
    /// distance d = n·(x − c). Nothing from the thickness δ on, twice differentiable there; the push is k δ at the surface and grows inside.
    #[audit]
    pub energy PlaneContact(x: Point; c: Vec3[m], n: Vec3[1], k: Scalar[N/m], δ: Scalar[m]) {
        let d = dot(n, x - c);
        k / (3 * δ) * max(δ - d, 0)^3
    }
}
