use energy_dsl::energy;

energy! {
    /// The dihedral angle θ itself, of the triangles x1x3x4 and x2x3x4: a building block, and what the audits look at first.
    #[audit]
    pub energy HingeAngle(x1, x2, x3, x4: Point) { dihedral(x1, x2, x3, x4) }
}
