//! Means and other sums of points whose weights cancel are computed from differences of the points.

use energy_compiler::Interpreted;
use energy_runtime::tape::Column;

/// Formulas of four points and a number that no translation changes.
const FORMULAS: [&str; 9] = [
    "k * norm_squared(p - (a + b + c) / 3)",
    "let s = p - (a + b + c) / 3; k * norm_squared(s) + norm(b - a) * norm(c - a)",
    "let n = unit(cross(b - a, c - a)); k * norm_squared(p - (a + b + c) / 3 - dot(n, p - a) * n)",
    "k * (norm((p + a) / 2 - (b + c) / 2) - 0.3)^2",
    "k * norm_squared(0.375 * (a + b) + 0.125 * (c + p) - (a + p) / 2)",
    "k * norm_squared(0.3 * a + 0.7 * b - 0.1 * c - 0.9 * p)",
    "let o = vector(0.2, k, 0.1); k * norm_squared(p + o - (a + b + c) / 3)",
    "k * norm_squared(p - k * cross(b - a, c - a) - (a + b) / 2)",
    "let x = [p, a, b, c]; let m = sum(i in 0..4, x[i]) / 4; k * sum(i in 0..4, norm_squared(x[i] - m))",
];

/// Value, gradient and Hessian.
type Blocks = [Vec<f64>; 3];

fn evaluate(formula: &str, x: &[f64]) -> Blocks {
    let source = format!("energy Moved(p, a, b, c: Point; k: Scalar) {{ {formula} }}");
    let element = Interpreted::from_source(&source).expect("a sound formula").remove(0);
    let elements = element.elements(1, &[], &[Column::Same(&[1.3])]).expect("one parameter");
    let [mut value, mut gradient, mut hessian] = [1, 12, 144].map(|numbers| vec![0.0; numbers]);
    let flagged = elements.hessians(0..1, x, &mut value, &mut gradient, &mut hessian).expect("sizes fit");
    assert!(flagged.is_empty(), "{formula}");
    [value, gradient, hessian]
}

#[test]
fn no_translation_changes_a_bit() {
    // Coordinates on a grid, so that differences are exact far from the origin, too.
    let grid = f64::from(1 << 20);
    let x: Vec<f64> = (0..12).map(|i| ((1.7 * f64::from(i) + 0.4).sin() * grid).round() / grid).collect();
    let far: Vec<f64> = x.iter().zip([4e6, -7e6, 3e6].iter().cycle()).map(|(x, shift)| x + shift).collect();
    for formula in FORMULAS {
        assert_eq!(evaluate(formula, &x), evaluate(formula, &far), "{formula}");
    }
}

#[test]
fn sums_are_what_they_were() {
    let x: Vec<f64> = (0..12).map(|i| (1.7 * f64::from(i) + 0.4).sin()).collect();
    let mean = |i: usize| (x[3 + i] + x[6 + i] + x[9 + i]) / 3.0;
    let expected = 1.3 * (0..3).map(|i| (x[i] - mean(i)).powi(2)).sum::<f64>();
    let [value, ..] = evaluate(FORMULAS[0], &x);
    assert!((value[0] - expected).abs() <= 1e-15 * expected, "{} and {expected}", value[0]);
    // p + o − (a + b + c)/3 with the constant part o.
    let o = [0.2, 1.3, 0.1];
    let expected = 1.3 * (0..3).map(|i| (x[i] + o[i] - mean(i)).powi(2)).sum::<f64>();
    let [value, ..] = evaluate(FORMULAS[6], &x);
    assert!((value[0] - expected).abs() <= 1e-15 * expected, "{} and {expected}", value[0]);
}

#[test]
fn weights_that_nearly_cancel_are_kept() {
    // 1 − 3 · 0.333333333333333 = 1e-15, of points 1e6 from the origin.
    let x: Vec<f64> = (0..12).map(|i| 1e6 + f64::from(i)).collect();
    let [value, ..] = evaluate("k * norm_squared(1e9 * (p - 0.333333333333333 * (a + b + c)))", &x);
    let [exact, ..] = evaluate("k * norm_squared(1e9 * (p - (a + b + c) / 3))", &x);
    assert!(value != exact);
    let [value, ..] = evaluate("k * norm_squared(p - 0.3333333 * (a + b + c))", &x);
    let part = |i: usize| x[i] - 0.333_333_3 * (x[3 + i] + x[6 + i] + x[9 + i]);
    let expected = 1.3 * (0..3).map(|i| part(i).powi(2)).sum::<f64>();
    assert!((value[0] - expected).abs() <= 1e-8 * expected, "{} and {expected}", value[0]);
}
