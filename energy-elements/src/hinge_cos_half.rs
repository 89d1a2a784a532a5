use energy_dsl::energy;

energy! {
    /// cos θ/2 ≥ 0 for the dihedral angle θ of a hinge. It has a kink at the exact fold; the derivatives there are
    /// those of the side θ → π, and are flagged.
    #[audit]
    pub energy HingeCosHalf(x1, x2, x3, x4: Point) {
        let θ = dihedral(x1, x2, x3, x4);
        "cos(θ/2)"
    }
}
