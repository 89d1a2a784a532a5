use energy_dsl::energy;

energy! {
    /// Work of one pressure p on the volume that a closed surface encloses: −p V, by triangle. p is one unknown for all of
    /// them. With [`GasReservoir`] it settles at the pressure of a gas; then the sum is concave in p, and what matters is
    /// its maximum over p.
    ///
    /// Corners are anticlockwise seen from outside. The sum does not depend on the centre c; one near the surface keeps the
    /// terms small. See [`Pressure`](crate::Pressure) for a given pressure.
    #[audit]
    pub energy EnclosedVolume(x0, x1, x2: Point, shared p: Scalar[Pa]; c: Vec3[m]) {
        -p / 6 * dot(x0 - c, cross(x1 - x0, x2 - x0))
    }

    /// The gas in a closed surface: p V₀ − p² V₀/2K, with the volume V₀ that it has without pressure and its bulk modulus K.
    /// The sum with [`EnclosedVolume`] is largest over p at p = K (V₀ − V)/V₀; its value there is ½ K (V − V₀)²/V₀.
    #[audit]
    pub energy GasReservoir(shared p: Scalar[Pa]; V0: Scalar[m^3], K: Scalar[Pa]) { p * V0 - p^2 * V0 / (2 * K) }
}
