//! Twists, their exponential and the blend of four motions, compared with multi-precision values.

use energy_dsl::energy;
use energy_dsl::{Element, Residual};
use energy_elements::PointToPlane;

energy! {
    residual Exponential(ξ: Twist) {
        let q = exp(ξ);
        [real(q).w, imaginary(real(q)), dual(q).w, imaginary(dual(q))]
    }
}

/// Returns name and numbers of the records whose name starts with `prefix`.
fn records(prefix: &str) -> Vec<(&'static str, Vec<f64>)> {
    let text = include_str!("data/rigid_motions.txt");
    let records = text.lines().filter(|line| line.starts_with(prefix)).map(|line| {
        let (name, numbers) = line.split_once(' ').unwrap();
        (name, numbers.split(' ').map(|n| n.parse().unwrap()).collect())
    });
    records.collect()
}

/// Returns the largest error relative to the largest entry, in units of roundoff.
fn error(found: &[f64], truth: &[f64]) -> f64 {
    assert_eq!(found.len(), truth.len());
    let size = truth.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    let worst = found
        .iter()
        .zip(truth)
        .map(|(f, t)| (f - t).abs())
        .fold(0.0_f64, |m, e| if e > m || e.is_nan() { e } else { m });
    worst / size / (f64::EPSILON / 2.0)
}

#[test]
fn the_exponential_is_accurate_down_to_no_rotation_at_all() {
    let records = records("exp");
    assert!(records.len() >= 10, "{} records", records.len());
    for (name, numbers) in records {
        let (twist, truth) = numbers.split_at(6);
        let at = Exponential::<f64>::new().jacobian(twist.try_into().unwrap());
        assert!(!at.flags.any(), "{name}");
        // Rounding ‖θ‖ limits the accuracy of the argument of sine and cosine.
        let angle = twist[..3].iter().fold(1.0_f64, |m, x| m.max(x.abs()));
        assert!(error(&at.value, &truth[..8]) <= 6.0 * angle, "{name}: value {:.1} u", error(&at.value, &truth[..8]));
        let jacobian = error(&at.jacobian, &truth[8..]);
        assert!(jacobian <= 6.0 * angle, "{name}: Jacobian {jacobian:.1} u");
    }
}

#[test]
fn a_blend_of_four_motions_is_accurate() {
    let records = records("nonrigid");
    assert!(records.len() >= 2, "{} records", records.len());
    for (name, numbers) in records {
        let vector = |at: usize| std::array::from_fn(|i| numbers[at + i]);
        let element = PointToPlane::new(std::array::from_fn(|i| numbers[24 + i]), vector(28), vector(31), vector(34));
        let at = element.jacobian(numbers[..24].try_into().unwrap());
        // The residual is a difference of lengths of order 1.
        assert!((at.value[0] - numbers[37]).abs() <= 8.0 * f64::EPSILON, "{name}: {} for {}", at.value[0], numbers[37]);
        let jacobian = error(&at.jacobian, &numbers[38..]);
        assert!(jacobian <= 24.0, "{name}: Jacobian {jacobian:.1} u");
    }
}

/// Shared subexpressions show in the counts: a twist needs at most one sine, one cosine and one division, its angle one
/// root. The ordinary path at small angles may need none of them.
#[test]
fn an_exponential_needs_at_most_one_sine_one_cosine_and_one_division() {
    for routine in Exponential::<f64>::DECLARATION.routines.iter() {
        let (transcendental, divisions) = (routine.full.transcendental, routine.full.divisions_and_roots);
        assert!(transcendental <= 2 && divisions <= 2, "{}: {transcendental}, {divisions}", routine.name);
    }
}
