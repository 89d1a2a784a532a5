//! Laws that hold exactly, and values known in closed form.

use crate::catalogue;
use energy_dsl::{Baseline, ForceLaw, Inputs, Kind, Level, LevelName, Outputs, Potential, level};
use energy_elements::{
    BridsonBending, Distance, Gravity, HairBend, HingeAngle, HingeCosHalf, HingeSinHalf, HookeSpring, PowerLaw, Spring,
    StVK, TetAsRigidAsPossible, TetCorotational, TetStVK, TetStableNeoHookean, ViscousDrag, ZeroLengthSpring,
};
use proptest::prelude::*;

fn evaluate(name: &str, parameters: &[f64], rest: &[f64], positions: &[f64], velocities: &[f64]) -> Outputs<f64> {
    (catalogue::find(name).unwrap().evaluate)(&Inputs { parameters, rest, positions, velocities }).unwrap()
}

fn block<'a>(outputs: &'a Outputs<f64>, name: &str) -> &'a [f64] {
    &outputs.blocks.iter().find(|(n, _)| *n == name).unwrap().1
}

/// Positions on a grid of 2⁻²⁰, so that translations on the same grid are exact.
fn points(n: usize) -> impl Strategy<Value = Vec<f64>> {
    prop::collection::vec((-(1_i32 << 20)..(1 << 20)).prop_map(|i| f64::from(i) / f64::from(1 << 20)), 3 * n)
}

/// Typical parameters and rest shape of an element.
fn ordinary(name: &str) -> (Vec<f64>, Vec<f64>) {
    let declaration = catalogue::find(name).unwrap().declaration;
    let implied = if declaration.kind == Kind::Constraint { 2 } else { 0 };
    let parameters = declaration.parameters.iter().map(|p| p.size).sum::<usize>() + implied;
    let rest = match declaration.rest.iter().map(|field| field.size).sum::<usize>() {
        0 => vec![],
        6 => vec![0.1, 0.0, 1.0, 0.25, 0.0, 0.75],
        12 if name.starts_with("Tet") => vec![0.0, 0.0, 0.0, 1.0, 0.25, 0.0, 0.0, 1.0, 0.5, 0.0, 0.0, 0.75],
        12 => vec![0.5, -1.0, 0.0, 0.25, 0.75, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0],
        18 => vec![0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.25, 1.0, 0.0, 1.0, 1.0, 0.0, -0.75, 0.75, 0.0, 0.5, -1.0, 0.0],
        other => panic!("{name}: no rest shape of {other} numbers here"),
    };
    (vec![0.75; parameters], rest)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// An exactly representable translation changes no bit of elements that depend on differences only.
    #[test]
    fn translation_is_exact(x in points(6), shift in points(1), v in points(6)) {
        for entry in catalogue::ELEMENTS.iter().filter(|e| e.declaration.translation_invariant) {
            let (name, n) = (&*entry.declaration.name, 3 * entry.declaration.points.len());
            let (parameters, rest) = ordinary(name);
            let moved: Vec<f64> = x[..n].iter().enumerate().map(|(i, c)| c + shift[i % 3]).collect();
            let here = evaluate(name, &parameters, &rest, &x[..n], &v[..n]);
            let there = evaluate(name, &parameters, &rest, &moved, &v[..n]);
            prop_assert_eq!(here.blocks, there.blocks, "{}", name);
        }
    }

    /// Scaling space by a power of two keeps angles and scales lengths exactly. Extreme scales take the general path,
    /// which always has fused operations. Without them on the ordinary path, only scales of one path give the same
    /// bits.
    #[test]
    fn scaling_by_a_power_of_two_is_exact(x in points(4), exponent in -300_i32..300) {
        let has_fused = Baseline::FUSED || level() > LevelName::Baseline;
        // Points on the grid are at least 2⁻²⁰ apart, and the ordinary path ends at 2⁻⁸⁰ and 2⁸⁰.
        let from = if has_fused || exponent.abs() <= 50 { 0 } else { 110 * exponent.signum() };
        let to = from + exponent;
        let scaled = |exponent: i32| x.iter().map(|c| c * 2.0_f64.powi(exponent)).collect::<Vec<f64>>();
        let degrees = [("HingeAngle", 0), ("HingeSinHalf", 0), ("HingeCosHalf", 0), ("HingeCos", 0), ("Distance", 1)];
        for (name, degree) in degrees {
            let n = 3 * catalogue::find(name).unwrap().declaration.points.len();
            let [here, there] = [from, to].map(|exponent| evaluate(name, &[], &[], &scaled(exponent)[..n], &[]));
            for (order, block_name) in ["energy", "grad", "hess"].into_iter().enumerate() {
                let power = 2.0_f64.powi(exponent * (degree - order as i32));
                for (a, b) in block(&here, block_name).iter().zip(block(&there, block_name)) {
                    prop_assert_eq!(a * power, *b, "{} {}", name, block_name);
                }
            }
        }
    }

    /// Only one triangle of the Hessian is computed, so the Hessian and its diagonal blocks are exactly symmetric.
    #[test]
    fn hessians_are_exactly_symmetric(x in points(6)) {
        for entry in catalogue::ELEMENTS.iter().filter(|e| e.declaration.kind == Kind::Energy) {
            let (name, n) = (&*entry.declaration.name, 3 * entry.declaration.points.len());
            let (parameters, rest) = ordinary(name);
            let outputs = evaluate(name, &parameters, &rest, &x[..n], &[]);
            let hessian = block(&outputs, "hess");
            for i in 0..n {
                for j in 0..i {
                    prop_assert_eq!(hessian[i * n + j].to_bits(), hessian[j * n + i].to_bits(), "{}", name);
                }
            }
        }
    }

    /// A uniform translation is not damped.
    #[test]
    fn rigid_translation_is_not_damped(x in points(4), velocity in points(1)) {
        let v = velocity.repeat(4);
        for (name, parameters, still) in [
            ("Spring", vec![0.5, 3.0, 7.0], vec![0.5, 3.0, 0.0]),
            ("ZeroLengthSpring", vec![3.0, 7.0], vec![3.0, 0.0]),
            ("BridsonForceDamped", vec![2.0, 7.0, 0.25], vec![2.0, 0.0, 0.25]),
        ] {
            let n = 3 * catalogue::find(name).unwrap().declaration.points.len();
            let damped = evaluate(name, &parameters, &[], &x[..n], &v[..n]);
            let undamped = evaluate(name, &still, &[], &x[..n], &v[..n]);
            prop_assert_eq!(block(&damped, "force"), block(&undamped, "force"), "{}", name);
        }
    }
}

const ORIGIN: [f64; 3] = [0.0; 3];

#[test]
fn coincident_points_return_what_is_documented() {
    let both = [[0.25, -1.5, 3.0]; 2];
    let distance = Distance::<f64>::new().hessian(&both);
    assert_eq!((distance.value, distance.gradient, distance.flags.degenerate), (0.0, [ORIGIN; 2], true));
    assert!(!Distance::<f64>::new().value(&both).flags.any(), "the distance itself is regular");
    for (power, first, second) in
        [(3.0, false, false), (2.0, false, false), (1.5, false, true), (1.0, true, true), (0.5, true, true)]
    {
        let law = PowerLaw::new(power);
        assert_eq!(law.gradient(&both).flags.degenerate, first, "α = {power}");
        assert_eq!(law.hessian(&both).flags.degenerate, second, "α = {power}");
        assert_eq!(law.gradient(&both).gradient, [ORIGIN; 2], "α = {power}");
    }
    assert_eq!(PowerLaw::new(2.0).hessian(&both).hessian[0], [[2.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 2.0]]);
    assert_eq!(PowerLaw::new(-1.0).value(&both).value, f64::INFINITY);
    // Without rest length the spring is regular. With one, its direction is undefined.
    let slack = Spring::new(0.0, 100.0, 0.0).hessian(&both);
    assert_eq!((slack.hessian[0][0], slack.flags.any()), ([100.0, 0.0, 0.0], false));
    let collapsed = Spring::new(0.5, 100.0, 0.0).hessian(&both);
    assert_eq!((collapsed.value, collapsed.gradient, collapsed.flags.degenerate), (12.5, [ORIGIN; 2], true));
}

#[test]
fn hinges_are_regular_when_flat_and_documented_when_folded_or_degenerate() {
    let flat = [[1.0, 0.25, 0.0], [-0.75, 0.5, 0.0], ORIGIN, [0.0, 1.0, 0.0]];
    let theta = HingeAngle::<f64>::new().hessian(&flat);
    assert_eq!((theta.value, theta.flags.any()), (0.0, false));
    assert_eq!(theta.gradient[0], [0.0, 0.0, 1.0], "−n/h of the first triangle, n = −z");
    let folded = [[1.0, 0.25, 0.0], [0.5, 0.5, 0.0], ORIGIN, [0.0, 1.0, 0.0]];
    assert_eq!(HingeAngle::<f64>::new().value(&folded).value, std::f64::consts::PI);
    assert_eq!(HingeSinHalf::<f64>::new().value(&folded).value, 1.0);
    let kink = HingeCosHalf::<f64>::new().gradient(&folded);
    assert_eq!((kink.value, kink.flags.kink), (0.0, true));
    assert!(kink.gradient.as_flattened().iter().all(|g| g.is_finite()));
    let on_edge = [[0.0, 0.5, 0.0], [-1.0, 0.5, 0.0], ORIGIN, [0.0, 1.0, 0.0]];
    let degenerate = HingeAngle::<f64>::new().hessian(&on_edge);
    assert_eq!((degenerate.value, degenerate.gradient, degenerate.flags.degenerate), (0.0, [ORIGIN; 4], true));
    assert!(degenerate.hessian.as_flattened().as_flattened().iter().all(|h| *h == 0.0));
    let at_rest = BridsonBending::new(2.0, 0.0).gradient(&flat);
    assert_eq!((at_rest.value, at_rest.gradient), (0.0, [ORIGIN; 4]));
}

#[test]
fn hair_is_exact_when_straight_and_flagged_without_a_segment() {
    let straight = HairBend::new(2.0).gradient(&[[-0.5, -0.25, -1.0], ORIGIN, [1.0, 0.5, 2.0]]);
    assert_eq!((straight.value, straight.gradient), (0.0, [ORIGIN; 3]));
    let reversed = HairBend::new(2.0).gradient(&[[0.5, 0.25, 1.0], ORIGIN, [1.0, 0.5, 2.0]]);
    assert_eq!((reversed.value, reversed.gradient), (2.0, [ORIGIN; 3]));
    assert!(HairBend::new(2.0).value(&[ORIGIN, ORIGIN, [1.0, 0.5, 2.0]]).flags.degenerate);
}

#[test]
fn springs_pull_by_hookes_law() {
    let x = [ORIGIN, [3.0, 0.0, 4.0]];
    let hooke = HookeSpring::new(10.0, 4.5).gradient(&x);
    assert_eq!(hooke.value, 1.25);
    assert_eq!(
        hooke.gradient[0].map(|g| (g * 1e12).round() / 1e12),
        [-3.0, 0.0, -4.0],
        "K (PQ − L P̂Q) pulls P towards Q"
    );
    let witkin = Spring::new(4.5, 10.0, 2.0).force(&x, &[ORIGIN, [1.0, 1.0, 0.0]]).force[0];
    // k_s C + k_d n·v = 5 + 2 · 0.6, along the spring.
    for (found, expected) in witkin.iter().zip([6.2 * 0.6, 0.0, 6.2 * 0.8]) {
        assert!((found - expected).abs() < 1e-14);
    }
    let zero = ZeroLengthSpring::new(2.0, 0.5).force(&x, &[ORIGIN, [0.0, 4.0, 0.0]]).force;
    assert_eq!(zero, [[6.0, 2.0, 8.0], [-6.0, -2.0, -8.0]]);
}

#[test]
fn membranes_stretch_and_refuse_a_flat_rest_shape() {
    let (mu, lambda, strain) = (3.0, 5.0, 0.25);
    let sheet = StVK::new([0.0, 0.0], [1.0, 0.0], [0.0, 1.0], lambda, mu).unwrap();
    let at = sheet.value(&[ORIGIN, [1.0 + strain, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    let green = strain + strain * strain / 2.0;
    assert_eq!(at.value, 0.5 * (mu + lambda / 2.0) * green * green);
    assert!(StVK::new([0.0, 0.0], [1.0, 0.0], [2.0, 0.0], lambda, mu).is_err());
    // Rotated by the angle of the 3-4-5 triangle, whose edges are exact, it is exactly at rest.
    let sheet = StVK::new([0.0, 0.0], [5.0, 0.0], [0.0, 5.0], lambda, mu).unwrap();
    let turned = sheet.gradient(&[ORIGIN, [3.0, 4.0, 0.0], [-4.0, 3.0, 0.0]]);
    assert_eq!((turned.value, turned.gradient), (0.0, [ORIGIN; 3]));
}

/// The energies of a tetrahedron of volume 1/6 with the gradient F of its deformation.
fn solids(f: [[f64; 3]; 3], lambda: f64, mu: f64) -> [energy_dsl::Gradient<f64, [[f64; 3]; 4]>; 4] {
    let corners = [ORIGIN, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let [a, b, c, d] = corners;
    let moved = corners.map(|p| [0, 1, 2].map(|i| 0.5 + f[i][0] * p[0] + f[i][1] * p[1] + f[i][2] * p[2]));
    [
        TetStVK::new(a, b, c, d, lambda, mu).unwrap().gradient(&moved),
        TetStableNeoHookean::new(a, b, c, d, lambda, mu).unwrap().gradient(&moved),
        TetAsRigidAsPossible::new(a, b, c, d, mu).unwrap().gradient(&moved),
        TetCorotational::new(a, b, c, d, lambda, mu).unwrap().gradient(&moved),
    ]
}

#[test]
fn solids_have_the_energy_of_their_deformation() {
    let (lambda, mu) = (5.0, 3.0);
    let alpha = 1.0 + 0.75 * mu / lambda;
    let diagonal = |x: f64, y: f64, z: f64| [[x, 0.0, 0.0], [0.0, y, 0.0], [0.0, 0.0, z]];
    let shear = [[1.0, 0.5, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    // F, ‖E‖², tr E, I and J.
    for (f, square, trace, i, j) in [
        (diagonal(2.0, 1.0, 1.0), 2.25, 1.5, 6.0, 2.0),
        (diagonal(0.5, 1.0, 1.0), 0.140_625, -0.375, 2.25, 0.5),
        (shear, 0.140_625, 0.125, 3.25, 1.0),
        // Flat, and inverted.
        (diagonal(0.0, 1.0, 1.0), 0.25, -0.5, 2.0, 0.0),
        (diagonal(-1.0, 1.0, 1.0), 0.0, 0.0, 3.0, -1.0),
        (diagonal(-2.0, 1.0, 1.0), 2.25, 1.5, 6.0, -2.0),
    ] {
        let [stvk, stable, ..] = solids(f, lambda, mu);
        let expected = (mu * square + lambda / 2.0 * trace * trace) / 6.0;
        assert!((stvk.value - expected).abs() < 1e-14, "{f:?}: {} is not {expected}", stvk.value);
        let volumetric = lambda / 2.0 * ((j - alpha).powi(2) - (1.0 - alpha).powi(2));
        let expected: f64 = (mu / 2.0 * (i - 3.0) - mu / 2.0 * f64::ln((i + 1.0) / 4.0) + volumetric) / 6.0;
        assert!((stable.value - expected).abs() < 1e-14, "{f:?}: {} is not {expected}", stable.value);
        assert!(!stvk.flags.any() && !stable.flags.any());
        // Uniaxial stress P = ∂Ψ/∂F₁₁ pulls the second corner.
        if f == diagonal(2.0, 1.0, 1.0) {
            let [stvk, stable] = [stvk.gradient[1][0], stable.gradient[1][0]].map(|force| 6.0 * force);
            assert!((stvk - 2.0 * (2.0 * mu * 1.5 + lambda * 1.5)).abs() < 1e-13);
            assert!((stable - (mu * 2.0 * (1.0 - 1.0 / 7.0) + lambda * (2.0 - alpha))).abs() < 1e-13);
        }
    }
    let turned = solids([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]], lambda, mu);
    for at in &turned[..2] {
        assert_eq!((at.value, at.gradient), (0.0, [ORIGIN; 4]), "turned by a right angle, at rest");
    }
    for at in &turned[2..] {
        assert!(at.value < 1e-30 && at.gradient.iter().flatten().all(|f| f.abs() < 1e-14), "at rest: {at:?}");
    }
    // Signed singular values: those of the shear are the roots of s² − √(17/4) s + 1 = 0, and 1.
    let shear_sum = 4.25_f64.sqrt();
    for (f, square, trace) in [
        (diagonal(2.0, 1.0, 1.0), 1.0, 1.0),
        (diagonal(0.5, 3.0, 1.25), 0.25 + 4.0 + 0.0625, 1.75),
        (diagonal(0.0, 1.0, 1.0), 1.0, -1.0),
        (diagonal(-0.5, 1.0, 2.0), 2.25 + 1.0, -0.5),
        // The smallest one has the sign of det F.
        (diagonal(-2.0, 1.0, 1.5), 1.0 + 4.0 + 0.25, -0.5),
        (shear, 3.25 - 2.0 * (shear_sum + 1.0) + 3.0, shear_sum - 2.0),
    ] {
        let [.., rigid, corotational] = solids(f, lambda, mu);
        let expected = mu / 12.0 * square;
        assert!((rigid.value - expected).abs() < 1e-14, "{f:?}: {} is not {expected}", rigid.value);
        let expected = (mu * square + lambda / 2.0 * trace * trace) / 6.0;
        assert!((corotational.value - expected).abs() < 1e-14, "{f:?}: {} is not {expected}", corotational.value);
        assert!(!rigid.flags.any() && !corotational.flags.any(), "{f:?}");
    }
    // A reflection has no rotation. The energy is that of its neighbours, (−1 − 1)² for one axis.
    let [.., rigid, corotational] = solids(diagonal(1.0, 1.0, -1.0), lambda, mu);
    assert!(rigid.flags.degenerate && corotational.flags.degenerate);
    assert!((rigid.value - mu / 3.0).abs() < 1e-14, "{}", rigid.value);
    assert_eq!(rigid.gradient, [ORIGIN; 4]);
    // An inverted and a flat rest shape.
    let [a, b, c, d] = [ORIGIN, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    assert!(TetStVK::new(a, c, b, d, lambda, mu).is_err() && TetStVK::new(a, b, c, c, lambda, mu).is_err());
    assert!(TetStableNeoHookean::new(a, c, b, d, lambda, mu).is_err());
}

#[test]
fn weight_and_drag() {
    let weight = Gravity::new(2.0, [0.0, 0.0, -9.81]).hessian(&[[1.0, 2.0, 3.0]]);
    assert_eq!((weight.value, weight.gradient[0]), (2.0 * 9.81 * 3.0, [0.0, 0.0, 2.0 * 9.81]));
    let drag = ViscousDrag::new(0.5).jacobians(&[ORIGIN], &[[2.0, 0.0, -4.0]]);
    assert_eq!((drag.force[0], drag.by_velocity[0][1]), ([-1.0, 0.0, 2.0], [0.0, -0.5, 0.0]));
}

/// The properties that solvers rely on are proved on the expression graph.
#[test]
fn declarations_say_what_solvers_may_skip() {
    for (name, curved, velocity_dependent, symmetric) in [
        ("Gravity", false, false, true),
        ("StVK", true, false, true),
        ("ViscousDrag", false, true, true),
        ("ZeroLengthSpring", true, true, true),
        ("Spring", true, true, false),
        ("BridsonForce", true, false, false),
        ("BridsonForceDamped", true, true, false),
    ] {
        let declaration = catalogue::find(name).unwrap().declaration;
        let found = (declaration.curved, declaration.velocity_dependent, declaration.symmetric);
        assert_eq!(found, (curved, velocity_dependent, symmetric), "{name}");
    }
}
