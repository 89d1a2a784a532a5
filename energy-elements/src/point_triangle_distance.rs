use energy_dsl::energy;

energy! {
    /// Distance of a point p from the plane through a, b and c: |n·(p − a)|/‖n‖ with n = (b − a) × (c − a). In the
    /// plane, and where the triangle has no area, the derivatives are taken as 0 and flagged.
    #[audit]
    #[invariant(translation, rotation)]
    pub energy PointTriangleDistance(p, a, b, c: Point) {
        let n = cross(b - a, c - a);
        abs(dot(n, p - a)) / norm(n)
    }
}
