use energy_dsl::energy;

energy! {
    /// Contact of a point with a rounded box: k/(3δ) max(δ − d, 0)³ of the signed distance d.
    ///
    /// The box contains all points within r of its core. The core contains the points whose distances from the centre c
    /// along the unit vectors e1, e2 and e3 are at most h. With q = (|eᵢ·(x − c)| − hᵢ), d is ‖max(q, 0)‖ − r outside
    /// the core and max(q₁, q₂, q₃) − r inside.
    ///
    /// The energy is 0 beyond the thickness δ and twice differentiable there. The force is k δ at the surface and grows
    /// inside. The curvature jumps where faces, edges and corners meet; the direction jumps inside the core.
    #[audit]
    pub energy BoxContact(
        x: Point;
        c: Vec3[m], e1: Vec3[1], e2: Vec3[1], e3: Vec3[1], h: Vec3[m],
        r: Scalar[m], k: Scalar[N/m], δ: Scalar[m]
    ) {
        let s = x - c;
        let q1 = abs(dot(e1, s)) - h.x;
        let q2 = abs(dot(e2, s)) - h.y;
        let q3 = abs(dot(e3, s)) - h.z;
        let deepest = max(q1, q2, q3);
        // Inside the core, a non-zero vector keeps the derivatives of the unused norm finite.
        let o1 = if deepest > 0 { max(q1, 0) } else { deepest };
        let outside = norm(vector(o1, max(q2, 0), max(q3, 0)));
        let d = if deepest > 0 { outside } else { deepest };
        k / (3 * δ) * max(δ + r - d, 0)^3
    }
}
