use energy_dsl::energy;

energy! {
    /// Mollifier of a contact between two edges that may become parallel, where the direction of their distance jumps:
    /// K m(x) with m(x) = x (2 − x) for x < 1, else 1, and x = ‖(b − a) × (d − c)‖²/ε (Li et al. 2020, §4.3).
    ///
    /// ε is the square of the area below which the mollifier acts: 10⁻³ times the product of the squared rest lengths
    /// in the source. K is the energy of the contact without mollifier. The function is differentiable at x = 1.
    #[audit]
    #[invariant(translation, rotation)]
    pub energy ParallelEdges(a, b, c, d: Point; K: Scalar[J], ε: Scalar[m^4]) {
        let x = norm_squared(cross(b - a, d - c)) / ε;
        if x < 1 { K * x * (2 - x) } else { K }
    }
}
