//! Every result of every function is finite or flagged, whatever the sizes of arguments and slopes.
//!
//! `RANGE_INPUTS=200 cargo test --release -p energy-compiler --test all range:: -- --nocapture` tries that number of
//! inputs for each formula.

use energy_compiler::{Interpreted, functions};
use energy_runtime::{Float, Inputs, Mask};

use crate::random::Random;

/// Calls of a function `f` with a scalar result.
const CALLS: [&str; 9] = [
    "f(x)",
    "f(x, 0.7)",
    "f(0.7, x)",
    "f(vector(x, p.y, 1))",
    "f(vector(x, p.y, 1), vector(1, x, 2))",
    "norm(f(vector(x, p.y, 1)))",
    "dot(f(vector(x, p.y, 1), vector(1, x, 2)), p)",
    "f(columns(vector(x, p.y, 1), vector(1, x, 2), vector(0, 1, x)))",
    "ddot(f(columns(vector(x, p.y, 1), vector(1, x, 2), vector(0, 1, x))), identity(3))",
];
/// Expressions of one variable and a parameter.
const INNER: [&str; 6] = ["k * p.x", "p.x / k", "k * p.x^2", "k * norm(p)", "1 + k * p.x", "k * (p.x - p.y)"];
/// Lengths, angles, areas and directions of up to four points.
const PRIMITIVES: [(&str, &str); 16] = [
    ("p, q", "(norm(p - q) - k)^2"),
    ("p, q, r, s", "norm(p - q)^(-12) - norm(r - s)^(-6)"),
    ("p, q", "norm(p - q)^2.5"),
    ("p, q, r, s", "log(norm(p - q) / norm(r - s))"),
    ("p, q, r, s", "dot(unit(p - q), unit(r - s))"),
    ("p, q, r", "norm_squared(unit(p - q) - unit(r - q))"),
    ("p, q, r, s", "angle(p - q, r - s)^2"),
    ("p, q, r", "tan(angle(p - q, r - q) / 2)^2"),
    ("p, q, r, s", "(dihedral(p, q, r, s) - k)^2"),
    ("p, q, r, s", "norm_squared(p - q) / norm(cross(q - p, r - p)) * dihedral(p, q, r, s)^2"),
    ("p, q, r, s", "tan(dihedral(p, q, r, s) / 2)^2"),
    ("p, q, r", "norm(cross(p - q, r - q) / (norm(p - q) * norm(r - q) + dot(p - q, r - q)))"),
    ("p, q, r, s", "(norm(p - q) + norm(q - r)) / norm(r - s)"),
    ("p, q, r, s", "abs(det(columns(p - s, q - s, r - s)))^0.5"),
    ("p, q, r, s", "dot(cross(p - q, r - q), s - q)^2 / norm_squared(cross(p - q, r - q))"),
    ("p, q, r, s", "sum(i in 0..3, singular_values(columns(p - s, q - s, r - s))[i])^2"),
];
/// Inputs of each formula in an ordinary run.
const INPUTS: usize = 3;

/// Returns 0, or a number of any sign and of a magnitude up to 10 to the power of `decades`.
fn number(random: &mut Random, decades: f64) -> f64 {
    let size = 10.0_f64.powf(decades * (random.below(2001) as f64 / 1000.0 - 1.0));
    match random.below(8) {
        0 => 0.0,
        1..4 => -size,
        _ => size,
    }
}

fn of_scalar(call: &str, inner: &str) -> String {
    format!("energy Ranged(p: Point; k: Scalar) {{ let x = {inner}; {call} + 0 * k }}")
}

fn of_points(points: &str, formula: &str) -> String {
    format!("energy Ranged({points}: Point; k: Scalar) {{ k * ({formula}) }}")
}

/// Returns the calls of all functions.
fn calls() -> Vec<String> {
    let is_name = |name: &str| name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
    let names = functions().map(|function| function.name).filter(|name| is_name(name));
    names.flat_map(|name| CALLS.map(|call| call.replace("f(", &format!("{name}(")))).collect()
}

/// Checks random inputs of up to some decades in one precision.
fn check<S: Float + Into<f64>>(element: &Interpreted, text: &str, decades: [f64; 3], seed: u64) {
    let count = std::env::var("RANGE_INPUTS").ok().and_then(|count| count.parse().ok()).unwrap_or(INPUTS);
    let coordinates = element.coordinates();
    let mut random = Random(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1);
    for decades in decades.into_iter().cycle().take(count) {
        let numbers: Vec<S> = (0..=coordinates).map(|_| S::from_f64(number(&mut random, decades))).collect();
        let inputs = Inputs { parameters: &numbers[..1], rest: &[], positions: &numbers[1..], velocities: &[] };
        for routine in ["value", "gradient", "hessian"] {
            let (blocks, flags) = element.routine(routine, &inputs).expect("no rest shape").expect("an energy");
            let is_finite = blocks.iter().flatten().all(|&number| Into::<f64>::into(number).is_finite());
            let is_flagged = (flags.degenerate | flags.kink).any();
            assert!(is_finite || is_flagged, "{text}: {routine} at {numbers:?}: {blocks:?}");
        }
    }
}

/// Checks the texts that compile, and returns their number.
fn check_all(texts: &[String]) -> usize {
    let mut formulas = 0;
    for (text, seed) in texts.iter().zip(0..) {
        let Ok(mut elements) = Interpreted::from_source(text) else { continue };
        let element = elements.remove(0);
        check::<f64>(&element, text, [300.0, 24.0, 60.0], seed);
        check::<f32>(&element, text, [37.0, 3.6, 9.0], seed);
        formulas += 1;
    }
    println!("{formulas} formulas");
    formulas
}

#[test]
fn results_of_functions_are_finite_or_flagged() {
    let extra = ["x^3", "abs(x)^2.5", "1 / (1 + x^2)", "x / (2 + x)"].map(str::to_owned);
    let calls: Vec<_> = calls().into_iter().chain(extra).collect();
    let texts: Vec<_> = calls.iter().flat_map(|call| INNER.map(|inner| of_scalar(call, inner))).collect();
    let formulas = check_all(&texts);
    assert!(formulas > 400, "{formulas} formulas have scalar results");
}

#[test]
fn results_of_primitives_are_finite_or_flagged() {
    let texts = PRIMITIVES.map(|(points, formula)| of_points(points, formula));
    assert_eq!(check_all(&texts), PRIMITIVES.len());
}
