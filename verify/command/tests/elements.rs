//! The derivatives of every element of the catalogue, compared with independent routes.

use energy_dsl::AnyElement;
use verify::audit::{Options, audit, describe_failure};
use verify::parallel;
use verify_command::catalogue;

/// The comparisons that `assert_derivatives!` makes for an element.
fn options() -> Options {
    Options { truths: 5, mutations: 0, extremes: 10, ..Options::default() }
}

/// Returns a description of each failed check of an element's generated code.
fn problems(entry: &AnyElement) -> Vec<String> {
    let report = audit(entry.declaration, entry.evaluate, options());
    let refused = report.refused.iter().map(|(name, why)| format!("{name} cannot be audited: {why}"));
    let problems: Vec<String> = refused.chain(report.failures().map(describe_failure)).collect();
    assert!(!problems.is_empty() || !report.lines.is_empty(), "{}: no checks", entry.declaration.name);
    problems
}

/// The operations of all routines of an element, which its audit time grows with.
fn operations(entry: &AnyElement) -> usize {
    entry.declaration.routines.iter().map(|routine| routine.full.total()).sum()
}

#[test]
fn every_derivative_of_the_catalogue_passes_the_audit() {
    let of = |elements: &[AnyElement]| parallel::map(elements, None, operations, problems).concat();
    let problems = [of(catalogue::elements()), of(catalogue::mixed())].concat();
    assert!(problems.is_empty(), "\n{}", problems.join("\n"));
}
