use energy_macros::energy;

energy! {
    /// Neo-Hookean membrane on a triangle: A (μ/2 (tr FᵀF − 2) − μ ln J + λ/2 ln² J), J the ratio of areas (Bonet and Wood, *Nonlinear
    /// Continuum Mechanics for Finite Element Analysis*, §6.4, in two dimensions). λ and μ are per length, as for `StVK`. Infinite where the triangle has no
    /// area: no step of a solver that lowers the energy turns it over.
    #[audit]
    #[invariant(translation, rotation)]
    #[rest_state(zero_force)]
    pub energy NeoHookean(x0, x1, x2: Point; rest u0, u1, u2: Vec2; λ, μ: Scalar[N/m]) {
        rest {
            let D_m = columns(u1 - u0, u2 - u0);
            let B = adjugate(D_m);
            let d = det(D_m)^2;
            let per_d = 1 / (2 * d);
            let A = det(D_m) / 2;
        }
        // With E = (FᵀF − 1)/2: tr FᵀF − 2 = 2 tr E and J² = 1 + 2 tr E + 4 det E, so that nothing cancels near rest.
        let F = columns(x1 - x0, x2 - x0) * B;
        let E = per_d * (transpose(F) * F - d * identity(2));
        let ln_J = log1p(2 * trace(E) + 4 * det(E)) / 2;
        A * (μ * (trace(E) - ln_J) + λ / 2 * ln_J^2)
    }
}
