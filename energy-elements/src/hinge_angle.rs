use energy_dsl::energy;

energy! {
    /// The dihedral angle θ between the triangles x1x3x4 and x2x3x4: a building block, and the reference element of the
    /// audits.
    #[audit]
    pub energy HingeAngle(x1, x2, x3, x4: Point) { dihedral(x1, x2, x3, x4) }
}
