//! Spellings that cancel near a point, against multi-precision: functions minus the head of their Taylor series over
//! powers, and the curvature of rods near a fold.

use energy_compiler::{Interpreted, Textbook};
use energy_dsl::Inputs;
use verify::Sample;
use verify::multiprecision::truth;

/// Formulas of x with their values, first and second derivatives at 0.
const REMAINDERS: &[(&str, [f64; 3])] = &[
    ("(exp(x) - 1) / x", [1.0, 0.5, 1.0 / 3.0]),
    ("(exp(x) - 1 - x) / x^2", [0.5, 1.0 / 6.0, 1.0 / 12.0]),
    ("(k * exp(x) - k * x - k) / (k * x^2)", [0.5, 1.0 / 6.0, 1.0 / 12.0]),
    ("(exp(-x) - 1 + x) * x^(-2)", [0.5, -1.0 / 6.0, 1.0 / 12.0]),
    ("(exp(x) - (1 + x + x^2/2)) / x^3", [1.0 / 6.0, 1.0 / 24.0, 1.0 / 60.0]),
    ("sin(x) / x", [1.0, 0.0, -1.0 / 3.0]),
    ("sin(2 * x) / x", [2.0, 0.0, -8.0 / 3.0]),
    ("(sin(x) - x) / x^3", [-1.0 / 6.0, 0.0, 1.0 / 60.0]),
    ("(x - sin(x)) / x^3", [1.0 / 6.0, 0.0, -1.0 / 60.0]),
    ("(sin(x) - x + x^3/6) / x^5", [1.0 / 120.0, 0.0, -1.0 / 2520.0]),
    ("(1 - cos(x)) / x^2", [0.5, 0.0, -1.0 / 12.0]),
    ("(cos(x) - 1) / x^2", [-0.5, 0.0, 1.0 / 12.0]),
    ("(cos(x) - 1 + x^2/2) / x^4", [1.0 / 24.0, 0.0, -1.0 / 360.0]),
    ("log(1 + x) / x", [1.0, -0.5, 2.0 / 3.0]),
    ("(x - log(1 + x)) / x^2", [0.5, -1.0 / 3.0, 0.5]),
    ("(log(1 + x) - x + x^2/2) / x^3", [1.0 / 3.0, -0.25, 0.4]),
    ("(1 - exp(-x) * (1 + x)) / x^2", [0.5, -1.0 / 3.0, 0.25]),
    ("(1 - exp(-x) - x * exp(-x)) / x^2", [0.5, -1.0 / 3.0, 0.25]),
    ("(k * exp(x) * (1 - x) - k) / (k * x^2)", [-0.5, -1.0 / 3.0, -0.25]),
    ("(1 - exp(-x) * (1 + x + x^2/2 + x^3/6)) / x^3", [0.0, 1.0 / 24.0, -1.0 / 15.0]),
    (
        "(1 - exp(-x) * (1 + x + x^2/2 + x^3/6 + x^4/24 + x^5/120 + x^6/720)) / x^7",
        [1.0 / 5040.0, -1.0 / 5760.0, 1.0 / 6480.0],
    ),
    ("1 - exp(-x) * (1 + x/2)", [0.0, 0.5, 0.0]),
    ("1 - exp(-x) * (1 + x - x^2/2)", [0.0, 0.0, 2.0]),
    ("(1 - exp(-x) * (1 - x/2)) / x", [1.5, -1.0, 5.0 / 6.0]),
    ("k * (exp(x) - 1 + 2 * x * cos(x)) / (k * x)", [3.0, 0.5, -5.0 / 3.0]),
    // The cosine has no zero at 0, but x itself cancels.
    ("x * cos(2 * x) / (2 * x)", [0.5, 0.0, -2.0]),
    ("x^3 * (2 + x) / (k * x^2)", [0.0, 1.0, 1.0]),
    ("exp(x) - 1 - x", [0.0, 0.0, 1.0]),
    ("cos(x) - 1 + x^2/2", [0.0, 0.0, 0.0]),
];

/// Errors of value, first and second derivatives in units of roundoff.
const BOUNDS: [f64; 3] = [4.0, 8.0, 32.0];

fn declared(formula: &str) -> String {
    format!("energy Remainder(p: Point; k: Scalar) {{ let x = p.x; {formula} + 0 * k }}")
}

/// Returns value and derivatives by x.
fn computed(element: &Interpreted, x: f64) -> [f64; 3] {
    let inputs = Inputs { parameters: &[2.0], rest: &[], positions: &[x, 0.0, 0.0], velocities: &[] };
    let outputs = element.evaluate(&inputs).expect("no rest shape");
    assert!(!outputs.flags.iter().any(|flags| flags.any()), "flagged at {x:e}");
    [0, 1, 2].map(|block| outputs.blocks[block].1[0])
}

#[test]
fn remainders_keep_their_digits() {
    let mut arguments: Vec<f64> =
        vec![1e-6, 1e-3, 0.03, 0.4, 0.9, 1.1, 1.9, 2.1, 2.9, 3.1, 3.9, 4.1, 5.1, 6.1, 8.0, 10.0];
    arguments.extend(arguments.clone().into_iter().map(|x| -x));
    for (formula, at_zero) in REMAINDERS {
        let source = declared(formula);
        let element = Interpreted::from_source(&source).expect("a sound program").remove(0);
        let textbook = Textbook::from_source(&source).expect("a sound program");
        for &x in arguments.iter().filter(|&&x| x > -1.0 || !formula.contains("log")) {
            let found = computed(&element, x);
            let positions = vec![x, 0.0, 0.0];
            let sample = Sample { parameters: vec![2.0], rest: vec![], positions, velocities: vec![] };
            let exact = truth(element.declaration(), &textbook, &sample, 40);
            let scale = |order: usize| exact[order].block.numbers[0].to_f64().abs();
            for (order, bound) in BOUNDS.into_iter().enumerate() {
                let error = exact[order].block.numbers[0].error_of(found[order]);
                // A derivative that changes its sign is compared with the one before it.
                let size = scale(order).max(if order > 0 { scale(order - 1) / 16.0 } else { 0.0 });
                let error = error / size / (f64::EPSILON / 2.0);
                assert!(error <= bound, "{formula} at {x}: derivative {order} is {error} u wrong");
            }
        }
        for x in [0.0, 1e-300, -1e-300, 1e-150, -1e-17] {
            for (found, expected) in computed(&element, x).into_iter().zip(at_zero) {
                let size = expected.abs().max(at_zero[2].abs()).max(1e-3);
                assert!((found - expected).abs() <= 1e-15 * size + x.abs(), "{formula} at {x:e}: {found}, {expected}");
            }
        }
    }
}

/// The curvature κb = 2 a×b/(‖a‖‖b‖ + a·b) of a discrete rod, and its counterpart at straight rods.
#[test]
fn lengths_and_inner_products_keep_their_digits_at_folds() {
    for (formula, sign) in [
        ("{ let κ = 2 * cross(a, b) / (norm(a) * norm(b) + dot(a, b)); k * dot(κ, κ) }", -1.0),
        ("{ let κ = 2 * cross(a, b) / (dot(a, b) + norm(a) * norm(b)); k * norm(κ) }", -1.0),
        ("k * (norm(a) * norm(b) - dot(a, b))", 1.0),
        ("k * (dot(b, a) - norm(b) * norm(a))^2", 1.0),
    ] {
        let source = format!("energy Rod(p, q, r: Point; k: Scalar) {{ let a = q - p; let b = r - q; {formula} }}");
        let element = Interpreted::from_source(&source).expect("a sound program").remove(0);
        let textbook = Textbook::from_source(&source).expect("a sound program");
        for fold in [1.0, 1e-2, 1e-4, 1e-8, 1e-12] {
            let positions = vec![0.25, 0.0, 0.0, 1.25, 0.0, 0.0, 1.25 + 1.5 * sign, 1.25 * fold, 0.375 * fold];
            let sample =
                Sample { parameters: vec![2.0], rest: vec![], positions: positions.clone(), velocities: vec![] };
            let inputs = Inputs { parameters: &[2.0], rest: &[], positions: &positions, velocities: &[] };
            let found = element.evaluate::<f64>(&inputs).expect("no rest shape");
            let exact = truth(element.declaration(), &textbook, &sample, 40);
            for (exact, (name, numbers)) in exact.iter().zip(&found.blocks) {
                let error = exact.error_in_roundoffs(numbers);
                assert!(error <= 32.0, "{formula} at a fold of {fold}: {name} is {error} u wrong");
            }
            assert!(!found.flags.iter().any(|flags| flags.any()), "{formula} at {fold}: flagged");
        }
    }
}
