use energy_dsl::energy;

energy! {
    /// Contact of a point with a box, rounded by r: all points within r of those whose distances from the centre c along the unit vectors
    /// e1, e2 and e3 are at most h. k/(3δ) max(δ − d, 0)³ of the signed distance d, which is ‖max(q, 0)‖ − r outside that core and the
    /// largest of q less r inside, q = (|eᵢ·(x − c)| − hᵢ). Nothing from the thickness δ on, twice differentiable there; the push is k δ at the
    /// surface and grows inside. Where faces, edges and corners meet the curvature jumps, and inside the core the direction does.
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
        // Inside, a vector that does not vanish: its norm has derivatives, though they are not used.
        let o1 = if deepest > 0 { max(q1, 0) } else { deepest };
        let outside = norm(vector(o1, max(q2, 0), max(q3, 0)));
        let d = if deepest > 0 { outside } else { deepest };
        k / (3 * δ) * max(δ + r - d, 0)^3
    }
}
