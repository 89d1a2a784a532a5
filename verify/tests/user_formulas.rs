//! A file of formulas as users write them: the audit raises no false alarm, and a false formula fails by its check.

use verify::audit::{Check, Options, Report, Target, audit_all, describe_failure};

const FORMULAS: &str = include_str!("../data/user_formulas.energy");

fn report(text: &str, options: Options) -> Report {
    let targets = Target::of_text(text, "user_formulas.energy").unwrap_or_else(|errors| panic!("{errors}"));
    audit_all(&targets, None, options)
}

fn failures(report: &Report) -> Vec<String> {
    let refused = report.refused.iter().map(|(name, why)| format!("{name}: {why}"));
    refused.chain(report.failures().map(describe_failure)).collect()
}

#[test]
fn formulas_by_regions_exponentials_and_angles_pass_with_five_seeds() {
    for seed in 1..=5 {
        let report = report(FORMULAS, Options { samples: 30, truths: 3, mutations: 0, seed, ..Options::default() });
        assert!(report.elements() > 8);
        assert_eq!(failures(&report), [""; 0], "seed {seed}");
    }
}

/// Without its domain, an exponential overflows where nobody uses it. It is audited at smaller strains, and the report says
/// how to state a domain.
#[test]
fn an_exponential_without_its_domain_is_audited_where_it_is_finite() {
    let start = FORMULAS.find("energy Fung").unwrap();
    let fung = &FORMULAS[start..start + FORMULAS[start..].find("\n}\n").unwrap() + 2];
    let report = report(&format!("#[audit] {fung}"), Options { samples: 60, mutations: 0, ..Options::default() });
    assert_eq!(failures(&report), [""; 0]);
    let said = report.blind_spots().join("\n");
    assert!(said.contains("range of doubles") && said.contains("#[audit(domain("), "{said}");
}

#[test]
fn a_jump_fails_and_a_kink_passes() {
    let options = Options { samples: 40, truths: 2, mutations: 0, ..Options::default() };
    for (jump, size) in [("0.1", true), ("1e-6", true), ("0", false)] {
        let text = format!(
            "#[audit] energy Step(p, q: Point; k, L: Scalar) {{
                 let r = norm(p - q);
                 if r < L {{ k * r + {jump} }} else {{ k * (2 * r - L) }}
             }}"
        );
        let report = report(&text, options);
        let failed: Vec<Check> = report.failures().map(|line| line.check).collect();
        assert_eq!(failed, vec![Check::Continuity; usize::from(size)], "{jump}: {:?}", failures(&report));
    }
}

/// Whatever kind of inputs a declaration has, it accepts the domain that the report proposes.
#[test]
fn proposed_domains_are_accepted() {
    let laws = [
        (
            "strain",
            "energy Fibre(a, b, c: Point; rest u, v, w: Vec2; k: Scalar) {
             rest { let A = det(columns(v - u, w - u)); }
             k * exp((norm_squared(cross(b - a, c - a)) / A^2)^3)
         }",
        ),
        ("scale", "energy Bond(x, y: Point; k: Scalar) { k * exp(norm_squared(x - y)^3) }"),
        ("k", "energy Hot(x: Point, T: Scalar; k: Scalar) { exp(k * (norm_squared(x) * T)^4) }"),
        ("k", "residual Far(p: Point; k: Scalar) { exp(k * norm_squared(p)^4) }"),
        ("T", "energy Alone(T: [Scalar; 2]) { exp((T[0]^2 + 8 * T[1]^2)^6) }"),
    ];
    for (name, law) in laws {
        let said = report(law, Options { samples: 40, truths: 2, mutations: 0, ..Options::default() }).blind_spots();
        let said =
            said.iter().find(|said| said.contains("range of doubles")).unwrap_or_else(|| panic!("{law}: {said:?}"));
        let domain = &said[said.find("#[audit(").unwrap()..=said.rfind(")]").unwrap() + 1];
        assert!(domain.contains(&format!("({name} = ")), "{law}: {domain}");
        Target::of_text(&format!("{domain} {law}"), "law.energy").unwrap_or_else(|errors| panic!("{errors}"));
    }
}

/// ½ d·d of the vector (x, y) and x·y have the same arguments.
#[test]
fn the_length_of_a_joined_vector_is_told_from_the_product_of_its_parts() {
    let text = "#[audit] energy Joined(x, y: Point2; k: Scalar) {
                    let r = norm(vector(x[0], x[1], y[0], y[1]));
                    k * r + dot(x, y)^3 + 1 / r
                }";
    let report = report(text, Options { samples: 40, truths: 2, mutations: 0, ..Options::default() });
    assert_eq!(failures(&report), [""; 0]);
}

/// The two arguments of `computed_as` must be equal.
#[test]
fn a_number_that_is_computed_as_another_one_fails() {
    let options = Options { samples: 40, truths: 2, mutations: 0, ..Options::default() };
    for (factor, passes) in [("1", true), ("1.0000001", false)] {
        let text = format!(
            "#[audit] energy Gap(p, q: Point; k, L: Scalar) {{
                 let r = norm(p - q);
                 k * computed_as(r^2 - L^2, {factor} * (r - L) * (r + L))^2
             }}"
        );
        let found = failures(&report(&text, options));
        assert_eq!(found.is_empty(), passes, "{factor}: {found:?}");
    }
}

/// Neighbouring doubles at the kink of a root differ by the root of roundoff.
#[test]
fn a_kink_with_infinite_slopes_is_no_jump() {
    let options = Options { samples: 40, truths: 2, mutations: 0, seed: 4, ..Options::default() };
    for (jump, expected) in [("0", vec![]), ("1e-6", vec![Check::Continuity])] {
        let text = format!(
            "#[audit] energy Root(p, q: Point; k, L: Scalar) {{
                 let e = norm(p - q) / L - 1;
                 k * sqrt(abs(e)) * tanh(norm(p - q)) + (if e < 0 {{ 0 }} else {{ {jump} }})
             }}"
        );
        let report = report(&text, options);
        let failed: Vec<Check> = report.failures().map(|line| line.check).collect();
        assert_eq!(failed, expected, "{jump}: {:?}", failures(&report));
    }
}

/// A value that is drawn from everywhere near a kink leaves no side to take differences on.
#[test]
fn inputs_without_differences_are_counted_and_too_many_fail() {
    let few = report(FORMULAS, Options { samples: 30, truths: 0, mutations: 0, ..Options::default() });
    assert!(few.sections.iter().all(|section| section.without_differences <= section.inputs / 3));
    let many = "#[audit(domain(x = 0..1e-9))] residual Edge(x: Scalar; k: Scalar) { k * abs(x) }";
    let many = report(many, Options { samples: 30, truths: 0, mutations: 0, ..Options::default() });
    let failed: Vec<Check> = many.failures().map(|line| line.check).collect();
    assert!(failed.contains(&Check::OneSide), "{:?}", failures(&many));
    assert!(many.sections[0].without_differences > 10);
}
