//! The twelve formulas as declarations. They come from papers on solids, contact, rods and molecules, as printed there.
//! Rest shapes enter as parameters, B = D₀⁻¹, so that all contenders read the same numbers.

use energy_dsl::energy;

energy! {
    /// Lennard-Jones potential 4 k ((s/r)¹² − (s/r)⁶) of two atoms.
    pub energy LennardJones(p, q: Point; k, s: Scalar) {
        let r = s^2 / norm_squared(p - q);
        4 * k * (r^6 - r^3)
    }
}

energy! {
    /// Lagged friction of a point on a triangle: smoothed Coulomb friction of the slip along two tangents u and v.
    pub energy LaggedFriction(x0, x1, x2, x3: Point; y, u, v: Vec3, b, c, λ, ε: Scalar) {
        let d = x0 - (1 - b - c) * x1 - b * x2 - c * x3 - y;
        let s = sqrt(dot(d, u)^2 + dot(d, v)^2);
        λ * (if s < ε { s^2 / ε - s^3 / (3 * ε^2) + ε / 3 } else { s })
    }
}

energy! {
    /// Barrier −(s − a)² ln(s/a) of the squared distance s of two lines.
    pub energy LineBarrier(x0, x1, x2, x3: Point; k, a: Scalar) {
        let n = cross(x1 - x0, x3 - x2);
        let s = dot(n, x2 - x0)^2 / norm_squared(n);
        -k * (s - a)^2 * log(s / a)
    }
}

energy! {
    /// Bending B/2 ‖2 e × f/(‖e‖ ‖f‖ + e·f)‖² of an elastic rod, by its curvature binormal.
    pub energy CurvatureBinormal(p, q, r: Point; B: Scalar) {
        let e = q - p;
        let f = r - q;
        let κ = 2 * cross(e, f) / (norm(e) * norm(f) + dot(e, f));
        B / 2 * norm_squared(κ)
    }
}

energy! {
    /// Surface tension with a preferred area: k (A − a)².
    pub energy SurfaceArea(x0, x1, x2: Point; k, a: Scalar) {
        k * (norm(cross(x1 - x0, x2 - x0)) / 2 - a)^2
    }
}

energy! {
    /// Cohesive zone of two triangles: the gap of their centres, opening weighted against sliding.
    pub energy CohesiveZone(a0, a1, a2, b0, b1, b2: Point; k, δ: Scalar) {
        let g = (a0 + a1 + a2 - b0 - b1 - b2) / 3;
        let n = cross((a1 + b1 - a0 - b0) / 2, (a2 + b2 - a0 - b0) / 2);
        let t = dot(g, unit(n));
        let r = sqrt((t^2 + norm_squared(g)) / 2) / δ;
        k * (1 - (1 + r) * exp(-r)) * norm(n) / 2
    }
}

energy! {
    /// A brick with one point of quadrature: isochoric neo-Hookean of three mean edges.
    pub energy Brick(a, b, c, d, e, f, g, h: Point; μ, λ: Scalar) {
        let u = (b + c + f + g - a - d - e - h) / 4;
        let v = (c + d + g + h - a - b - e - f) / 4;
        let w = (e + f + g + h - a - b - c - d) / 4;
        let J = det(columns(u, v, w));
        μ * (norm_squared(u) + norm_squared(v) + norm_squared(w)) / J^(2/3) + λ * (J - 1)^2
    }
}

energy! {
    /// Symmetric Dirichlet energy μ (‖F‖² + ‖F⁻¹‖²) of a tetrahedron.
    pub energy SymmetricDirichlet(x0, x1, x2, x3: Point; B: Mat3x3, μ: Scalar) {
        let F = columns(x1 - x0, x2 - x0, x3 - x0) * B;
        let G = inverse(F);
        μ * (ddot(F, F) + ddot(G, G))
    }
}

energy! {
    /// Compressible Mooney–Rivlin tetrahedron: μ (I₁ J^(−2/3) − 3) + λ (I₂ J^(−4/3) − 3) + κ (J − 1)².
    pub energy MooneyRivlin(x0, x1, x2, x3: Point; B: Mat3x3, μ, λ, κ: Scalar) {
        let F = columns(x1 - x0, x2 - x0, x3 - x0) * B;
        let C = transpose(F) * F;
        let J = det(F);
        let I = trace(C);
        let K = (I^2 - ddot(C, C)) / 2;
        μ * (I * J^(-2/3) - 3) + λ * (K * J^(-4/3) - 3) + κ * (J - 1)^2
    }
}

energy! {
    /// Soft tissue after Fung: a (exp(b ‖E‖²) − 1).
    pub energy Fung(x0, x1, x2, x3: Point; B: Mat3x3, a, b: Scalar) {
        let F = columns(x1 - x0, x2 - x0, x3 - x0) * B;
        let E = (transpose(F) * F - identity(3)) / 2;
        a * (exp(b * ddot(E, E)) - 1)
    }
}

energy! {
    /// Artery with two families of fibres along u and v, after Holzapfel, Gasser and Ogden.
    pub energy Fibres(x0, x1, x2, x3: Point; B: Mat3x3, u, v: Vec3, a, b, c: Scalar) {
        let F = columns(x1 - x0, x2 - x0, x3 - x0) * B;
        let C = transpose(F) * F;
        let p = dot(u, C * u) - 1;
        let q = dot(v, C * v) - 1;
        c * (trace(C) - 3) + a / (2 * b) * (exp(b * p^2) + exp(b * q^2) - 2)
    }
}

energy! {
    /// St. Venant–Kirchhoff tetrahedron: μ ‖E‖² + λ/2 tr² E.
    pub energy StVenantKirchhoff(x0, x1, x2, x3: Point; B: Mat3x3, μ, λ: Scalar) {
        let F = columns(x1 - x0, x2 - x0, x3 - x0) * B;
        let E = (transpose(F) * F - identity(3)) / 2;
        μ * ddot(E, E) + λ / 2 * trace(E)^2
    }
}
