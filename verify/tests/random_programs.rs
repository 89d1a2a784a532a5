//! Random well-typed programs: the compiled routines agree with hyper-dual and multi-precision numbers run through the
//! text, for every routine and on both paths.
//!
//! `PROPTEST_CASES=10000 cargo test --release -p verify --test all random_programs::` is the long run.

use energy_compiler::{Interpreted, Listing, Path, Textbook};
use energy_dsl::Inputs;
use proptest::prelude::*;
use verify::{Sample, multiprecision};

use super::bound_names::unbound;
use super::dual::Hyper;

/// Three points, two scalars and a vector.
const SIGNATURE: &str = "p, q, r: Point; k, L: Scalar, u: Vec3";

/// Generates a scalar expression.
fn scalar(depth: u32) -> BoxedStrategy<String> {
    let leaf = prop_oneof![
        Just("k".to_owned()),
        Just("L".to_owned()),
        (1..40_u8).prop_map(|n| format!("{}.{}", n / 10, n % 10)),
        vector(0).prop_map(|v| format!("norm_squared({v})")),
        vector(0).prop_map(|v| format!("norm({v})")),
        (vector(0), vector(0)).prop_map(|(a, b)| format!("dot({a}, {b})")),
    ];
    if depth == 0 {
        return leaf.boxed();
    }
    let less = || scalar(depth - 1);
    let vectors = || vector(depth - 1);
    prop_oneof![
        1 => leaf,
        2 => (less(), less()).prop_map(|(a, b)| format!("({a} + {b})")),
        2 => (less(), less()).prop_map(|(a, b)| format!("({a} - {b})")),
        3 => (less(), less()).prop_map(|(a, b)| format!("({a} * {b})")),
        1 => (less(), less()).prop_map(|(a, b)| format!("({a} / (1 + ({b})^2))")),
        1 => less().prop_map(|a| format!("sqrt(1 + ({a})^2)")),
        1 => less().prop_map(|a| format!("sin({a})")),
        1 => less().prop_map(|a| format!("cos({a})")),
        1 => less().prop_map(|a| format!("exp(-({a})^2)")),
        1 => less().prop_map(|a| format!("log(1 + ({a})^2)")),
        1 => (less(), less()).prop_map(|(a, b)| format!("atan2({a}, 2 + ({b})^2)")),
        1 => less().prop_map(|a| format!("pseudo_huber({a}, 0.7)")),
        1 => less().prop_map(|a| format!("(1 - cos({a}))")),
        1 => (less(), less()).prop_map(|(a, b)| format!("(if {a} < {b} {{ {a} * {b} }} else {{ {b} - {a} }})")),
        1 => (less(), 2..4_u8).prop_map(|(a, n)| format!("({a})^{n}")),
        1 => (less(), less()).prop_map(|(a, b)| format!("computed_as(({a})^2 - ({b})^2, ({a} - {b}) * ({a} + {b}))")),
        1 => (less(), less()).prop_map(|(a, b)| format!("valued_as(({a})^2 - ({b})^2, ({a} - {b}) * ({a} + {b}))")),
        2 => (vectors(), vectors()).prop_map(|(a, b)| format!("dot({a}, {b})")),
        // Exclude vectors that are zero or parallel up to rounding: lengths and angles have no derivatives there.
        1 => vectors().prop_map(|a| format!("dot(unit(q - p), unit({a} + 2 * u))")),
        1 => vectors().prop_map(|a| format!("(1 - dot(unit({a} + 2 * u), unit(r - q)))")),
        1 => vectors().prop_map(|v| format!("(norm({v} + 2 * u) - L)")),
        1 => vectors().prop_map(|v| format!("(norm({v} + 2 * u) - L)^2")),
        1 => vectors().prop_map(|v| format!("norm({v} + 2 * u)^1.5")),
        1 => vectors().prop_map(|a| format!("angle(q - p, {a} + 2 * u)")),
        1 => (vectors(), vectors(), vectors()).prop_map(|(a, b, c)| format!("det(columns({a}, {b}, {c}))")),
        1 => (vectors(), vectors())
            .prop_map(|(a, b)| format!("trace(transpose(columns({a}, {b})) * columns({a}, {b}))")),
    ]
    .boxed()
}

/// Generates a vector expression.
fn vector(depth: u32) -> BoxedStrategy<String> {
    let leaf = prop_oneof![
        3 => Just("(q - p)".to_owned()),
        3 => Just("(r - q)".to_owned()),
        1 => Just("(p - r)".to_owned()),
        1 => Just("p".to_owned()),
        1 => Just("u".to_owned()),
    ];
    if depth == 0 {
        return leaf.boxed();
    }
    let less = || vector(depth - 1);
    prop_oneof![
        2 => leaf,
        1 => (less(), less()).prop_map(|(a, b)| format!("({a} + {b})")),
        1 => (less(), less()).prop_map(|(a, b)| format!("cross({a}, {b})")),
        1 => (scalar(depth - 1), less()).prop_map(|(s, a)| format!("({s} * {a})")),
        1 => less().prop_map(|a| format!("unit({a} + 2 * u)")),
    ]
    .boxed()
}

/// Computes U, ∇U and the triangle of ∇²U, as the routine returns it, by hyper-dual numbers.
fn expected(textbook: &Textbook, parameters: &[f64], x: &[f64]) -> [Vec<f64>; 3] {
    let constants: Vec<Hyper> = parameters.iter().map(|&p| Hyper::constant(p)).collect();
    let at = |i: usize, j: usize| {
        let positions: Vec<Hyper> = x.iter().enumerate().map(|(c, &x)| Hyper::variable(x, c == i, c == j)).collect();
        textbook.evaluate(&Inputs { parameters: &constants, rest: &[], positions: &positions, velocities: &[] })[0].0
    };
    let gradient: Vec<f64> = (0..9).map(|i| at(i, i).eps1).collect();
    let mut triangle = Vec::with_capacity(54);
    for i in 0..3 {
        for j in i..3 {
            triangle.extend((0..9).map(|e| at(3 * i + e / 3, 3 * j + e % 3).eps1eps2));
        }
    }
    [vec![at(0, 0).re], gradient, triangle]
}

/// Computes the same blocks in multi-precision, to 30 digits; `None` if the formula divides by zero.
fn true_blocks(source: &str, textbook: &Textbook, parameters: &[f64], x: &[f64]) -> Option<[Vec<f64>; 3]> {
    let sample = Sample { parameters: parameters.into(), rest: vec![], positions: x.into(), velocities: vec![] };
    let element = Interpreted::from_source(source).ok()?.swap_remove(0);
    let blocks = multiprecision::truth(element.declaration(), textbook, &sample, 30);
    let numbers = |k: usize| blocks[k].block.numbers.iter().map(multiprecision::Big::to_f64).collect::<Vec<f64>>();
    let [value, gradient, hessian] = [numbers(0), numbers(1), numbers(2)];
    let mut triangle = Vec::with_capacity(54);
    for i in 0..3 {
        for j in i..3 {
            triangle.extend((0..9).map(|e| hessian[9 * (3 * i + e / 3) + 3 * j + e % 3]));
        }
    }
    blocks.iter().all(|b| b.is_defined).then_some([value, gradient, triangle])
}

fn largest(numbers: &[f64]) -> f64 {
    numbers.iter().fold(0.0, |largest, n| largest.max(n.abs()))
}

fn source_of(formula: &str) -> String {
    format!("energy Random({SIGNATURE}) {{ {formula} + 0 * (k + L + dot(u, p - q) + dot(u, r)) }}")
}

/// Replaces differences of points by weighted sums.
fn of_sums(formula: &str) -> String {
    let sums = [
        ("(q - p)", "((p + q + r) / 3 - p)"),
        ("(r - q)", "(0.2113248654051871 * q - r + 0.7886751345948129 * p)"),
        ("(p - r)", "((q - p) / 6 + 0.2113248654051871 * q - 4/3 * r + 0.7886751345948129 * p + (p + q) / 6 + u)"),
    ];
    sums.into_iter().fold(formula.to_owned(), |formula, (difference, sum)| formula.replace(difference, sum))
}

fn check(formula: &str, parameters: &[f64], x: &[f64]) -> Result<(), TestCaseError> {
    let source = source_of(formula);
    let textbook = Textbook::from_source(&source).map_err(|e| TestCaseError::fail(format!("{source}: {e}")))?;
    let listing = Listing::from_source(&source).map_err(|e| TestCaseError::fail(format!("{source}: {e}")))?.remove(0);
    let by_duals = expected(&textbook, parameters, x);
    prop_assume!(by_duals.iter().flatten().all(|n| n.is_finite() && n.abs() < 1e30));
    let truth = true_blocks(&source, &textbook, parameters, x);
    prop_assume!(truth.is_some());
    let truth = truth.expect("just seen");
    prop_assume!(truth.iter().flatten().all(|n| n.is_finite() && n.abs() < 1e30));
    // The tolerance is the effect of changing the last digits of the inputs.
    let moved: Vec<f64> = x.iter().enumerate().map(|(i, x)| x * (1.0 + (i as f64 - 4.5) * 2e-15)).collect();
    let nearby = expected(&textbook, parameters, &moved);
    prop_assume!(nearby.iter().flatten().all(|n| n.is_finite()));
    let inputs = Inputs { parameters, rest: &[], positions: x, velocities: &[] };
    // Flagged results are conventions without a value in the text.
    prop_assume!(listing.is_flagged("hessian", &inputs) == Some(false));
    for path in [Path::Chosen, Path::General] {
        for (routine, blocks) in [("value", 1), ("gradient", 2), ("hessian", 3)] {
            let found = listing.evaluate(routine, path, &inputs).expect("an energy has it");
            for (((found, by_duals), truth), nearby) in
                found.iter().zip(&by_duals).zip(&truth).zip(&nearby).take(blocks)
            {
                let sensitivity = truth.iter().zip(nearby).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                // A kink or jump between the two inputs leaves no derivative to compare.
                prop_assume!(sensitivity <= 1e-3 * largest(truth) || largest(truth) < 1e-12);
                // Inputs are about 1: cancellation leaves their rounding errors.
                let bound = 1e-10 * largest(truth) + 1e4 * sensitivity + 1e-12;
                for (entry, ((a, b), c)) in found.iter().zip(truth).zip(by_duals).enumerate() {
                    prop_assert!(
                        (a - b).abs() <= bound && (a - c).abs() <= bound,
                        "{source}\n{routine} on the path {path:?}, entry {entry}: {a:e}, truly {b:e}, \
                         by dual numbers {c:e}, bound {bound:e}"
                    );
                }
            }
        }
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: std::env::var("PROPTEST_CASES").ok().and_then(|cases| cases.parse().ok()).unwrap_or(512),
        failure_persistence: None,
        max_global_rejects: 100_000,
        ..ProptestConfig::default()
    })]

    #[test]
    fn compiled_programs_agree_with_dual_numbers_and_with_the_truth(
        formula in (1..4_u32).prop_flat_map(scalar),
        parameters in prop::collection::vec(0.2..1.8_f64, 5),
        x in prop::collection::vec(-1.0..1.0_f64, 9),
    ) {
        check(&formula, &parameters, &x)?;
    }

    /// Points that enter through weighted sums: one with weights that are fractions, one with others, and one that
    /// depends on both.
    #[test]
    fn compiled_programs_of_sums_of_points_agree_too(
        formula in (1..4_u32).prop_flat_map(scalar),
        parameters in prop::collection::vec(0.2..1.8_f64, 5),
        x in prop::collection::vec(-1.0..1.0_f64, 9),
    ) {
        check(&of_sums(&formula), &parameters, &x)?;
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn code_of_random_programs_binds_its_names(formula in (1..4_u32).prop_flat_map(scalar)) {
        for formula in [of_sums(&formula), formula] {
            let listings = Listing::from_source(&source_of(&formula)).map_err(|e| TestCaseError::fail(e.to_string()))?;
            prop_assert_eq!(unbound(&listings[0]), [""; 0], "{}", formula);
        }
    }
}

/// The comparison notices an error of the size that it should.
#[test]
fn a_wrong_derivative_is_noticed() {
    let source = format!("energy Random({SIGNATURE}) {{ k * L * dot(u, q - p) * norm(r - q) }}");
    let listing = Listing::from_source(&source).unwrap().remove(0);
    let other = Textbook::from_source(&source.replace("norm(r - q)", "norm(r - q)^1.000001")).unwrap();
    let (parameters, x) = ([1.1, 0.7, 0.3, 0.4, 0.5], [0.1, 0.2, 0.3, 0.9, 0.4, 0.1, 0.3, 0.8, 0.6]);
    let inputs = Inputs { parameters: &parameters, rest: &[], positions: &x, velocities: &[] };
    let found = listing.evaluate("hessian", Path::Chosen, &inputs).unwrap();
    let wrong = expected(&other, &parameters, &x);
    let difference = found[2].iter().zip(&wrong[2]).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(difference > 1e-10 * largest(&wrong[2]) * 100.0, "{difference}");
}
