use energy_dsl::energy;

energy! {
    /// Distance of a point p from the plane through a, b and c: |n·(p − b)|/‖n‖ with n = (c − b) × (a − b). In the
    /// plane, and where the triangle has no area, the derivatives are taken as 0 and flagged.
    ///
    /// Edges start at b. A needle keeps its digits if its short edge starts there, and so does a distance from an edge
    /// if p is near b.
    #[audit]
    #[invariant(translation, rotation)]
    pub energy PointTriangleDistance(p, a, b, c: Point) {
        let n = cross(c - b, a - b);
        abs(dot(n, p - b)) / norm(n)
    }
}
