use energy_dsl::energy;

energy! {
    /// Bending of an isotropic plate on a triangle x0x1x2 with the flexural rigidity D = Y h³/(12(1 − ν²)), λ = ν D and
    /// μ = (1 − ν) D/2. y0, y1 and y2 are the far corners of its neighbours (y0 across the edge x1x2, and so on):
    ///
    /// A (λ/2 tr² κ + μ ‖κ‖²),  κ = 1/(2A) Σ ‖e‖ (ϑ − ϑ̄) n ⊗ n,  ϑ = √8 sin(θ/√8)
    ///
    /// The sum is over the three edges: n are their normals in the plane of the triangle, θ their dihedral angles, ϑ
    /// the angles of arcs ([`ArcAngle`](crate::ArcAngle)), ϑ̄ their rest values, and A is the rest area.
    ///
    /// This is the lowest-order Hellan–Herrmann–Johnson element (Comodi 1989). The normal of each edge lies half-way
    /// between those of its triangles (Grinspun, Gingold, Reisman and Zorin 2006).
    ///
    /// It bends as a plate in every direction if the two triangles of each edge are rotated copies of each other, as in
    /// a regular lattice. On other meshes the normals need a tilt.
    #[audit]
    #[invariant(translation, rotation)]
    #[rest_state(zero_force)]
    pub energy PlateBending(x0, x1, x2, y0, y1, y2: Point; rest X0, X1, X2, Y0, Y1, Y2: Vec3; λ, μ: Scalar[J]) {
        rest {
            let a0 = X2 - X1;
            let a1 = X0 - X2;
            let a2 = X1 - X0;
            let l0 = norm(a0);
            let l1 = norm(a1);
            let l2 = norm(a2);
            // The mixed products in 2‖κ‖²: (n·n)² is the squared cosine of the angle between two edges.
            let c01 = 2 * (dot(a0, a1) / (l0 * l1))^2;
            let c12 = 2 * (dot(a1, a2) / (l1 * l2))^2;
            let c20 = 2 * (dot(a2, a0) / (l2 * l0))^2;
            // 1/(4 · 2A), times the 8 of ϑ² = 8 sin²(θ/√8).
            let per_A = 8 / (4 * norm(cross(a1, a2)));
            let s0 = sin(dihedral(X0, Y0, X1, X2) / sqrt(8));
            let s1 = sin(dihedral(X1, Y1, X2, X0) / sqrt(8));
            let s2 = sin(dihedral(X2, Y2, X0, X1) / sqrt(8));
        }
        let q0 = l0 * (sin(dihedral(x0, y0, x1, x2) / sqrt(8)) - s0);
        let q1 = l1 * (sin(dihedral(x1, y1, x2, x0) / sqrt(8)) - s1);
        let q2 = l2 * (sin(dihedral(x2, y2, x0, x1) / sqrt(8)) - s2);
        let norm2 = q0^2 + q1^2 + q2^2 + c01 * q0 * q1 + c12 * q1 * q2 + c20 * q2 * q0;
        per_A * (λ * (q0 + q1 + q2)^2 + 2 * μ * norm2)
    }
}
