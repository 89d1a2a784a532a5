use energy_dsl::energy;

energy! {
    /// sin θ/2 for the dihedral angle θ of a hinge, with the sign of θ; +1 at the exact fold.
    #[audit]
    pub energy HingeSinHalf(x1, x2, x3, x4: Point) {
        let θ = dihedral(x1, x2, x3, x4);
        "sin(θ/2)"
    }
}
