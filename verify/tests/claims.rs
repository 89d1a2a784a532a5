//! Claims of declarations that are read at run time: the audit checks them, and names the false one.

use verify::audit::{Check, Options, Target, audit_all, describe_failure};

/// Returns the failures of the audit of a text.
fn failures(text: &str) -> Vec<String> {
    let targets = Target::of_text(text, "claims.energy").unwrap_or_else(|errors| panic!("{text}\n{errors}"));
    let report = audit_all(&targets, None, Options { samples: 40, ..Options::default() });
    assert!(report.refused.is_empty(), "{text}: {:?}", report.refused);
    // A claim of rotation invariance also brings the check of Σ x × f = 0.
    let others: Vec<String> = report
        .failures()
        .filter(|line| !matches!(line.check, Check::Claims | Check::AngularMomentum))
        .map(describe_failure)
        .collect();
    assert_eq!(others, [""; 0], "{text}");
    report.failures().filter(|line| line.check == Check::Claims).map(describe_failure).collect()
}

#[test]
fn true_claims_pass() {
    for text in [
        "#[invariant(translation, rotation)] #[even]
         energy Spring(p, q: Point; k: Scalar) { k * norm_squared(p - q) }",
        "#[rest_state(zero_force)]
         energy Anchor(p: Point; rest X: Point; k: Scalar) {
             rest { let there = X; }
             k * norm_squared(p - there)
         }",
    ] {
        assert_eq!(failures(text), [""; 0], "{text}");
    }
}

#[test]
fn false_claims_fail_and_are_named() {
    for (claim, text) in [
        ("invariant(rotation)", "energy Lean(p, q: Point; k: Scalar) { k * (p - q).x^2 }"),
        (
            "invariant(rotation)",
            "energy Lean(p, q: Point; k: Scalar) { k * (norm_squared(p - q) + 1e-9 * (p - q).x^2) }",
        ),
        ("even", "energy Odd(p, q: Point; k: Scalar) { k * (p - q).x }"),
        (
            "rest_state(zero_force)",
            "energy Pull(p: Point; rest X: Point; k: Scalar) {
                 rest { let there = X; }
                 k * (norm_squared(p - there) + p.z)
             }",
        ),
    ] {
        let found = failures(&format!("#[{claim}] {text}"));
        assert!(
            !found.is_empty() && found.iter().all(|line| line.contains(&format!("#[{claim}]"))),
            "{claim}: {found:#?}"
        );
        assert_eq!(failures(text), [""; 0], "without the claim: {text}");
    }
}

#[test]
fn a_false_claim_of_translation_invariance_is_refused() {
    let text = "#[invariant(translation)] energy Weight(p: Point; m: Scalar) { 9.81 * m * p.z }";
    let message = Target::of_text(text, "claims.energy").unwrap_err().to_string();
    assert!(
        message.contains("claims.energy:1:13") && message.contains("translation invariance cannot be proved"),
        "{message}"
    );
}
