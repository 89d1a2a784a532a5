use energy_dsl::energy;

energy! {
    /// cos θ for the dihedral angle θ of a hinge.
    #[audit]
    pub energy HingeCos(x1, x2, x3, x4: Point) { cos(dihedral(x1, x2, x3, x4)) }
}
