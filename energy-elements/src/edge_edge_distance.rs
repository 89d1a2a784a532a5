use energy_dsl::energy;

energy! {
    /// Distance of the line through a and b from the line through c and d: |n·(c − a)|/‖n‖ with n = (b − a) × (d − c).
    /// Where the lines meet, and where they are parallel, the derivatives are taken as 0 and flagged.
    #[audit]
    #[invariant(translation, rotation)]
    pub energy EdgeEdgeDistance(a, b, c, d: Point) {
        let n = cross(b - a, d - c);
        abs(dot(n, c - a)) / norm(n)
    }
}
