use energy_dsl::energy;

energy! {
    /// cos θ/2 ≥ 0 of a hinge. At the exact fold it has a kink: the derivatives of the side θ → π are returned and flagged.
    #[audit]
    pub energy HingeCosHalf(x1, x2, x3, x4: Point) {
        let θ = dihedral(x1, x2, x3, x4);
        "cos(θ/2)"
    }
}
