use energy_dsl::energy;

energy! {
    /// Bending of an isotropic plate on a triangle x0x1x2 whose mid-edge normals are free: A D/2 ((1 − ν) ‖κ‖² + ν tr² κ)
    /// with
    ///
    /// κ = Σ (θᵢ/2 + sᵢ φᵢ)/(A lᵢ) tᵢ ⊗ tᵢ − κ̄
    ///
    /// The sum is over the edges: θᵢ are their dihedral angles, tᵢ their normals in the plane of the triangle, of their
    /// lengths lᵢ, and A is the area, all of these at rest. y0, y1 and y2 are the far corners of the neighbours (y0 across
    /// the edge x1x2, and so on). φᵢ tilts the normal of an edge against the mean of those of its triangles; sᵢ is 1 in one
    /// of them and −1 in the other (Grinspun, Gingold, Reisman and Zorin 2006). κ̄ is the natural curvature: κ̄11, κ̄12 and
    /// κ̄22 in the axes of the rest shape.
    #[audit]
    #[invariant(translation)]
    pub energy MidEdgeShell(
        x0, x1, x2, y0, y1, y2: Point, φ0, φ1, φ2: Scalar[rad];
        rest u0, u1, u2: Vec2;
        D: Scalar[J], ν: Scalar[1], s0, s1, s2: Scalar[1], κ11, κ12, κ22: Scalar[1/m]
    ) {
        rest {
            let a0 = u2 - u1;
            let a1 = u0 - u2;
            let a2 = u1 - u0;
            let A = det(columns(a1, a2)) / 2;
            let t0 = vector(-a0.y, a0.x);
            let t1 = vector(-a1.y, a1.x);
            let t2 = vector(-a2.y, a2.x);
            let T0 = outer(t0, t0) / (A * norm(a0));
            let T1 = outer(t1, t1) / (A * norm(a1));
            let T2 = outer(t2, t2) / (A * norm(a2));
        }
        let w0 = dihedral(x0, y0, x1, x2) / 2 + s0 * φ0;
        let w1 = dihedral(x1, y1, x2, x0) / 2 + s1 * φ1;
        let w2 = dihedral(x2, y2, x0, x1) / 2 + s2 * φ2;
        let κ = w0 * T0 + w1 * T1 + w2 * T2 - columns(vector(κ11, κ12), vector(κ12, κ22));
        A * D / 2 * ((1 - ν) * ddot(κ, κ) + ν * trace(κ)^2)
    }
}
