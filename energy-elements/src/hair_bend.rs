use energy_dsl::energy;

energy! {
    /// Bending of a hair at the middle of three points: 0 if its two segments are collinear, k if it is folded back
    /// (Khungurn 2019, §6).
    #[audit]
    #[invariant(translation, rotation)]
    pub energy HairBend(p0, p1, p2: Point; k: Scalar[J]) {
        let a = p1 - p0;
        let b = p2 - p1;
        "k/2 (1 − â·b̂)"
    }
}
