use energy_dsl::energy;

energy! {
    /// Huber's loss of a number: ρ = y²/2 for |y| ≤ δ, else δ (|y| − δ/2). Its derivative is ρ′; the weight of a row in
    /// iteratively reweighted least squares is ρ′/y.
    #[audit]
    #[even]
    pub residual HuberLoss(y: Scalar; δ: Scalar) {
        huber(y, δ)
    }

    /// Tukey's loss of a number: ρ = c²/6 (1 − (1 − (y/c)²)³) for |y| ≤ c, else c²/6, where the row exerts no pull. Its
    /// weight ρ′/y is (1 − (y/c)²)². The code expands 1 − (1 − s)³, which would cancel for small losses.
    #[audit]
    #[even]
    pub residual TukeyLoss(y: Scalar; c: Scalar) {
        let s = min((y / c)^2, 1);
        c^2 / 6 * s * (3 - s * (3 - s))
    }
}
