use energy_dsl::energy;

energy! {
    /// Overpressure p inside a closed surface: −p V, where V = Σ ⅙ (x₀ − c)·((x₁ − c) × (x₂ − c)) over its triangles is
    /// the enclosed volume. This element is the term of one triangle, with corners anticlockwise seen from outside.
    ///
    /// On a closed surface, the sum and the forces do not depend on the centre c. A centre near the surface keeps the
    /// terms small: rounding errors grow with the square of the distance.
    #[audit]
    pub energy Pressure(x0, x1, x2: Point; p: Scalar[Pa], c: Vec3[m]) {
        -p / 6 * dot(x0 - c, cross(x1 - c, x2 - c))
    }
}
