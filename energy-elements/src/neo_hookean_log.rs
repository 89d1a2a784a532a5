use energy_macros::energy;

energy! {
    /// x − ln(1 + x) for |x| < ¼, to 28 digits with second derivatives: 2 artanh z = ln(1 + x), z = x/(2 + x), x − 2z = x z.
    fn x_minus_log1p_near_0(x) {
        let z = x / (2 + x);
        let y = z^2;
        let tail = y * (1/5 + y * (1/7 + y * (1/9 + y * (1/11 + y * (1/13 + y * (1/15 + y * (1/17 + y * (1/19
            + y * (1/21 + y * (1/23 + y * (1/25 + y * (1/27 + y * (1/29 + y * (1/31 + y * (1/33 + y * (1/35 + y * (1/37)))))))))))))))));
        z * (x - 2 * y * (1/3 + tail))
    }

    /// x − ln(1 + x).
    fn x_minus_log1p(x) {
        if abs(x) < 0.25 { x_minus_log1p_near_0(x) } else { x - log1p(x) }
    }

    /// Stable neo-Hookean membrane on a triangle with logarithm (Smith et al. 2018), stable at rest in two dimensions:
    /// A (μ/2 (I − 2) − μ/2 ln((I + 1)/3) + λ/2 ((J − α)² − (1 − α)²)), α = 1 + 2μ/(3λ). I = tr FᵀF, J = ‖w_u × w_v‖. What is linear in the
    /// strain cancels and is not formed: I − 2J = (s₁ − s₂)² comes from the anisotropy of FᵀF. Where J = 0 its derivatives are 0
    /// of J and flagged.
    #[audit]
    #[invariant(translation, rotation)]
    #[rest_state(zero_force)]
    pub energy StableNeoHookeanLog(x0, x1, x2: Point; rest u0, u1, u2: Vec2; λ, μ: Scalar[N/m]) {
        rest {
            let D_m = columns(u1 - u0, u2 - u0);
            // Scaled, so that triangles of any size are computed near 1.
            let d = det(D_m);
            let s = power_of_two(d);
            let B = adjugate(D_m) * s;
            let d2 = (d * s)^2;
        }
        let a = x1 - x0;
        let b = x2 - x0;
        let F = columns(a, b) * B;
        let f_u = F * vector(1, 0);
        let f_v = F * vector(0, 1);
        let area = norm(cross(a, b));
        // J − 1, and I − 2.
        let j = (area - d) / d;
        let i = trace(transpose(F) * F - d2 * identity(2)) / d2;
        // (s₁ + s₂)² = I + 2J, and (s₁² − s₂²)².
        let square = ddot(F, F) / d2 + 2 * area / d;
        let anisotropy = (dot(f_u - f_v, f_u + f_v) / d2)^2 + 4 * (dot(f_u, f_v) / d2)^2;
        let shape = anisotropy / square;
        // I − 2 − ln((I + 1)/3) = 2x + (x − ln(1 + x)), x = (I − 2)/3; of 2x the part 4j/3 cancels, and 2 shape/3 is left.
        d / 4 * (μ * (2/3 * shape + x_minus_log1p(i / 3)) + λ * j^2)
    }

    /// Neo-Hookean membrane on a triangle: A (μ/2 (I − 2) − μ ln J + λ/2 ln² J), I = tr FᵀF, J = ‖w_u × w_v‖ (Bonet and Wood, *Nonlinear
    /// Continuum Mechanics for Finite Element Analysis*, §6.4, in two dimensions). λ and μ are per length, as for `StVK`. Infinite where the
    /// triangle has no area: no step of a solver that lowers the energy turns it over. I − 2 − 2 ln J is formed as
    /// (s₁ − s₂)² + 2 (j − ln(1 + j)), j = J − 1, neither of which cancels near rest; above J = 2 as it stands.
    #[audit]
    #[invariant(translation, rotation)]
    #[rest_state(zero_force)]
    pub energy NeoHookean(x0, x1, x2: Point; rest u0, u1, u2: Vec2; λ, μ: Scalar[N/m]) {
        rest {
            let D_m = columns(u1 - u0, u2 - u0);
            // Scaled, so that triangles of any size are computed near 1.
            let d = det(D_m);
            let s = power_of_two(d);
            let B = adjugate(D_m) * s;
            let d2 = (d * s)^2;
        }
        let a = x1 - x0;
        let b = x2 - x0;
        let F = columns(a, b) * B;
        let f_u = F * vector(1, 0);
        let f_v = F * vector(0, 1);
        let area = norm(cross(a, b));
        let j = (area - d) / d;
        let J = area / d;
        // I, (s₁ + s₂)² = I + 2J, and (s₁² − s₂²)².
        let I = ddot(F, F) / d2;
        let square = I + 2 * J;
        let anisotropy = (dot(f_u - f_v, f_u + f_v) / d2)^2 + 4 * (dot(f_u, f_v) / d2)^2;
        // ln J, near rest from j, and j − ln J.
        let is_near = abs(j) < 0.25;
        let near = x_minus_log1p_near_0(j);
        let l = if is_near { j - near } else { log(J) };
        let excess = if is_near { near } else { j - log(J) };
        // Far from rest 2J would cancel between the two.
        let distortion = if j > 1 { I - 2 - 2 * l } else { anisotropy / square + 2 * excess };
        d / 4 * (μ * distortion + λ * l^2)
    }
}
