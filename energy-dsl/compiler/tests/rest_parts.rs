//! Numbers that the rest shape alone determines are stored, and sums of like terms are loops.

use energy_compiler::{Interpreted, Listing};
use energy_runtime::Inputs;

fn listing(source: &str) -> Listing {
    Listing::from_source(source).expect("a sound program").remove(0)
}

/// The operations of a routine.
fn operations(source: &str, routine: &str) -> usize {
    let counts = listing(source).counts();
    let line = counts.lines().find(|line| line.split_whitespace().next() == Some(routine));
    line.and_then(|line| line.split_whitespace().nth(1)?.parse().ok()).expect("a row of the table")
}

/// A neo-Hookean tetrahedron with the given spelling of det F.
fn tetrahedron(determinant: &str) -> String {
    format!(
        "energy Tetrahedron(x0, x1, x2, x3: Point; rest X0, X1, X2, X3: Point; λ, μ: Scalar) {{
            rest {{
                let D_m = columns(X1 - X0, X2 - X0, X3 - X0);
                let B = inverse(D_m);
                let det_B = det(B);
                let V = det(D_m) / 6;
            }}
            let D = columns(x1 - x0, x2 - x0, x3 - x0);
            let F = D * B;
            let J = {determinant};
            V * (μ / 2 * (ddot(F, F) - 3) - μ * log(J) + λ / 2 * log(J)^2)
        }}"
    )
}

#[test]
fn the_determinant_of_a_product_with_the_rest_shape_is_split() {
    let (split, by_hand) = (tetrahedron("det(F) + 0 * det_B"), tetrahedron("det(D) * det_B"));
    // A product with 1 hides the matrices from the rule, but costs nothing.
    let whole = tetrahedron("det(F * 1) + 0 * det_B");
    let [split, by_hand, whole] = [split, by_hand, whole].map(|source| operations(&source, "hessian"));
    assert_eq!(split, by_hand);
    assert!(5 * split < 4 * whole, "{split} operations, {whole} without the rule");
}

/// A mirrored frame is not a rest shape: its determinant may be negative.
const MIRRORED: &str = "energy Mirrored(a, b, c, d: Point; rest M: Mat3x3; k: Scalar) {
    rest { let N = M; }
    k * det(columns(b - a, c - a, d - a) * N)
}";

#[test]
fn moved_parts_refuse_no_rest_shape() {
    let element = Interpreted::from_source(MIRRORED).expect("a sound program").remove(0);
    let positions = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
    let rest = [-2.0, 0.0, 0.0, 0.0, 3.0, 0.0, 0.0, 0.0, 5.0];
    let inputs = Inputs { parameters: &[1.0], rest: &rest, positions: &positions, velocities: &[] };
    let outputs = element.evaluate(&inputs).expect("no convention of the user");
    assert_eq!(outputs.blocks[0], ("energy", vec![-30.0]));
}

#[test]
fn parts_that_could_be_singular_stay_where_they_are_flagged() {
    let source = "energy Far(p, q: Point; rest L: Scalar; k: Scalar) {
        rest { let a = L; }
        k * norm_squared(p - q) / (a * a * a * a * a - 1)
    }";
    let element = Interpreted::from_source(source).expect("a sound program").remove(0);
    let inputs =
        Inputs { parameters: &[1.0], rest: &[1.0], positions: &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0], velocities: &[] };
    let outputs = element.evaluate::<f64>(&inputs).expect("a number like any other");
    assert!(outputs.flags[0].degenerate);
}

/// A sum of terms that are polynomials of degree 6 in a distance, with `more` after it.
fn sum(terms: &str, more: &str) -> String {
    format!(
        "energy Sum(a, b, c, d: Point; rest w: [Scalar; 8]; k: Scalar) {{
            rest {{ let v = w; }}
            fn term(k, v, s, a, b, c, d) {{
                let M = columns(b - a, c - a, d - a) * s;
                let r = 1 + norm(M * vector(s, 1, 2)) + norm(M * vector(1, s, 2));
                k * v * det(inverse(transpose(M) * M + identity(3)))^3 / r
            }}
            {terms}{more}
        }}"
    )
}

fn is_loop(source: &str) -> bool {
    listing(source).routine("value").expect("an energy has a value").contains("for term in")
}

#[test]
fn sums_of_like_terms_are_loops() {
    let like = "sum(i in 0..8, term(k, v[i], i + 1, a, b, c, d))";
    for source in [sum(like, ""), sum(&format!("k / 2 * ({like}) / 3"), ""), sum("let s = ", &format!("{like}; s * k"))]
    {
        assert!(is_loop(&source), "{source}");
    }
    // The points differ, or something is added: these are unrolled.
    for source in
        [sum("term(k, v[0], 1, a, b, c, d) + term(k, v[1], 2, b, a, c, d)", ""), sum(like, " + norm_squared(a - b)")]
    {
        assert!(!is_loop(&source), "{source}");
    }
    // Small sums share more when they are unrolled.
    let small =
        "energy Small(p, q: Point; rest w: [Scalar; 4]) { rest { let v = w; } sum(i in 0..4, v[i] * norm(p - q)) }";
    assert!(!is_loop(small));
}

#[test]
fn a_loop_returns_what_unrolled_terms_return() {
    let like = "sum(i in 0..8, term(k, v[i], i + 1, a, b, c, d))";
    let [looped, unrolled] = [sum(like, ""), sum(like, " + 0 * norm_squared(a - b)")].map(|source| {
        let element = Interpreted::from_source(&source).expect("a sound program").remove(0);
        let rest: Vec<f64> = (1..9).map(f64::from).collect();
        let positions = [0.1, 0.2, 0.3, 1.0, 0.5, 0.4, 0.3, 1.1, 0.2, 0.7, 0.1, 0.9];
        let inputs = Inputs { parameters: &[1.0], rest: &rest, positions: &positions, velocities: &[] };
        element.evaluate(&inputs).expect("a sound rest shape").blocks
    });
    for ((name, looped), (_, unrolled)) in looped.iter().zip(&unrolled) {
        let scale = unrolled.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
        for (a, b) in looped.iter().zip(unrolled) {
            assert!((a - b).abs() <= 1e-14 * scale, "{name}: {a}, {b}");
        }
    }
}

/// An energy of singular values, strains and vectors, with `result` behind a `rest` block.
fn membrane(result: &str) -> String {
    format!(
        "energy Membrane(_a, _b, _c: Point; rest u0, u1, u2: Vec2; _k, _α: Scalar, _w: [Scalar; 2]) {{
            rest {{
                let D = columns(u1 - u0, u2 - u0);
                let B = inverse(D);
                let A = det(D) / 2;
            }}
            let F = columns(b - a, c - a) * B;
            let E = (transpose(F) * F - identity(2)) / 2;
            let s = singular_values(F);
            let _used = E[0][0] + s[0];
            A * ({result})
        }}"
    )
}

#[test]
fn terms_that_differ_in_an_index_are_unrolled() {
    for like in [
        "k * ((s[0] - 1)^2 + (s[1] - 1)^2)",
        "sum(i in 0..2, s[i]^2)",
        "E[0][0]^2 + E[1][1]^2",
        "exp(s[0]) + exp(s[1])",
        "s[0]^α + s[1]^α",
        "w[0] * F[0][0]^2 + w[1] * F[1][1]^2",
        "norm(F[0]) + norm(F[1]) + norm(F[2])",
        "k / 2 * (abs(F[0][0])^3 + abs(F[1][0])^2)",
        "log(1 + gradient(E[0][0], a)[0]^2) + log(1 + gradient(E[0][0], a)[1]^2)",
    ] {
        let [like, unlike] = [membrane(like), membrane(&format!("{like} + 0 * norm_squared(a)"))].map(|source| {
            let element = Interpreted::from_source(&source).unwrap_or_else(|e| panic!("{source}\n{e}")).remove(0);
            let positions = [0.1, 0.2, 0.3, 1.0, 0.5, 0.4, 0.3, 1.1, 0.2];
            let rest = [0.0, 0.0, 1.0, 0.0, 0.0, 1.0];
            let parameters = [1.5, 0.7, 2.0, 3.0];
            let inputs = Inputs { parameters: &parameters, rest: &rest, positions: &positions, velocities: &[] };
            element.evaluate::<f64>(&inputs).expect("a sound rest shape").blocks
        });
        assert_eq!(like[0].1.len(), 1);
        assert!((like[0].1[0] - unlike[0].1[0]).abs() <= 4e-16 * like[0].1[0].abs(), "{like:?}, {unlike:?}");
    }
}

/// A comparison is stored as a number.
#[test]
fn comparisons_of_the_rest_shape_are_stored() {
    for (result, expected) in [
        ("if long { k * L2 * norm(p) } else { 0 }", 12.0),
        ("if short || !(long) { k } else { L2 * norm(p) }", 4.0),
        ("(if long { norm(p) } else { k }) + (if short { 2 * norm(p) } else { k })", 4.0),
    ] {
        let result = result.replace("!(long)", "L2 < 1");
        let source = format!(
            "energy Chosen(p: Point; rest L: Scalar; k: Scalar) {{
                rest {{ let long = L > 1; let short = L < 0.5; let L2 = L * L; let _both = long && short; }}
                let _used = if short {{ k * L2 }} else {{ 0 }};
                {result}
            }}"
        );
        let element = Interpreted::from_source(&source).unwrap_or_else(|e| panic!("{source}\n{e}")).remove(0);
        let inputs = Inputs { parameters: &[3.0], rest: &[2.0], positions: &[1.0, 0.0, 0.0], velocities: &[] };
        let blocks = element.evaluate::<f64>(&inputs).expect("a sound rest shape").blocks;
        assert_eq!(blocks[0].1, [expected], "{source}");
    }
}
