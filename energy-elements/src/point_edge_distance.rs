use energy_dsl::energy;

energy! {
    /// Distance of a point p from the line through a and b: ‖(a − p) × (b − p)‖/‖b − a‖. On the line, and where a and b
    /// coincide, the derivatives are taken as 0 and flagged.
    #[audit]
    #[invariant(translation, rotation)]
    pub energy PointEdgeDistance(p, a, b: Point) {
        norm(cross(a - p, b - p)) / norm(b - a)
    }
}
