//! The polar decomposition F = R S of 2×2 and 3×2 matrices.

use energy_dsl::{Residual, energy};

energy! {
    residual Planar(F: Mat2x2) {
        let R = rotation_of(F);
        let S = stretch_of(F);
        let I = transpose(R) * R - identity(2);
        let P = R * S - F;
        [I[0], I[1], det(R) - 1, P[0], P[1], S[0][1] - S[1][0], trace(S)]
    }
    residual Spatial(F: Mat3x2) {
        let R = rotation_of(F);
        let S = stretch_of(F);
        let I = transpose(R) * R - identity(2);
        let P = R * S - F;
        [I[0], I[1], P[0], P[1], P[2], S[0][1] - S[1][0], trace(S), det(S)]
    }
    /// The gradient of ½ ‖F − R‖² is F − R, so its Hessian is the Jacobian.
    residual Rigid(F: Mat2x2) { let D = F - rotation_of(F); [D[0], D[1]] }
    residual RigidMembrane(F: Mat3x2) { let D = F - rotation_of(F); [D[0], D[1], D[2]] }
}

/// Numbers in (−2, 2) that are not special.
fn numbers<const N: usize>(seed: usize) -> [f64; N] {
    std::array::from_fn(|i| 2.0 * (((seed * N + i) as f64) * 1.7 + 0.3).sin())
}

#[test]
fn factors_are_a_rotation_and_symmetric() {
    for seed in 0..200 {
        let f = numbers::<4>(seed);
        let at = Planar::new().residual(&f);
        assert!(at.value[..10].iter().all(|error| error.abs() < 1e-14), "{f:?}: {at:?}");
        // (σ₁ + σ₂)² = ‖F‖² + 2 det F with signed singular values.
        let (square, det): (f64, f64) = (f.iter().map(|x| x * x).sum(), f[0] * f[3] - f[1] * f[2]);
        assert!((at.value[10].powi(2) - square - 2.0 * det).abs() < 1e-13 && !at.flags.any());

        let f = numbers::<6>(seed);
        let at = Spatial::new().residual(&f);
        let scale = 1e-13 / at.value[12].abs().min(1.0);
        assert!(at.value[..11].iter().all(|error| error.abs() < scale), "{f:?}: {at:?}");
        let [a, b] = [0, 1].map(|j| [f[j], f[2 + j], f[4 + j]]);
        let dot = |u: [f64; 3], v: [f64; 3]| u[0] * v[0] + u[1] * v[1] + u[2] * v[2];
        let area = (dot(a, a) * dot(b, b) - dot(a, b).powi(2)).sqrt();
        assert!((at.value[12] - area).abs() < 1e-12, "det S = {} is not {area}", at.value[12]);
        assert!(at.value[11] > 0.0 && !at.flags.any());
    }
}

#[test]
fn derivatives_are_finite_where_singular_values_meet() {
    // At F = s I, turning by φ moves R by the antisymmetric direction; 1 − 1/s remains there, 1 elsewhere.
    for s in [1.0_f64, 0.5, 3.0] {
        let at = Rigid::new().jacobian(&[s, 0.0, 0.0, s]);
        let (along, turned) = (1.0 - 0.5 / s, 0.5 / s);
        let expected = [1.0, 0.0, 0.0, 0.0, 0.0, along, turned, 0.0, 0.0, turned, along, 0.0, 0.0, 0.0, 0.0, 1.0];
        assert!(!at.flags.any());
        assert!(
            at.jacobian.iter().zip(expected).all(|(found, expected): (&f64, f64)| (found - expected).abs() < 1e-15),
            "{at:?}"
        );
        // Out of the plane, a membrane resists with 1 − 1/σ.
        let at = RigidMembrane::new().jacobian(&[s, 0.0, 0.0, s, 0.0, 0.0]);
        assert!(!at.flags.any() && (at.jacobian[28] - (1.0 - 1.0 / s)).abs() < 1e-15, "{at:?}");
    }
}

#[test]
fn a_vanishing_sum_is_flagged() {
    // A reflection: the signed singular values are 1 and −1.
    for f in [[1.0, 0.0, 0.0, -1.0], [0.0; 4]] {
        let at = Rigid::new().jacobian(&f);
        assert!(at.flags.degenerate && at.jacobian.iter().chain(&at.value).all(|x| f64::is_finite(*x)), "{at:?}");
    }
    // An inverted matrix with different singular values is ordinary.
    assert!(!Rigid::new().jacobian(&[2.0, 0.0, 0.0, -1.0]).flags.any());
    let at = RigidMembrane::new().jacobian(&[1.0, 2.0, 1.0, 2.0, -1.0, -2.0]);
    assert!(at.flags.degenerate && at.jacobian.iter().chain(&at.value).all(|x| f64::is_finite(*x)), "{at:?}");
}
