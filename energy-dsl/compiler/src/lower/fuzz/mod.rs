//! Compares sums of like terms with the same sums unrolled, over random texts.
//!
//! `LIKE_TERMS=100000 cargo test --release -p energy-compiler --lib lower::fuzz -- --nocapture` reads that number of
//! texts.

mod text;

use super::{Formula, Lowering, like_terms, repeated, rest, stored_bindings, unrolled};
use crate::check::{Program, check};
use crate::diagnostic::Diagnostics;
use crate::graph::{Form, Interpreter};
use crate::syntax;
use energy_runtime::Inputs;
use energy_runtime::tape::TermNumber;
use text::{Random, declaration, with_result};

/// Texts of an ordinary run.
const TEXTS: u64 = 600;

/// A sum and its unrolled form differ by rounding, and by the cancellation that recognised spellings avoid.
const TOLERANCE: f64 = 1e-7;

/// Returns the program of a text; `None` if it is refused, as for a division by the number 0.
fn program(source: &str) -> Option<Program> {
    let mut diagnostics = Diagnostics::default();
    let items = syntax::parse(source.parse().expect("tokens of Rust"), &mut diagnostics);
    let program = check(&items, &crate::budget::Budget::default(), &mut diagnostics).remove(0);
    diagnostics.0.is_empty().then_some(program)
}

/// Returns the terms of a formula at an input.
fn terms(
    rest: &Lowering<'_>,
    (stored, formula): &(Vec<crate::graph::NodeId>, Formula),
    inputs: &Inputs<'_, f64>,
) -> Vec<f64> {
    let stored = Interpreter::new(&rest.graph, stored).evaluate(inputs, &[]);
    let interpreter = Interpreter::new(&formula.graph, &formula.outputs);
    let Some(repetition) = &formula.repetition else { return interpreter.evaluate(inputs, &stored) };
    let width = repetition.shared + repetition.stride + repetition.table[0].len();
    let number = |term: usize, number: usize| match repetition.number(term, number) {
        TermNumber::Stored(place) => stored[place],
        TermNumber::Constant(value) => value,
    };
    let term = |term: usize| {
        let own: Vec<f64> = (0..width).map(|place| number(term, place)).collect();
        interpreter.evaluate(inputs, &own)[0]
    };
    (0..repetition.terms()).map(term).collect()
}

/// Returns whether a text is a sum of like terms.
fn agrees(source: &str, random: &mut Random) -> bool {
    let Some(declared) = program(source) else { return false };
    let program = rest::with_constant_parts_stored(&declared);
    let Some(alike) = like_terms(&program) else { return false };
    let lowering = || {
        let mut rest = Lowering::new(&program, Form::Robust, None);
        stored_bindings(&declared).into_iter().for_each(|binding| drop(rest.binding(binding)));
        rest
    };
    let (mut rest, mut whole) = (lowering(), lowering());
    let (outputs, formula, _) = unrolled(&program, &mut whole);
    let (looped, unrolled) = (repeated(&alike, &mut rest), (outputs, formula));
    for _ in 0..3 {
        let mut numbers = |n: usize| -> Vec<f64> { (0..n).map(|_| random.number()).collect() };
        let (positions, shape, parameters) = (numbers(9), numbers(12), numbers(7));
        let inputs = Inputs { parameters: &parameters, rest: &shape, positions: &positions, velocities: &[] };
        let each = terms(&rest, &looped, &inputs);
        let (sum, expected) = (each.iter().sum::<f64>(), terms(&whole, &unrolled, &inputs)[0]);
        let scale = each.iter().fold(expected.abs(), |most, term| most.max(term.abs())).max(1.0);
        let close = (sum - expected).abs() <= TOLERANCE * scale || !sum.is_finite() || !expected.is_finite();
        assert!(close, "{source}\nloop: {sum}, unrolled: {expected}, terms {each:?} at {inputs:?}");
    }
    true
}

#[test]
fn sums_of_like_terms_are_what_their_unrolled_form_is() {
    let texts = std::env::var("LIKE_TERMS").ok().and_then(|texts| texts.parse().ok()).unwrap_or(TEXTS);
    let mut loops = 0;
    for seed in 0..texts {
        let mut random = Random::new(seed);
        let source = declaration(&mut random);
        loops += u64::from(agrees(&source, &mut random));
    }
    println!("{texts} texts, {loops} of them sums of like terms");
    assert!(4 * loops > texts, "the texts are no longer like terms: {loops} of {texts}");
}

/// A vector and a quaternion of the same numbers are different constants.
#[test]
fn constants_of_terms_keep_their_shapes() {
    let term =
        |c: u8| format!("dot(vector(1, 2, 3, {c}), vector(J, 1, 2, 3)) + norm(quat(1, 2, 3, {c}) * quat(J, 1, 2, 3))");
    assert!(agrees(&with_result(&format!("({}) + ({})", term(4), term(5))), &mut Random::new(0)));
}
