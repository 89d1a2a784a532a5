use energy_dsl::energy;

energy! {
    /// Damping of a membrane in proportion to its strain rate: minus the velocity gradient of A (η_μ ‖Ė‖² + ½ η_λ tr²
    /// Ė), where Ė = sym(FᵀḞ) is the rate of the Green strain (Kelvin–Voigt solid).
    ///
    /// It does not resist rigid motions. With η = β (λ, μ) it is Rayleigh damping of `StVK` at rest. ∂f/∂x is not
    /// symmetric.
    #[audit]
    pub force StrainRateDamping(
        x0, x1, x2: Point, v0, v1, v2: Velocity;
        rest u0, u1, u2: Vec2;
        η_λ, η_μ: Scalar[N s/m]
    ) {
        rest {
            let D_m = columns(u1 - u0, u2 - u0);
            let B = inverse(D_m);
            let A = det(D_m) / 2;
        }
        let F = columns(x1 - x0, x2 - x0) * B;
        let G = columns(v1 - v0, v2 - v0) * B;
        let H = transpose(F) * G;
        let rate = (H + transpose(H)) / 2;
        let S = 2 * η_μ * rate + η_λ * trace(rate) * identity(2);
        let P = A * F * S * transpose(B);
        let f1 = -(P * vector(1, 0));
        let f2 = -(P * vector(0, 1));
        [-(f1 + f2), f1, f2]
    }
}
