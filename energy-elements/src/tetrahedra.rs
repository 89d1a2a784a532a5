use energy_dsl::energy;

energy! {
    // Both are written with A = FᵀF − 1 for F = D D_m⁻¹: its invariants vanish at rest, where I − 3 and J − 1 would
    // cancel.

    /// St. Venant–Kirchhoff solid on a tetrahedron: V (μ ‖E‖² + λ/2 tr² E) with the Green strain E = (FᵀF − 1)/2 and
    /// Lamé's parameters λ and μ.
    ///
    /// A polynomial, regular everywhere; it does not resist inversion. The rest shape must have a positive volume:
    /// (X1 − X0) · ((X2 − X0) × (X3 − X0)) > 0.
    #[audit]
    #[invariant(translation, rotation)]
    #[rest_state(zero_force)]
    pub energy TetStVK(x0, x1, x2, x3: Point; rest X0, X1, X2, X3: Point; λ, μ: Scalar[Pa]) {
        rest {
            let D_m = columns(X1 - X0, X2 - X0, X3 - X0);
            let B = inverse(D_m);
            let V = det(D_m) / 6;
        }
        let F = columns(x1 - x0, x2 - x0, x3 - x0) * B;
        let A = transpose(F) * F - identity(3);
        V / 8 * (2 * μ * ddot(A, A) + λ * trace(A)^2)
    }

    /// Stable neo-Hookean solid on a tetrahedron (Smith, de Goes & Kim 2018, *Stable Neo-Hookean Flesh Simulation*,
    /// equation 14): V (μ/2 (I − 3) − μ/2 ln((I + 1)/4) + λ/2 ((J − α)² − (1 − α)²)) with I = tr FᵀF, J = det F and
    /// α = 1 + 3μ/(4λ). It is 0 at rest and resists inversion with a finite energy.
    ///
    /// λ and μ are those of the formula; the paper gives them in terms of Lamé's parameters: μ = 4/3 μ_Lamé and λ =
    /// λ_Lamé + 5/6 μ_Lamé. The rest shape must have a positive volume: (X1 − X0) · ((X2 − X0) × (X3 − X0)) > 0.
    ///
    /// In value and gradient, terms that are linear in the strain cancel and are not computed. Second derivatives are
    /// those of the printed formula, whose sums do not cancel.
    #[audit]
    #[invariant(translation, rotation)]
    #[rest_state(zero_force)]
    pub energy TetStableNeoHookean(x0, x1, x2, x3: Point; rest X0, X1, X2, X3: Point; λ, μ: Scalar[Pa]) {
        rest {
            let D_m = columns(X1 - X0, X2 - X0, X3 - X0);
            let B = inverse(D_m);
            let d = det(D_m);
            let per_d = 1 / d;
            let V = d / 6;
        }
        let D = columns(x1 - x0, x2 - x0, x3 - x0);
        let F = D * B;
        let A = transpose(F) * F - identity(3);
        // I − 3, and J² − 1 = i + r.
        let i = trace(A);
        let second = trace(adjugate(A));
        let r = second + det(A);
        let J = det(D) * per_d;
        let I = valued_as(ddot(F, F), i + 3);
        // J − 1, and I − 3 − 2 (J − 1), which is quadratic in the strain. Far from rest they are computed as printed.
        // The squared size of A is i² − 2 second.
        let is_near = i^2 - 2 * second < 1/4 && J > 0;
        let j = valued_as(J - 1, if is_near { (i + r) / (J + 1) } else { J - 1 });
        let distortion = if is_near { (i * j - 2 * r) / (J + 1) } else { i - 2 * j };
        let deviation = computed_as(
            I - 3 - 3/2 * (J - 1) - log((I + 1) / 4),
            3/4 * distortion - log1pmx(i / 4, (I + 1) / 4)
        );
        V / 2 * (μ * deviation + λ * j^2)
    }

    /// As-rigid-as-possible solid on a tetrahedron (Sorkine & Alexa 2007; Chao et al. 2010, *A Simple Geometric Model
    /// for Elastic Deformations*): V μ/2 ‖F − R‖² with the rotation R of the polar decomposition F = R S, det R = 1.
    ///
    /// It is ½ V μ Σ (sᵢ − 1)² of the signed singular values s of F, so it resists inversion. Where two of them sum to
    /// 0, R has no limit: derivatives are taken as 0 and flagged. The rest shape must have a positive volume.
    #[audit]
    #[invariant(translation, rotation)]
    #[rest_state(zero_force)]
    pub energy TetAsRigidAsPossible(x0, x1, x2, x3: Point; rest X0, X1, X2, X3: Point; μ: Scalar[Pa]) {
        rest {
            let D_m = columns(X1 - X0, X2 - X0, X3 - X0);
            let B = inverse(D_m);
            let V = det(D_m) / 6;
        }
        let F = columns(x1 - x0, x2 - x0, x3 - x0) * B;
        let D = F - rotation_of(F);
        V * μ / 2 * ddot(D, D)
    }

    /// Corotational linear solid on a tetrahedron (McAdams et al. 2011, *Efficient Elasticity for Character Skinning*):
    /// V (μ ‖F − R‖² + λ/2 tr²(S − I)) with the polar decomposition F = R S, det R = 1.
    ///
    /// If two signed singular values of F sum to 0, R has no limit: derivatives are taken as 0 and flagged. The rest
    /// shape must have a positive volume.
    #[audit]
    #[invariant(translation, rotation)]
    #[rest_state(zero_force)]
    pub energy TetCorotational(x0, x1, x2, x3: Point; rest X0, X1, X2, X3: Point; λ, μ: Scalar[Pa]) {
        rest {
            let D_m = columns(X1 - X0, X2 - X0, X3 - X0);
            let B = inverse(D_m);
            let V = det(D_m) / 6;
        }
        let F = columns(x1 - x0, x2 - x0, x3 - x0) * B;
        let D = F - rotation_of(F);
        V / 2 * (2 * μ * ddot(D, D) + λ * (trace(stretch_of(F)) - 3)^2)
    }
}
