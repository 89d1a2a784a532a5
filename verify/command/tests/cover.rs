//! A choice of elements that covers all routines and operations: compilers of other languages take minutes for all
//! elements.

use std::collections::BTreeSet;

use energy_compiler::{Interpreted, Precision, Target, sources};

/// Returns the numbers of elements that between them have every routine, and every operation and helper that any of the
/// elements has in that routine. All of them, as in the weekly check, if the variable `ALL_ELEMENTS` is set.
pub fn sufficient(elements: &[Interpreted]) -> Vec<usize> {
    if std::env::var_os("ALL_ELEMENTS").is_some() {
        return (0..elements.len()).collect();
    }
    let parts: Vec<(BTreeSet<(String, String)>, usize)> = elements.iter().map(parts).collect();
    let mut missing: BTreeSet<_> = parts.iter().flat_map(|(parts, _)| parts).collect();
    let mut chosen = BTreeSet::new();
    while !missing.is_empty() {
        // The element that adds most for the length of its text.
        let gain = |number: &usize| {
            let (parts, length) = &parts[*number];
            parts.iter().filter(|part| missing.contains(part)).count() as f64 / *length as f64
        };
        let best = (0..elements.len()).max_by(|a, b| gain(a).total_cmp(&gain(b))).expect("there are elements");
        missing.retain(|part| !parts[best].0.contains(part));
        chosen.insert(best);
    }
    println!("{} of {} elements have all operations of all routines", chosen.len(), elements.len());
    chosen.into_iter().collect()
}

/// Returns the functions that each routine of an element calls in C, and the length of the text.
fn parts(element: &Interpreted) -> (BTreeSet<(String, String)>, usize) {
    let files = sources(std::slice::from_ref(element), Target::C, &[Precision::Double]).expect("it has C");
    let (prefix, suffix) = ("energy_f64_", "_f64.h");
    let own = files.iter().find(|file| file.name.ends_with(suffix) && !file.name.starts_with("energy_"));
    let own = own.expect("it has a header");
    let element = own.name.trim_end_matches(".h");
    let mut parts = BTreeSet::new();
    for function in own.text.split("\nENERGY_").skip(1) {
        let (signature, body) = function.split_once('{').unwrap_or_default();
        let name = signature.split('(').next().unwrap_or_default().split_whitespace().next_back().unwrap_or_default();
        // All points of a stencil have the routine of a single vertex.
        let routine = name.trim_start_matches(element).replace(|c: char| c.is_ascii_digit(), "");
        let words = body.split(|c: char| !(c.is_alphanumeric() || c == '_'));
        let calls = words.filter(|word| word.starts_with(prefix) || *word == "for").map(str::to_owned);
        parts.extend(calls.map(|call| (routine.clone(), call)));
    }
    (parts, own.text.len())
}
