use energy_dsl::energy;

energy! {
    /// Contact of a point with a capsule: k/(3δ) max(δ − d, 0)³ of the signed distance d = ‖x − p‖ − r. The capsule
    /// contains all points within r of the segment from a to b; p is the point of the segment nearest to x.
    ///
    /// The energy is 0 beyond the thickness δ and twice differentiable there. The force is k δ at the surface and grows
    /// inside. The curvature jumps where the cylinder meets its caps. On the segment the direction is undefined and
    /// flagged.
    #[audit]
    pub energy CapsuleContact(x: Point; a: Vec3[m], b: Vec3[m], r: Scalar[m], k: Scalar[N/m], δ: Scalar[m]) {
        let e = b - a;
        let t = clamp(dot(x - a, e) / norm_squared(e), 0, 1);
        let d = norm(x - a - t * e) - r;
        k / (3 * δ) * max(δ - d, 0)^3
    }
}
