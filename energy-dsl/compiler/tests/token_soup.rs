//! The compiler answers any text quickly, with code or errors, and never panics.

use std::time::{Duration, Instant};

use energy_compiler::{Listing, compile};
use proptest::prelude::*;

const SHIPPED: &[&str] = &[
    "pub energy HairBend(p0, p1, p2: Point; k: Scalar[J]) { let a = p1 - p0; let b = p2 - p1; k / 2 * (1 - \
     dot(unit(a), unit(b))) }",
    "constraint Spring(p_k, p_l: Point; L: Scalar[m]) = \"‖p_k − p_ℓ‖ − L\";",
    "force Drag(x: Point, v: Velocity; c: Scalar[N s/m]) { -c * v }",
    "residual Blend(ξ: [Twist; 2]; w: [Scalar[1]; 2], v: Vec3[m]) { transform(unit(sum(j in 0..2, w[j] * \
     exp(ξ[j]))), v) }",
    "energy StVK(x0, x1, x2: Point; rest u0, u1, u2: Vec2; λ, μ: Scalar[N/m]) { rest { let D = columns(u1 - u0, u2 - \
     u0); let B = inverse(D); let A = det(D) / 2; } let F = columns(x1 - x0, x2 - x0) * B; \
     let E = (transpose(F) * F - identity(2)) / 2; \
     A * (μ * ddot(E, E) + λ / 2 * trace(E)^2) }",
];

const WORDS: &[&str] = &[
    "energy",
    "constraint",
    "force",
    "residual",
    "pub",
    "rest",
    "let",
    "fn",
    "if",
    "else",
    "const",
    "sum",
    "in",
    "Point",
    "Scalar",
    "Vec3",
    "Twist",
    "Quat",
    "p",
    "q",
    "x1",
    "k",
    "θ",
    "dot",
    "norm",
    "unit",
    "cross",
    "exp",
    "dihedral",
    "gradient",
    "identity",
    "columns",
    "0",
    "1",
    "2.5",
    "1e400",
    "0..4",
    "+",
    "-",
    "*",
    "/",
    "^",
    "<",
    "=",
    ";",
    ",",
    ":",
    "(",
    ")",
    "{",
    "}",
    "[",
    "]",
    "#[audit]",
    "\"‖p − q‖\"",
    "\"½ â·b̂²\"",
    "\"((\"",
    "[N/m]",
    "[m^2]",
    "'a",
    "..",
    "->",
    "|",
    "&",
    "!",
];

/// Compiles a text, which may be nonsense, within a time limit.
fn survives(text: &str) -> Result<(), TestCaseError> {
    let start = Instant::now();
    if let Ok(tokens) = text.parse() {
        let _ = compile(tokens);
    }
    let _ = Listing::from_source(text);
    prop_assert!(start.elapsed() < Duration::from_secs(20), "{text} took {:?}", start.elapsed());
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 700, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn words_in_any_order(words in prop::collection::vec(prop::sample::select(WORDS), 0..60)) {
        survives(&words.join(" "))?;
    }

    #[test]
    fn mutated_declarations(
        declaration in prop::sample::select(SHIPPED),
        edits in prop::collection::vec((any::<prop::sample::Index>(), any::<prop::sample::Index>(), 0..4_u8), 1..5),
    ) {
        let pieces = declaration.split_inclusive([' ', '(', ')', ',', ';', ':']);
        let mut pieces: Vec<String> = pieces.map(str::to_owned).collect();
        for (a, b, edit) in edits {
            let (a, b) = (a.index(pieces.len()), b.index(pieces.len()));
            match edit {
                0 if pieces.len() > 1 => drop(pieces.remove(a)),
                1 => pieces.swap(a, b),
                2 => pieces.insert(a, pieces[b].clone()),
                _ => pieces[a] = WORDS[b % WORDS.len()].to_owned(),
            }
        }
        survives(&pieces.concat())?;
    }

    #[test]
    fn formulas_of_any_characters(formula in "[pqkθ‖·×−²√½ᵀ₀̂()\\[\\]{}|^_0-9+*/= .,\\\\a-c]{0,40}") {
        let text = format!("energy E(p, q: Point; k: Scalar) = \"{}\";", formula.replace('\\', "\\\\"));
        survives(&text)?;
    }
}
