use energy_dsl::energy;

energy! {
    /// Stable neo-Hookean membrane on a triangle with a logarithm (Smith et al. 2018), adapted to rest stability in two
    /// dimensions: A (μ/2 (I − 2) − μ/2 ln((I + 1)/3) + λ/2 ((J − α)² − (1 − α)²)) with α = 1 + 2μ/(3λ), I = tr FᵀF and
    /// J = ‖w_u × w_v‖.
    ///
    /// Terms that are linear in the strain cancel and are not computed. I − 2J = (s₁ − s₂)² comes from the anisotropy
    /// of FᵀF. Where J = 0, the derivatives of J are taken as 0 and flagged.
    #[audit]
    #[invariant(translation, rotation)]
    #[rest_state(zero_force)]
    pub energy StableNeoHookeanLog(x0, x1, x2: Point; rest u0, u1, u2: Vec2; λ, μ: Scalar[N/m]) {
        rest {
            let D_m = columns(u1 - u0, u2 - u0);
            let d = det(D_m);
            let B = scaled_adjugate(D_m);
            let d2 = scaled_det(D_m)^2;
            let per_d = 1 / d;
            let per_d2 = 1 / d2;
        }
        let a = x1 - x0;
        let b = x2 - x0;
        let F = columns(a, b) * B;
        let f_u = F * vector(1, 0);
        let f_v = F * vector(0, 1);
        let uu = norm_squared(f_u);
        let vv = norm_squared(f_v);
        let I = (uu + vv) * per_d2;
        let area = norm(cross(a, b));
        let J = area * per_d;
        // J − 1 and I − 2.
        let j = valued_as(J - 1, (area - d) * per_d);
        let i = ((uu - d2) + (vv - d2)) * per_d2;
        // I − 2J from (s₁² − s₂²)² and (s₁ + s₂)² = I + 2J.
        let anisotropy = ((uu - vv) * per_d2)^2 + (2 * dot(f_u, f_v) * per_d2)^2;
        let shape = anisotropy / (I + 2 * J);
        // With x = (I − 2)/3: I − 2 − ln((I + 1)/3) = 2x − (ln(1 + x) − x). The part 4j/3 of 2x cancels; 2 shape/3
        // remains.
        let distortion = computed_as(
            I - 2 - log((I + 1) / 3) - 4/3 * (J - 1),
            2/3 * shape - log1pmx(i / 3, (I + 1) / 3)
        );
        d / 4 * (μ * distortion + λ * j^2)
    }

    /// Neo-Hookean membrane on a triangle: A (μ/2 (I − 2) − μ ln J + λ/2 ln² J) with I = tr FᵀF and J = ‖w_u × w_v‖
    /// (Bonet and Wood, *Nonlinear Continuum Mechanics for Finite Element Analysis*, §6.4, in two dimensions). λ and μ
    /// are per length, as for `StVK`.
    ///
    /// The energy is infinite for a triangle of area 0, so a solver that lowers the energy cannot invert it. With j = J
    /// − 1, I − 2 − 2 ln J is computed as (s₁ − s₂)² + 2 (j − ln(1 + j)): neither part cancels near rest. Above J = 2
    /// it is computed as printed.
    #[audit]
    #[invariant(translation, rotation)]
    #[rest_state(zero_force)]
    pub energy NeoHookean(x0, x1, x2: Point; rest u0, u1, u2: Vec2; λ, μ: Scalar[N/m]) {
        rest {
            let D_m = columns(u1 - u0, u2 - u0);
            let d = det(D_m);
            let B = scaled_adjugate(D_m);
            let d2 = scaled_det(D_m)^2;
            let per_d = 1 / d;
            let per_d2 = 1 / d2;
        }
        let a = x1 - x0;
        let b = x2 - x0;
        let F = columns(a, b) * B;
        let f_u = F * vector(1, 0);
        let f_v = F * vector(0, 1);
        let uu = norm_squared(f_u);
        let vv = norm_squared(f_v);
        let I = (uu + vv) * per_d2;
        let area = norm(cross(a, b));
        let J = area * per_d;
        let j = (area - d) * per_d;
        let l = valued_as(log(J), log1p(j, J));
        // I − 2J from (s₁² − s₂²)² and (s₁ + s₂)² = I + 2J.
        let anisotropy = ((uu - vv) * per_d2)^2 + (2 * dot(f_u, f_v) * per_d2)^2;
        let shape = anisotropy / (I + 2 * J);
        // Far from rest, 2J would cancel between the two parts.
        let distortion = computed_as(
            I - 2 - 2 * log(J),
            if j > 1 { I - 2 - 2 * l } else { shape - 2 * log1pmx(j, J) }
        );
        d / 4 * (μ * distortion + λ * l^2)
    }
}
