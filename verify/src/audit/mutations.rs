//! Mutation testing of the audit: faults are planted in compiled routines, and each must be noticed.

use std::collections::{BTreeMap, BTreeSet};

use energy_compiler::{Fault, Interpreted, Mutation};
use energy_dsl::{Inputs, Number, Outputs};
use fastrand::Rng;

use super::amplification;
use super::auditor::Auditor;
use super::budget::Meter;
use super::cases::{Case, cases};
use super::report::{Check, Mutant, MutationScore};
use super::subject::Subject;
use crate::blocks::{BlockName, NoAnswer};
use crate::multiprecision::{Big, worse};
use crate::sample::Sample;

/// Plants up to `wanted` faults, spread over kinds and routines, and tries each at `trials` inputs. Faults that
/// provably change nothing are counted separately. The last faults are left out if the audit has taken more than the
/// limit of operations.
///
/// # Errors
/// If an input has no result even without a fault.
pub(super) fn score(
    interpreted: &Interpreted,
    wanted: usize,
    inputs: usize,
    seed: u64,
    (meter, limit): (&Meter, u64),
) -> Result<MutationScore, String> {
    let subject = subject(interpreted, meter)?;
    let mut trials: Vec<Trial<'_>> = cases(&subject, inputs, inputs, seed ^ 0x6d75_7461_7465)
        .list
        .into_iter()
        .map(|case| Trial { case, fails_anyway: Vec::new() })
        .collect();
    trials.extend(rare_branches(&subject, interpreted, &trials, seed, limit));
    let mut score = MutationScore::default();
    for mutation in spread(interpreted.mutations(), seed) {
        if score.mutants.len() == wanted {
            break;
        }
        if meter.spent() > limit && !score.mutants.is_empty() {
            score.left_out = wanted - score.mutants.len();
            break;
        }
        meter.compilation();
        if interpreted.is_proved_equivalent(&mutation) {
            score.equivalent += 1;
            continue;
        }
        let broken = interpreted.mutated(&mutation);
        let caught_by = caught_by(&self::subject(&broken, meter)?, &trials);
        if caught_by.is_empty() {
            match largest_difference(&subject, interpreted, &broken, &trials) {
                Some(0.0) => {
                    score.without_effect += 1;
                    continue;
                }
                Some(part) if part < 1.0 => {
                    score.within_rounding += 1;
                    continue;
                }
                _ => {}
            }
        }
        score.mutants.push(Mutant { fault: mutation.to_string(), caught_by });
    }
    Ok(score)
}

/// Creates a subject that counts its operations together with the element's own.
fn subject(interpreted: &Interpreted, meter: &Meter) -> Result<Subject, String> {
    let mut subject = Subject::of_routines(interpreted, None)?;
    subject.meter = meter.clone();
    Ok(subject)
}

/// Returns by how much an unnoticed fault changes results without rounding: the largest difference at any input,
/// relative to what may go unnoticed.
///
/// For a block, that is twice the allowed error of accuracy, 8 u·max(1, κ), because rounding may hide as much. For a
/// block that another routine repeats, it is the allowed difference between routines. The last coefficient of a series
/// changes only last bits. An operation that no input reaches, or whose other operand is always 1, changes nothing.
fn largest_difference(
    subject: &Subject,
    sound: &Interpreted,
    broken: &Interpreted,
    trials: &[Trial<'_>],
) -> Option<f64> {
    let mut most = 0.0_f64;
    for Trial { case, .. } in trials {
        subject.meter.exact_routines();
        let [blocks, repeats] = exact_differences(sound, broken, &case.sample)?;
        let answer = subject.answer(&case.sample).ok()?;
        let names = BlockName::of(&subject.declaration).into_iter();
        let kappa = names.map(|block| amplification(subject, &case.sample, &answer, block)).fold(1.0, f64::max);
        let allowed = Check::Accuracy.tolerance() * f64::EPSILON * kappa;
        most = most.max(blocks / allowed).max(repeats / Check::Routines.tolerance());
    }
    Some(most)
}

/// Returns the largest difference of a block without rounding, relative to its largest number, and the largest
/// difference of repeated blocks.
fn exact_differences(sound: &Interpreted, broken: &Interpreted, sample: &Sample) -> Option<[f64; 2]> {
    let big = |numbers: &[f64]| numbers.iter().map(|&x| Big::from_f64(x)).collect::<Vec<_>>();
    let lists = [&sample.parameters, &sample.rest, &sample.positions, &sample.velocities].map(|list| big(list));
    let inputs = Inputs { parameters: &lists[0], rest: &lists[1], positions: &lists[2], velocities: &lists[3] };
    let (before, after) = (sound.evaluate_over(&inputs).ok()?, broken.evaluate_over(&inputs).ok()?);
    let numbers = |outputs: Outputs<Big>| {
        let blocks: Vec<_> = outputs.blocks.into_iter().map(|(_, numbers)| numbers).collect();
        let repeats: Vec<_> = outputs.repeats.into_iter().map(|(_, _, numbers)| numbers).collect();
        [blocks, repeats]
    };
    let (before, after) = (numbers(before), numbers(after));
    let most = [0, 1].map(|kind| {
        let pairs = before[kind].iter().zip(&after[kind]);
        pairs.map(|(a, b)| relative_difference(a, b)).fold(0.0, worse)
    });
    most.iter().all(|most| !most.is_nan()).then_some(most)
}

fn relative_difference(a: &[Big], b: &[Big]) -> f64 {
    let size = a.iter().map(|x| x.to_f64().abs()).fold(0.0, f64::max);
    let change = a.iter().zip(b).map(|(a, b)| (a.clone() - b.clone()).to_f64().abs()).fold(0.0, worse);
    if change == 0.0 { 0.0 } else { change / size }
}

/// An input, and the checks that fail there without a fault: near a singularity some routes lose their digits.
struct Trial<'a> {
    case: Case<'a>,
    fails_anyway: Vec<Check>,
}

/// Searches for an input with each outcome of a comparison that ordinary inputs do not have.
fn rare_branches<'a>(
    subject: &'a Subject,
    interpreted: &Interpreted,
    ordinary: &[Trial<'_>],
    seed: u64,
    limit: u64,
) -> Vec<Trial<'a>> {
    const CANDIDATES: usize = 4000;
    let branches = |sample: &Sample| interpreted.branches(&sample.inputs()).ok();
    let mut seen: BTreeSet<(usize, bool)> = BTreeSet::new();
    for trial in ordinary {
        seen.extend(branches(&trial.case.sample).into_iter().flatten().enumerate());
    }
    let comparisons = seen.iter().map(|(number, _)| number + 1).max().unwrap_or(0);
    let mut sampler = subject.sampler(seed ^ 0x6272_616e_6368);
    let mut found = Vec::new();
    for _ in 0..CANDIDATES {
        if seen.len() == 2 * comparisons || subject.meter.spent() > limit {
            break;
        }
        let sample = sampler.odd_sample();
        subject.meter.answer(0);
        let Some(taken) = branches(&sample) else { continue };
        if taken.iter().enumerate().all(|(number, &outcome)| seen.contains(&(number, outcome))) {
            continue;
        }
        let turn = sampler.rotation();
        if subject.is_unusable(&sample) {
            continue;
        }
        let case = Case::new(subject, sample, turn, true);
        let mut auditor = Auditor::new(subject);
        let sound = look(&mut auditor, &case).is_ok();
        let fails_anyway = failed(&auditor);
        // If the code under audit flags its result, or returns none, nothing can be compared.
        if sound && !fails_anyway.contains(&Check::Finite) && !fails_anyway.contains(&Check::Accuracy) {
            seen.extend(taken.into_iter().enumerate());
            found.push(Trial { case, fails_anyway });
        }
    }
    found
}

fn failed(auditor: &Auditor<'_>) -> Vec<Check> {
    let mut checks: Vec<Check> = auditor.lines.iter().filter(|line| !line.passed).map(|line| line.check).collect();
    checks.sort_unstable();
    checks.dedup();
    checks
}

/// Returns the checks that fail because of the fault, at the first input where any does.
fn caught_by(broken: &Subject, trials: &[Trial<'_>]) -> Vec<Check> {
    for trial in trials {
        let mut auditor = Auditor::new(broken);
        // A failed evaluation counts as noticed.
        if look(&mut auditor, &trial.case).is_err() {
            return vec![Check::Finite];
        }
        let mut checks = failed(&auditor);
        checks.retain(|check| !trial.fails_anyway.contains(check));
        if !checks.is_empty() {
            return checks;
        }
    }
    Vec::new()
}

fn look(auditor: &mut Auditor<'_>, case: &Case<'_>) -> Result<(), NoAnswer> {
    let answer = auditor.answer(&case.sample)?;
    auditor.laws(case, &answer)?;
    auditor.routes(case, &answer, &mut Vec::new())?;
    Ok(())
}

/// Orders faults so that kinds and routines alternate.
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
