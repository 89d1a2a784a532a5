//! The polar decomposition F = R S of 2×2, 3×2 and 3×3 matrices.

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
    residual Solid(F: Mat3x3) {
        let R = rotation_of(F);
        let S = stretch_of(F);
        let I = transpose(R) * R - identity(3);
        let P = R * S - F;
        [I[0], I[1], I[2], det(R) - 1, P[0], P[1], P[2], trace(S) - ddot(R, F), det(S) - det(F), trace(S)]
    }
    residual RigidSolid(F: Mat3x3) { let D = F - rotation_of(F); [D[0], D[1], D[2]] }
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

/// R (in rows) times diag(σ) times the transpose of another rotation.
fn with_singular_values(seed: usize, values: [f64; 3]) -> [f64; 9] {
    let rotation = |seed: usize| {
        let q = numbers::<4>(seed);
        let length = q.iter().map(|x| x * x).sum::<f64>().sqrt();
        let [w, x, y, z] = q.map(|c| c / length);
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
        ]
    };
    let (u, v) = (rotation(2 * seed), rotation(2 * seed + 1));
    std::array::from_fn(|e| (0..3).map(|k| u[e / 3][k] * values[k] * v[e % 3][k]).sum())
}

#[test]
fn a_solid_has_a_rotation_and_a_symmetric_stretch() {
    let lists = [
        [1.0, 1.0, 1.0],
        [1.0 + 1e-9, 1.0, 1.0 - 1e-9],
        [3.0, 2.0, 1.0],
        [3.0, 2.0, -1.0],
        [1.0, 1.0, 0.0],
        [2.0, 2.0, -0.5],
        [100.0, 1.0, 0.01],
        [1.0, 1e-3, 1e-3],
        [1.0, 1e-3, -9e-4],
        [1e150, 9e149, 1e140],
        [1e-150, 9e-151, -1e-152],
    ];
    for (seed, values) in lists.into_iter().cycle().take(200).enumerate() {
        let f = with_singular_values(seed, values);
        let at = Solid::new().residual(&f);
        let [first, second, third] = values;
        // The condition number of R.
        let kappa = first / (second + third);
        let allowed = |scale: f64| 4e-15 * kappa * scale;
        let errors = |range: std::ops::Range<usize>| at.value[range].iter().fold(0.0, |most: f64, x| most.max(x.abs()));
        assert!(errors(0..10) < 4e-15, "{values:?}: not a rotation: {at:?}");
        assert!(errors(10..19) <= allowed(first), "{values:?}: {:e} of {:e}", errors(10..19), allowed(first));
        let trace = at.value[21];
        assert!((trace - (first + second + third)).abs() <= 1e-14 * first, "{values:?}: trace {trace}");
        assert!(!at.flags.any(), "{values:?}: {:?}", at.flags);
    }
}

#[test]
fn derivatives_of_a_solid_are_finite_where_singular_values_meet() {
    // At F = s I, stretches meet 1, rotations 1 − 1/s.
    for s in [1.0_f64, 0.5, 3.0] {
        let at = RigidSolid::new().jacobian(&[s, 0.0, 0.0, 0.0, s, 0.0, 0.0, 0.0, s]);
        let (along, turned) = (1.0 - 0.5 / s, 0.5 / s);
        for (entry, found) in at.jacobian.iter().enumerate() {
            let (row, column) = (entry / 9, entry % 9);
            let opposite = column % 3 * 3 + column / 3;
            let expected = match row {
                _ if row == column && row % 4 == 0 => 1.0,
                _ if row == column => along,
                _ if row == opposite => turned,
                _ => 0.0,
            };
            assert!((found - expected).abs() < 1e-15, "({row}, {column}): {found}, expected {expected}");
        }
        assert!(!at.flags.any());
    }
}

#[test]
fn a_solid_without_a_rotation_is_flagged() {
    // A reflection, a fold onto a line, nothing at all, and a rotated reflection.
    let tilted = with_singular_values(3, [2.0, 1.0, -1.0]);
    for f in [
        [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, -1.0],
        [1.0, 2.0, 3.0, 2.0, 4.0, 6.0, 0.0, 0.0, 0.0],
        [0.0; 9],
        tilted,
    ] {
        let at = RigidSolid::new().jacobian(&f);
        assert!(
            at.flags.degenerate && at.jacobian.iter().chain(&at.value).all(|x| f64::is_finite(*x)),
            "{f:?}: {at:?}"
        );
    }
}

/// Rotations and energies of needles and near mirror images, whose errors σ₁/(σ₂ + σ₃) amplifies.
#[test]
fn needles_and_near_mirror_images_keep_their_rotation() {
    for diagonal in [
        [1.0, 1e-5, 1e-8],
        [1.0, 3e-7, 3e-7],
        [1.0, 1e-3, -9.99e-4],
        [1.0, 1e-4, -9.9e-5],
        [1.0, 1.0, -0.999_999],
        [1.0, 1e-10, -9e-11],
    ] {
        let f: [f64; 9] = std::array::from_fn(|entry| if entry % 4 == 0 { diagonal[entry / 4] } else { 0.0 });
        let at = RigidSolid::new().residual(&f);
        let kappa = diagonal[0] / (diagonal[1] + diagonal[2]);
        for (entry, found) in at.value.iter().enumerate() {
            let expected = if entry % 4 == 0 { diagonal[entry / 4] - 1.0 } else { 0.0 };
            let error: f64 = found - expected;
            assert!(error.abs() <= 6e-15 * kappa, "{diagonal:?}: {found}, expected {expected}");
        }
        assert!(!at.flags.any(), "{diagonal:?}");
    }
}
