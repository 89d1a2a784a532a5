use energy_dsl::energy;

energy! {
    /// Dissipation function of a membrane in proportion to its strain rate (Kelvin–Voigt solid): A (η_μ ‖Ė‖² + ½ η_λ
    /// tr² Ė), where Ė = sym(FᵀG) is the rate of the Green strain.
    ///
    /// F = (f₁ f₂) is the deformation gradient, fixed; G is the gradient of the displacements w. With velocities as
    /// displacements this is Rayleigh's dissipation function: the force is minus its gradient, which is that of
    /// [`StrainRateDamping`](crate::StrainRateDamping) at F. It does not resist rigid motions. Its Hessian is constant.
    #[audit]
    #[invariant(translation)]
    pub energy StrainRateDissipation(
        w0, w1, w2: Point;
        rest u0, u1, u2: Vec2;
        f1, f2: Vec3[1], η_λ, η_μ: Scalar[N/m]
    ) {
        rest {
            let D_m = columns(u1 - u0, u2 - u0);
            let B = inverse(D_m);
            let A = det(D_m) / 2;
        }
        let G = columns(w1 - w0, w2 - w0) * B;
        let H = transpose(columns(f1, f2)) * G;
        let rate = (H + transpose(H)) / 2;
        A * (η_μ * ddot(rate, rate) + η_λ / 2 * trace(rate)^2)
    }
}
