use energy_dsl::energy;

energy! {
    /// Huber's loss of one number, ρ = y²/2 for |y| ≤ δ, else δ (|y| − δ/2); its derivative is ρ′, and the weight of a row in iteratively
    /// reweighted least squares ρ′/y.
    #[audit]
    #[even]
    pub residual HuberLoss(y: Scalar; δ: Scalar) {
        huber(y, δ)
    }

    /// Tukey's loss of one number, ρ = c²/6 (1 − (1 − (y/c)²)³) for |y| ≤ c, else c²/6: beyond c a row has no pull at all. Its weight
    /// ρ′/y is (1 − (y/c)²)². (Multiplied out: small losses would cancel in 1 − (1 − s)³.)
    #[audit]
    #[even]
    pub residual TukeyLoss(y: Scalar; c: Scalar) {
        let s = min((y / c)^2, 1);
        c^2 / 6 * s * (3 - s * (3 - s))
    }
}
