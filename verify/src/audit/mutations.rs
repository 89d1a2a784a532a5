//! How sensitive the audit is: faults are planted in compiled routines, and each must be noticed.

use std::collections::BTreeMap;

use energy_dsl::{Fault, Interpreted, Mutation};
use fastrand::Rng;

use super::auditor::{Auditor, Case, cases};
use super::report::{Check, Mutant, MutationScore};
use super::subject::Subject;
use crate::blocks::NoAnswer;

/// Inputs a fault may go unnoticed at before it counts as missed.
const INPUTS: usize = 20;

/// Plants up to `wanted` faults, spread over kinds and routines. Faults that provably change nothing are counted apart.
///
/// # Errors
/// When an input has no answer even without a fault.
pub(super) fn score(interpreted: &Interpreted, wanted: usize, seed: u64) -> Result<MutationScore, String> {
    let subject = subject(interpreted)?;
    let cases = cases(&subject, INPUTS, INPUTS.min(4), seed ^ 0x6d75_7461_7465);
    let mut score = MutationScore::default();
    for mutation in spread(interpreted.mutations(), seed) {
        if score.mutants.len() == wanted {
            break;
        }
        if interpreted.is_proved_equivalent(&mutation) {
            score.equivalent += 1;
            continue;
        }
        let caught_by = caught_by(&self::subject(&interpreted.mutated(&mutation))?, &cases);
        score.mutants.push(Mutant { fault: mutation.to_string(), caught_by });
    }
    Ok(score)
}

fn subject(interpreted: &Interpreted) -> Result<Subject, String> {
    let runs = interpreted.clone();
    Subject::new(interpreted.declaration(), Box::new(move |inputs| runs.evaluate(inputs)), None)
}

/// The checks that fail at the first input at which one does.
fn caught_by(broken: &Subject, cases: &[Case]) -> Vec<Check> {
    for case in cases {
        let mut auditor = Auditor::new(broken);
        match look(&mut auditor, case) {
            Ok(()) if auditor.passed() => {}
            Ok(()) => {
                let mut checks: Vec<Check> = auditor.lines.iter().filter(|l| !l.passed).map(|l| l.check).collect();
                checks.sort_unstable();
                checks.dedup();
                return checks;
            }
            // What cannot even be evaluated is noticed too.
            Err(_) => return vec![Check::Finite],
        }
    }
    Vec::new()
}

fn look(auditor: &mut Auditor<'_>, case: &Case) -> Result<(), NoAnswer> {
    let answer = auditor.answer(&case.sample)?;
    auditor.laws(case, &answer)?;
    auditor.routes(case, &answer, &mut Vec::new())?;
    Ok(())
}

/// In an order that takes kinds of fault and routines by turns.
fn spread(mut mutations: Vec<Mutation>, seed: u64) -> Vec<Mutation> {
    Rng::with_seed(seed).shuffle(&mut mutations);
    let mut by_kind: BTreeMap<(Fault, &str), Vec<Mutation>> = BTreeMap::new();
    for mutation in mutations {
        by_kind.entry((mutation.fault, mutation.routine)).or_default().push(mutation);
    }
    let mut kinds: Vec<Vec<Mutation>> = by_kind.into_values().collect();
    Rng::with_seed(seed).shuffle(&mut kinds);
    let mut order = Vec::new();
    while kinds.iter().any(|kind| !kind.is_empty()) {
        order.extend(kinds.iter_mut().filter_map(Vec::pop));
    }
    order
}
