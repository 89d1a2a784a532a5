use energy_dsl::energy;

energy! {
    /// The dihedral angle θ as a smooth surface through the vertices has it: √8 sin(θ/√8), which is θ − θ³/48 + …
    ///
    /// Facets of length s that turn by θ from one to the next are chords of a circle of curvature κ = 2 sin(θ/2)/s, and the arc over a chord is
    /// s (θ/2)/sin(θ/2) long. So the arc bends with ½ D κ² · arc = D θ sin(θ/2)/s instead of the facets' ½ D θ²/s: up to terms in θ⁶ it is ½ D/s
    /// times the square of this. A coarse mesh, whose hinges turn far, is a little softer so, as it must be: with 20 edges along it, a strip that
    /// bends under its own weight (Γ = 100) has its rigidity to 0.1 % instead of 2 %. It grows with θ up to the fold.
    #[audit]
    pub energy ArcAngle(x1, x2, x3, x4: Point) {
        let wide = sqrt(8);
        wide * sin(dihedral(x1, x2, x3, x4) / wide)
    }
}
