use energy_dsl::energy;

energy! {
    /// Moves a vector that is perpendicular to the unit vector a as the smallest rotation from a to b does.
    fn transported(d, a, b) { d - dot(b, d) / (1 + dot(a, b)) * (a + b) }

    /// The area of the triangle of three unit vectors on the unit sphere.
    fn solid_angle(a, b, c) { 2 * atan2(dot(a, cross(b, c)), 1 + dot(a, b) + dot(b, c) + dot(c, a)) }

    /// Bending of a straight, isotropic rod at the middle of three points: B/2l ‖κb‖² with the curvature binormal
    /// κb = 2 tan(φ/2), where φ is the angle between the two edges and l half the sum of their lengths at rest (Bergou,
    /// Wardetzky, Robinson, Audoly and Grinspun 2008). B is the bending stiffness. If an edge is folded back, the energy
    /// is infinite.
    #[audit]
    #[invariant(translation, rotation)]
    pub energy RodBend(x0, x1, x2: Point; B: Scalar[N m^2], l: Scalar[m]) {
        let a = x1 - x0;
        let b = x2 - x1;
        2 * B / l * (norm(a) * norm(b) - dot(a, b)) / (norm(a) * norm(b) + dot(a, b))
    }

    /// Twist of a rod between two edges: C/2l (θ1 − θ0 + m − l τ)². θ0 and θ1 turn the material frames of the edges
    /// against reference frames; m is the twist between these, C the twisting stiffness, and τ the natural twist per
    /// length (Bergou, Audoly, Vouga, Wardetzky and Grinspun 2010).
    ///
    /// Reference frames are transported in time: between two steps, m grows by the area on the unit sphere that the path
    /// of the tangents encloses, from the last ones to the present ones. The state keeps the tangents of the last step, t0
    /// and t1, and its m. It starts with the tangents and with m = 0. A tangent must not turn by half a turn within a
    /// step.
    #[audit]
    pub energy RodTwist(
        x0, x1, x2: Point, θ0, θ1: Scalar[rad];
        state t0, t1: Vec3[1], m: Scalar[rad];
        C: Scalar[N m^2], l: Scalar[m], τ: Scalar[1/m]
    ) {
        let a = unit(x1 - x0);
        let b = unit(x2 - x1);
        let turned = m + solid_angle(t0, b, a) + solid_angle(t0, t1, b);
        next { t0 = a; t1 = b; m = turned; }
        C / (2 * l) * (θ1 - θ0 + turned - l * τ)^2
    }

    /// Bending of a rod with a cross section of two stiffnesses, B1 and B2, and natural curvatures κ1 and κ2 about the
    /// axes of its material frames: Σ Bᵢ/2l (κb·mᵢ − l κᵢ)². mᵢ are the means of the frames' axes on both edges
    /// (Bergou, Wardetzky, Robinson, Audoly and Grinspun 2008).
    ///
    /// The frame of an edge is its director d, transported from the tangent t of the last step to the present one, and
    /// turned by θ. For equal stiffnesses without natural curvature, [`RodBend`] is the same but for terms in the square
    /// of the twist between the edges, and cheaper. Both elements of an edge transport its director by the same
    /// operations, so they keep the same bits.
    #[audit]
    pub energy RodBendAnisotropic(
        x0, x1, x2: Point, θ0, θ1: Scalar[rad];
        state t0, t1, d0, d1: Vec3[1];
        B1, B2: Scalar[N m^2], l: Scalar[m], κ1, κ2: Scalar[1/m]
    ) {
        let a = unit(x1 - x0);
        let b = unit(x2 - x1);
        let u = transported(d0, t0, a);
        let v = transported(d1, t1, b);
        let binormal = 2 / (1 + dot(a, b)) * cross(a, b);
        let m = cos(θ0) * u + sin(θ0) * cross(a, u) + cos(θ1) * v + sin(θ1) * cross(b, v);
        let n = cos(θ0) * cross(a, u) - sin(θ0) * u + cos(θ1) * cross(b, v) - sin(θ1) * v;
        next { t0 = a; t1 = b; d0 = unit(u); d1 = unit(v); }
        (B1 * (dot(binormal, m) / 2 - l * κ1)^2 + B2 * (dot(binormal, n) / 2 - l * κ2)^2) / (2 * l)
    }

    /// Bending and twist of a round hair with a natural curvature κ and a natural torsion τ, at the middle of three
    /// points: B/2l ‖κb − l κ d̄‖² + C/2l (φ − l τ)², but that ‖d̄‖² counts as 1. κb is the curvature binormal, d̄ the mean
    /// of the directors of both edges, φ the twist between them, and l half the sum of the edges' lengths at rest.
    ///
    /// Directors are unit vectors across the edges that turn with the hair. They stay where they are in the material
    /// during a step: d moves from the tangent t of the last step to the present one without twist. Whoever sums the
    /// elements may turn the directors between steps, as hair without inertia about its axis does: it is in equilibrium
    /// at any time (Bergou, Wardetzky, Robinson, Audoly and Grinspun 2008). A tangent must not turn by half a turn
    /// within a step.
    #[audit]
    #[invariant(translation)]
    pub energy CurledHair(
        x0, x1, x2: Point;
        state t0, t1, d0, d1: Vec3[1];
        B, C: Scalar[N m^2], l: Scalar[m], κ, τ: Scalar[1/m]
    ) {
        let a = unit(x1 - x0);
        let b = unit(x2 - x1);
        let u = transported(d0, t0, a);
        let v = transported(d1, t1, b);
        let w = transported(u, a, b);
        let φ = atan2(dot(cross(w, v), b), dot(w, v));
        let binormal = 2 / (1 + dot(a, b)) * cross(a, b);
        next { t0 = a; t1 = b; d0 = unit(u); d1 = unit(v); }
        (B * (norm_squared(binormal) - l * κ * dot(binormal, u + v) + (l * κ)^2) + C * (φ - l * τ)^2) / (2 * l)
    }
}
