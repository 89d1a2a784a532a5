use energy_dsl::energy;

energy! {
    /// Overpressure p inside a closed surface: −p V, where V = Σ ⅙ (x₀ − c)·((x₁ − x₀) × (x₂ − x₀)) over its triangles
    /// is the enclosed volume. This element is the term of one triangle, with corners anticlockwise seen from outside.
    ///
    /// On a closed surface, the sum and the forces do not depend on the centre c. A centre near the surface keeps the
    /// terms small. The edges in place of x₁ − c and x₂ − c keep the digits of small triangles.
    #[audit]
    pub energy Pressure(x0, x1, x2: Point; p: Scalar[Pa], c: Vec3[m]) {
        -p / 6 * dot(x0 - c, cross(x1 - x0, x2 - x0))
    }
}
