//! The derivatives of every element of the catalogue, compared with independent routes.

use std::cmp::Reverse;
use std::sync::atomic::{AtomicUsize, Ordering};

use energy_catalogue::catalogue;
use energy_dsl::AnyElement;
use verify::audit::{Options, audit, describe_failure};

/// The comparisons that `assert_derivatives!` makes for an element.
const OPTIONS: Options =
    Options { samples: 200, declared_samples: false, truths: 5, mutations: 0, trials: 40, seed: 1 };

/// Returns a description of each failed check of an element's generated code.
fn problems(entry: &AnyElement) -> Vec<String> {
    let report = audit(entry.declaration, entry.evaluate, OPTIONS);
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
    // The largest first, so that no thread waits for the last one.
    let mut all: Vec<&AnyElement> = catalogue().iter().collect();
    all.sort_by_key(|entry| Reverse(operations(entry)));
    let next = AtomicUsize::new(0);
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let problems: Vec<String> = std::thread::scope(|scope| {
        let work = || {
            let entries = std::iter::from_fn(|| all.get(next.fetch_add(1, Ordering::Relaxed)).copied());
            entries.flat_map(problems).collect::<Vec<String>>()
        };
        let workers: Vec<_> = (0..threads).map(|_| scope.spawn(work)).collect();
        workers.into_iter().flat_map(|worker| worker.join().expect("an audit panicked")).collect()
    });
    assert!(next.into_inner() >= all.len());
    assert!(problems.is_empty(), "\n{}", problems.join("\n"));
}
