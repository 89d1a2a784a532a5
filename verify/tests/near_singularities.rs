//! The audit looks near rest and near singularities by itself: it warns of losses of digits, names the subexpression,
//! and does not fail for them.

use energy_dsl::AnyElement;
use energy_elements::{Distance, HairBend, NeoHookean, Spring, StVK};
use verify::audit::{Check, Options, Report, Target, Warning, audit_all, describe_failure};

const REST: &str = "rest { let D = columns(X1 - X0, X2 - X0, X3 - X0); let B = inverse(D); let V = det(D) / 6; }
    let F = columns(x1 - x0, x2 - x0, x3 - x0) * B;";
const REST_OF_TRIANGLE: &str = "rest { let D = columns(u1 - u0, u2 - u0); let B = inverse(D); let A = det(D) / 2; }
    let F = columns(x1 - x0, x2 - x0) * B;";

fn tetrahedron(formula: &str) -> String {
    format!(
        "energy Tet(x0, x1, x2, x3: Point; rest X0, X1, X2, X3: Vec3; μ, λ: Scalar) {{ {REST} V * ({formula}) + 0 * λ }}"
    )
}

fn triangle(formula: &str) -> String {
    format!(
        "energy Tri(x0, x1, x2: Point; rest u0, u1, u2: Vec2; μ: Scalar) {{ {REST_OF_TRIANGLE} A * μ * ({formula}) }}"
    )
}

fn options() -> Options {
    Options { mutations: 0, samples: 5, truths: 1, ..Options::quick() }
}

fn report(text: &str) -> Report {
    let targets = Target::of_text(text, "text.energy").unwrap_or_else(|errors| panic!("{errors}"));
    let report = audit_all(&targets, None, options());
    assert!(report.refused.is_empty(), "{:?}", report.refused);
    report
}

/// Returns the warnings at places that contain a text.
fn warnings(report: &Report, place: &str) -> Vec<Warning> {
    report.warnings().map(|(_, warning)| warning.clone()).filter(|warning| warning.place.contains(place)).collect()
}

#[test]
fn a_sum_that_cancels_near_rest_is_named_with_a_remedy() {
    for (text, culprit, remedy) in [
        (triangle("trace(transpose(F) * F) - 2 - log(det(transpose(F) * F))"), "- log(det(", "log1pmx"),
        (triangle("trace(transpose(F) * F) * (1 + 1 / det(transpose(F) * F)) - 4"), "- 4", "strain"),
    ] {
        let report = report(&text);
        let near = warnings(&report, "near rest");
        let [warning] = near.as_slice() else { panic!("{text}: {near:?}") };
        let subexpression = warning.subexpression.as_deref().unwrap_or_default();
        assert!(subexpression.contains(culprit), "{text}: {subexpression}");
        assert!(warning.proposal.contains(remedy), "{text}: {}", warning.proposal);
        assert!(warning.error_kappa > 1e3 && !warning.is_flagged);
        assert!(report.failures().all(|line| line.check == Check::Accuracy), "a warning is no failure");
    }
}

/// The same energy in the strain has digits near rest.
#[test]
fn an_energy_of_the_strain_has_no_warning() {
    let report = report(&triangle("ddot(transpose(F) * F - identity(2), transpose(F) * F - identity(2))"));
    assert_eq!(report.warnings().count(), 0, "{:?}", report.warnings().collect::<Vec<_>>());
    assert!(report.sections[0].extremes >= 8 && report.passed());
}

#[test]
fn a_rest_length_is_found_among_the_parameters() {
    let text =
        "energy Spring(p, q: Point; k, L: Scalar) { k * (norm_squared(p - q) / L^2 + L^2 / norm_squared(p - q) - 2) }";
    let report = report(text);
    let near = warnings(&report, "from its rest value");
    assert!(near.iter().any(|warning| warning.place.contains("`L`")), "{:?}", report.warnings().collect::<Vec<_>>());
}

/// The quotient is that of κb = 2 a × b/(‖a‖‖b‖ + a·b), the curvature of discrete rods.
#[test]
fn a_denominator_that_cancels_at_a_fold_is_named() {
    let report = report(
        "energy Rod(p0, p1, p2: Point; B: Scalar) {
            let a = p1 - p0;
            let b = p2 - p1;
            B / ((norm(a) * norm(b))^3 + dot(a, b)^3)
        }",
    );
    let folds = warnings(&report, "folded back");
    let [warning] = folds.as_slice() else { panic!("{:?}", report.warnings().collect::<Vec<_>>()) };
    assert_eq!(warning.subexpression.as_deref(), Some("(norm(a) * norm(b))^3 + dot(a, b)^3"));
    assert!(warning.proposal.contains("‖a × b‖²"), "{}", warning.proposal);
}

/// A logarithm has no value for inverted elements: such inputs are replaced and counted, and must be flagged.
#[test]
fn inputs_outside_of_the_domain_are_replaced_and_reported() {
    let report = report(&tetrahedron("μ * (ddot(F, F) - 3) - 2 * μ * log(det(F)) + λ * log(det(F))^2"));
    let section = &report.sections[0];
    assert!(section.outside > 0 && section.inputs == 5, "{} outside, {} inputs", section.outside, section.inputs);
    assert!(report.blind_spots().iter().any(|spot| spot.contains("random inputs were replaced")));
    let outside: Vec<_> = report.lines.iter().filter(|line| line.check == Check::Outside).collect();
    assert!(outside.len() == 1 && outside[0].passed && outside[0].inputs > 0);
    let finite = |line: &&verify::audit::Line| line.check == Check::Finite && !line.passed;
    assert_eq!(report.lines.iter().filter(finite).map(describe_failure).collect::<Vec<_>>(), [""; 0]);
}

#[test]
fn a_formula_without_any_value_is_refused() {
    let text = "energy Nowhere(p, q: Point; k: Scalar) { k * log(-1 - norm_squared(p - q)) }";
    let targets = Target::of_text(text, "text.energy").unwrap_or_else(|errors| panic!("{errors}"));
    let report = audit_all(&targets, None, options());
    assert!(report.refused.len() == 1 && report.refused[0].1.contains("#[audit(domain("), "{:?}", report.refused);
}

/// The budget counts operations, so what it leaves out is the same on every machine.
#[test]
fn a_small_budget_leaves_inputs_and_faults_out_and_says_so() {
    let target = Target::of_text(&triangle("trace(transpose(F) * F)"), "text.energy").unwrap();
    let options = Options { budget: 1_000_000, ..Options::quick() };
    let [first, second] = [(); 2].map(|()| audit_all(&target, None, options).blind_spots());
    assert_eq!(first, second);
    assert!(first.iter().any(|spot| spot.contains("budget") && spot.contains("of 20 inputs")), "{first:?}");
    assert!(first.iter().any(|spot| spot.contains("planted faults")), "{first:?}");
}

#[test]
fn reports_do_not_depend_on_the_number_of_threads() {
    const ELEMENTS: &[AnyElement] = &[
        AnyElement::of::<Spring<f64>>(),
        AnyElement::of::<StVK<f64>>(),
        AnyElement::of::<HairBend<f64>>(),
        AnyElement::of::<Distance<f64>>(),
        AnyElement::of::<NeoHookean<f64>>(),
    ];
    let targets: Vec<Target> = ELEMENTS.iter().map(Target::of_element).collect();
    let report = |threads| {
        let options = Options { threads: std::num::NonZero::new(threads), ..options() };
        format!("{:?}", audit_all(&targets, None, options))
    };
    let one = report(1);
    assert!(one == report(2) && one == report(5));
}
