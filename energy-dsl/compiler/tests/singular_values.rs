//! Functions of singular values equal functions of the matrix that do not mention them, also where singular values
//! meet.

use energy_compiler::Interpreted;
use energy_runtime::{Flags, Inputs};

/// Compiles a formula of F and its singular values s.
fn compiled(formula: &str, columns: usize) -> Interpreted {
    let (signature, matrix) = match columns {
        3 => ("p, a, b, c: Point", "columns(a - p, b - p, c - p)"),
        _ => ("p, a, b: Point", "columns(a - p, b - p)"),
    };
    let source =
        format!("energy Trial({signature}) {{ let F = {matrix}; let s = singular_values(F); {formula} + 0 * s[0] }}");
    Interpreted::from_source(&source).unwrap_or_else(|error| panic!("{error:?}")).remove(0)
}

/// Evaluates value, gradient and Hessian.
fn evaluate(element: &Interpreted, columns: &[[f64; 3]]) -> (Vec<Vec<f64>>, Flags<f64>) {
    let positions: Vec<f64> = std::iter::once(&[0.0; 3]).chain(columns).flatten().copied().collect();
    let inputs = Inputs { parameters: &[], rest: &[], positions: &positions, velocities: &[] };
    element.routine("hessian", &inputs).expect("no rest shape").expect("an energy has a Hessian")
}

/// Compares two formulas at matrices.
fn agree(formula: &str, other: &str, matrices: &[Vec<[f64; 3]>]) {
    let [formula_of_values, other] = [formula, other].map(|formula| compiled(formula, matrices[0].len()));
    for columns in matrices {
        let ((found, flags), (expected, _)) = (evaluate(&formula_of_values, columns), evaluate(&other, columns));
        assert!(!flags.degenerate && !flags.kink, "{formula} at {columns:?}: {flags:?}");
        for (block, (found, expected)) in found.iter().zip(&expected).enumerate() {
            let size = expected.iter().fold(1.0_f64, |size, x| size.max(x.abs()));
            for (a, b) in found.iter().zip(expected) {
                let close = (a - b).abs() <= 1e-12 * size;
                assert!(close, "{formula} at {columns:?}, block {block}: {a:e}, expected {b:e}");
            }
        }
    }
}

/// Returns the columns of a diagonal matrix, turned from the left by half a turn and from the right about an axis.
fn turned(diagonal: [f64; 3]) -> Vec<[f64; 3]> {
    let left = [[-7.0, 4.0, 4.0], [4.0, -1.0, 8.0], [4.0, 8.0, -1.0]].map(|row| row.map(|x| x / 9.0));
    let right = [[0.6, -0.8, 0.0], [0.8, 0.6, 0.0], [0.0, 0.0, 1.0]];
    let entry = |i: usize, j: usize| (0..3).map(|k| left[i][k] * diagonal[k] * right[j][k]).sum();
    (0..3).map(|j| std::array::from_fn(|i| entry(i, j))).collect()
}

const SPECTRA: [[f64; 3]; 9] = [
    [3.0, 2.0, 1.0],
    [1.0, 1.0, 1.0],
    [2.0, 1.0, 1.0],
    [2.0, 2.0, 1.0],
    [1.0 + 1e-9, 1.0, 1.0 - 1e-10],
    [1.0 + 1e-4, 1.0, 0.5],
    [2.0, 1.5, -1.0],
    [2.0, 0.1, 0.02],
    [20.0, 1.0, 0.1],
];

#[test]
fn functions_of_three_singular_values_equal_functions_of_the_matrix() {
    let pairs = [
        ("s[0]^2 + s[1]^2 + s[2]^2", "ddot(F, F)"),
        ("norm_squared(s)", "ddot(F, F)"),
        ("s[0]^4 + s[1]^4 + s[2]^4", "ddot(transpose(F) * F, transpose(F) * F)"),
        ("s[0] * s[1] * s[2]", "det(F)"),
        ("norm(s)", "sqrt(ddot(F, F))"),
        ("1 / (1 + s[0]^2) + 1 / (1 + s[1]^2) + 1 / (1 + s[2]^2)", "trace(inverse(identity(3) + transpose(F) * F))"),
        ("log(1 + s[0]^2) + log(1 + s[1]^2) + log(1 + s[2]^2)", "log(det(identity(3) + transpose(F) * F))"),
        ("s[0] + s[1] + s[2]", "trace(stretch_of(F))"),
        ("(s[0] - 1)^2 + (s[1] - 1)^2 + (s[2] - 1)^2", "ddot(F - rotation_of(F), F - rotation_of(F))"),
    ];
    let matrices = SPECTRA.map(turned);
    pairs.into_iter().for_each(|(formula, other)| agree(formula, other, &matrices));
}

#[test]
fn functions_of_two_singular_values_equal_functions_of_the_matrix() {
    let pairs = [
        ("s[0]^2 + s[1]^2", "ddot(F, F)"),
        ("s[0]^4 + s[1]^4", "ddot(transpose(F) * F, transpose(F) * F)"),
        ("s[0]^2 * s[1]^2", "det(transpose(F) * F)"),
        ("norm(s)", "sqrt(ddot(F, F))"),
        ("s[0] + s[1]", "trace(stretch_of(F))"),
    ];
    let spectra = [[2.0, 1.0], [1.0, 1.0], [1.0 + 1e-9, 1.0], [10.0, 0.5]];
    let matrices = spectra.map(|[first, second]| turned([first, second, 0.0])[..2].to_vec());
    pairs.into_iter().for_each(|(formula, other)| agree(formula, other, &matrices));
}

/// A tension field: no energy where both directions are slack, that of one direction, or that of both.
#[test]
fn conditions_may_depend_on_one_singular_value() {
    let both = "(s[0]^2 * s[1]^2 + s[0]^2 + s[1]^2)";
    let spectra = [[1.5, 1.5], [1.5, 1.5 - 1e-9], [1.5, 1.25]];
    let matrices = spectra.map(|[first, second]| turned([first, second, 0.0])[..2].to_vec());
    for formula in [
        format!("(if s[0] <= 1 {{ 0 }} else {{ {both} }})"),
        format!("(if s[0] <= 1 {{ 0 }} else {{ if s[1] <= 1 {{ s[0]^4 }} else {{ {both} }} }})"),
        format!("2 * (if s[0] > 7 {{ s[0] }} else {{ {both} / 2 }})"),
    ] {
        agree(&formula, "det(transpose(F) * F) + ddot(F, F)", &matrices);
    }
    // If one direction is slack, only the other one has energy.
    let slack = turned([1.5, 0.5, 0.0])[..2].to_vec();
    agree("(if s[1] <= 1 { s[0]^4 + 0 * s[1] } else { 0 })", "s[0]^4", &[slack]);
}

/// A singular value of 0 is below the limit, where its derivative does not matter.
#[test]
fn smaller_and_larger_values_are_branches() {
    let formula = "(max(s[0] - 1, 0)^3 + max(s[1] - 1, 0)^3 + max(s[2] - 1, 0)^3)";
    for spectrum in [[1.5, 1.5, 0.0], [1.5, 0.5, -0.5], [0.5, 0.5, -0.5], [0.0, 0.0, 0.0]] {
        assert_eq!(flags(formula, spectrum), [false, false], "{spectrum:?}");
    }
    let matrices = [[1.5, 1.5, 0.0], [1.5, 0.5, 0.0]].map(|spectrum| turned(spectrum)[..2].to_vec());
    let both = "(s[0]^4 + s[1]^4)";
    agree(&format!("min({both}, 100)"), both, &matrices);
    assert!(flags("max(s[0] - 1, 0)^3", [1.5, 1.5, 0.5])[0]);
}

#[test]
fn a_branch_without_symmetry_is_flagged_where_it_is_taken() {
    let formula = "(if s[0] > 2 { s[0]^2 } else { s[0]^2 + s[1]^2 + s[2]^2 })";
    assert_eq!(flags(formula, [1.0, 1.0, 0.5]), [false, false]);
    assert_eq!(flags(formula, [3.0, 3.0, 0.5]), [true, false]);
    assert_eq!(flags(formula, [3.0, 2.5, 0.5]), [false, false]);
}

/// Returns the flags at a diagonal matrix: degenerate, kink.
fn flags(formula: &str, [a, b, c]: [f64; 3]) -> [bool; 2] {
    let flags = evaluate(&compiled(formula, 3), &[[a, 0.0, 0.0], [0.0, b, 0.0], [0.0, 0.0, c]]).1;
    [flags.degenerate, flags.kink]
}

#[test]
fn single_values_have_no_derivative_where_they_meet_and_sums_of_opposites_no_rotation() {
    assert_eq!(flags("s[0]", [2.0, 1.0, 0.5]), [false, false]);
    assert_eq!(flags("s[0]", [1.0, 1.0, 0.5]), [true, false]);
    assert_eq!(flags("s[2]", [1.0, 1.0, 0.5]), [false, false]);
    assert_eq!(flags("s[0]^3 + s[1]^3", [1.0, 1.0, 0.5]), [false, false]);
    assert!(flags("s[0] + s[1] + s[2]", [1.0, 0.5, -0.5])[0]);
    assert_eq!(flags("s[0]^2 + s[1]^2 + s[2]^2", [1.0, 0.5, -0.5]), [false, false]);
    assert_eq!(flags("s[0]^2 + s[1]^2 + s[2]^2", [0.0, 0.0, 0.0]), [false, false]);
}
