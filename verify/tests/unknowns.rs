//! Declarations over all types of unknowns, with states: their audits, and laws that are special to rotations.

use energy_compiler::Interpreted;
use energy_dsl::{Inputs, Kind};
use verify::audit::{Options, Target, audit_all, describe_failure};
use verify::sample::Sampler;

const TEXT: &str = include_str!("unknowns.energy");

fn elements() -> Vec<Interpreted> {
    Interpreted::from_file(TEXT, "unknowns.energy").unwrap_or_else(|errors| panic!("{errors}"))
}

/// Every block equals multi-precision, dual numbers and differences, and every planted fault is noticed.
#[test]
fn audits_pass_and_notice_planted_faults() {
    let targets = Target::of_text(TEXT, "unknowns.energy").unwrap_or_else(|errors| panic!("{errors}"));
    assert!(targets.len() >= 40);
    let report = audit_all(&targets, None, Options { mutations: 12, ..Options::quick() });
    let failures: Vec<String> = report.failures().map(describe_failure).collect();
    assert!(failures.is_empty() && report.refused.is_empty(), "{}\n{:?}", failures.join("\n"), report.refused);
    for section in &report.sections {
        let score = section.mutations.as_ref().expect("faults were planted");
        let unnoticed: Vec<_> = score.mutants.iter().filter(|mutant| mutant.caught_by.is_empty()).collect();
        assert!(unnoticed.is_empty(), "{}: {unnoticed:?}", section.element);
        assert_eq!(section.without_differences, 0, "{}", section.element);
    }
}

/// The increment of a rotation takes no sine, cosine or root: exp has a polynomial in its place.
#[test]
fn increments_of_rotations_take_products_and_sums_only() {
    for name in ["Aim", "Arm", "BallJoint", "Anchor", "Align", "TorqueSquared"] {
        let elements = elements();
        let element = elements.iter().find(|element| element.declaration().name == name).unwrap();
        for routine in element.declaration().routines.iter() {
            let (roots, functions) = (routine.full.divisions_and_roots, routine.full.transcendental);
            assert_eq!((roots, functions), (0, 0), "{name}, {}", routine.name);
        }
    }
}

/// q and −q are the same rotation: a formula that rotates has the same bits.
#[test]
fn opposite_quaternions_give_the_same_bits() {
    for element in elements() {
        let declaration = element.declaration();
        let is_rotated = ["Aim", "Arm", "BallJoint", "Weld", "Anchor", "Axle", "Thrust", "Align", "TorqueSquared"];
        let is_rotated = [&is_rotated[..], &["Isotropic", "CosseratRod", "PoseGraph"]].concat();
        if !is_rotated.contains(&&*declaration.name) {
            continue;
        }
        let mut sampler = Sampler::new(declaration, 5);
        for _ in 0..10 {
            let sample = sampler.sample();
            let mut opposite = sample.clone();
            let mut first = 0;
            for field in declaration.points.iter() {
                if field.size == 4 {
                    opposite.positions[first..first + 4].iter_mut().for_each(|part| *part = -*part);
                }
                first += field.size;
            }
            let [here, there] = [&sample, &opposite].map(|sample| element.evaluate(&sample.inputs()).unwrap());
            for ((name, a), (_, b)) in here.blocks.iter().zip(&there.blocks) {
                let same = a.iter().zip(b).all(|(a, b)| a == b);
                assert!(same, "{}: {name}", declaration.name);
            }
        }
    }
}

/// A quaternion whose length differs from 1 by more than one part in a million is flagged.
#[test]
fn quaternions_of_another_length_are_flagged() {
    for element in elements() {
        let declaration = element.declaration();
        let Some(place) = declaration.points.iter().position(|field| field.size == 4 && field.increments() == 3) else {
            continue;
        };
        let first: usize = declaration.points[..place].iter().map(|field| field.size).sum();
        let sample = Sampler::new(declaration, 3).sample();
        for (factor, flagged) in [(1.0 + 1e-7, false), (1.0 + 2e-6, true), (0.5, true)] {
            let mut longer = sample.clone();
            longer.positions[first..first + 4].iter_mut().for_each(|part| *part *= factor);
            let outputs = element.evaluate(&longer.inputs()).unwrap();
            let orders = if declaration.kind == Kind::Residual { 0..2 } else { 0..3 };
            for order in orders {
                let flags = outputs.flags[order];
                assert_eq!(flags.degenerate, flagged, "{}, order {order}, {factor}", declaration.name);
            }
        }
    }
}

/// All right sides of `next` read the old state.
#[test]
fn a_state_goes_on_from_the_old_one() {
    let text = "energy Swap(x: Point; state a, b: Scalar) { next { a = b; b = a + x.x; } (a + b) * norm_squared(x) }";
    let swap = Interpreted::from_file(text, "swap").unwrap().remove(0);
    let inputs = Inputs { parameters: &[2.0, 5.0], rest: &[], positions: &[7.0, 0.0, 1.0], velocities: &[] };
    let (next, flags) = swap.routine("next", &inputs).unwrap().unwrap();
    assert_eq!((next, flags.any()), (vec![vec![5.0, 9.0]], false));
    let (jacobians, _) = swap.routine("next_jacobians", &inputs).unwrap().unwrap();
    assert_eq!(jacobians[1], [0.0, 0.0, 0.0, 1.0, 0.0, 0.0]);
    assert_eq!(jacobians[2], [0.0, 1.0, 1.0, 0.0]);
    let (slopes, _) = swap.routine("state_jacobian", &inputs).unwrap().unwrap();
    assert_eq!(slopes[1], [14.0, 14.0, 0.0, 0.0, 2.0, 2.0]);
}

/// log(q) is regular at the identity, keeps the digits of tiny turns, and is flagged at half a turn, where it jumps.
#[test]
fn rotation_vectors_are_regular_up_to_half_a_turn() {
    let element = Interpreted::from_source("residual Vector(q: Rotation) { log(q) }").unwrap().remove(0);
    let at = |q: [f64; 4]| {
        let inputs = Inputs { parameters: &[], rest: &[], positions: &q, velocities: &[] };
        let value = element.routine("residual", &inputs).unwrap().unwrap();
        let (jacobian, flags) = element.routine("jacobian", &inputs).unwrap().unwrap();
        (value.0[0].clone(), jacobian[1].clone(), value.1.degenerate || flags.degenerate)
    };
    for sign in [1.0, -1.0] {
        let (value, jacobian, flagged) = at([sign, 0.0, 0.0, 0.0]);
        assert_eq!((value, flagged), (vec![0.0; 3], false));
        assert_eq!(jacobian, [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
    }
    for angle in [1e-300, 1e-12, 1e-3, 1.5, 2.1, 3.1] {
        let half: f64 = angle / 2.0;
        let (value, _, flagged) = at([half.cos(), 0.6 * half.sin(), 0.0, -0.8 * half.sin()]);
        // The angle of rounded numbers: near half a turn, the cosine has its digits, and not the sine.
        let error = (value[0] / (0.6 * angle) - 1.0).abs().max((value[2] / (-0.8 * angle) - 1.0).abs());
        assert!(error < 1e-15 && value[1] == 0.0 && !flagged, "{angle}: {value:?}");
    }
    assert!(at([0.0, 1.0, 0.0, 0.0]).2);
}
