use energy_dsl::energy;

energy! {
    /// Contact of a point with a capsule, all points within r of the segment from a to b: k/(3δ) max(δ − d, 0)³ of the signed distance
    /// d = ‖x − p‖ − r, p the point of the segment nearest to x. Nothing from the thickness δ on, twice differentiable there; the push is
    /// k δ at the surface and grows inside. Where cylinder and caps meet the curvature jumps; on the segment it has no direction and is flagged.
    #[audit]
    pub energy CapsuleContact(x: Point; a: Vec3[m], b: Vec3[m], r: Scalar[m], k: Scalar[N/m], δ: Scalar[m]) {
        let e = b - a;
        let t = clamp(dot(x - a, e) / norm_squared(e), 0, 1);
        let d = norm(x - a - t * e) - r;
        k / (3 * δ) * max(δ - d, 0)^3
    }
}
