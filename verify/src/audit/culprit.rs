//! The subexpression that loses digits, and a spelling that keeps them.

use energy_compiler::{Part, Parts};
use energy_dsl::{Declaration, Number};
use fastrand::Rng;

use super::remedy::domain;
use super::subject::Subject;
use crate::formula::{JetInputs, order};
use crate::jet::{Jet, Order};
use crate::multiprecision::{Big, at_precision, worse};
use crate::sample::Sample;

/// Bits of the true numbers.
const BITS: usize = 700;

/// The subexpression that loses digits, and a remedy.
pub(super) struct Culprit {
    /// The text of the subexpression; `None` if the formula as written loses none.
    pub(super) subexpression: Option<String>,
    pub(super) proposal: String,
}

/// Searches the formula for the subexpression at which the error of a block arises. Doubles and multi-precision
/// evaluate every subexpression with its derivatives up to the order of the block. The culprit has a part of the error
/// in at least one of them, while all that it is computed from is far more accurate.
pub(super) fn culprit(subject: &Subject, sample: &Sample, block_order: usize, error: f64) -> Culprit {
    let compiled = || Culprit {
        subexpression: None,
        proposal: "the formula as written keeps the digits here: its compiled form loses them".into(),
    };
    let Some(parts) = subject.formula.parts() else {
        return Culprit { subexpression: None, proposal: "derivatives within a formula are not taken apart".into() };
    };
    let orders = (order(subject.declaration.kind), block_order);
    let variations = variations(sample);
    let errors = variations.iter().map(|sample| errors(&subject.declaration, &parts, sample, orders));
    let errors = errors.reduce(|a, b| a.into_iter().zip(b).map(|(a, b)| worse(a, b)).collect()).unwrap_or_default();
    let share = error / 300.0;
    let arises = |&index: &usize| {
        let inherited = parts.list()[index].operands.iter().map(|&operand| errors[operand]).fold(0.0, worse);
        errors[index] >= share && inherited < share
    };
    let worst = (0..errors.len()).filter(arises).max_by(|&a, &b| errors[a].total_cmp(&errors[b]).then(b.cmp(&a)));
    let Some(part) = worst.map(|index| &parts.list()[index]) else { return compiled() };
    Culprit { subexpression: Some(part.text.clone()), proposal: proposal(part, &subject.declaration) }
}

/// Returns the input, and others of slightly different parameters: at a single one, rounding errors may happen to
/// cancel.
fn variations(sample: &Sample) -> Vec<Sample> {
    let mut random = Rng::with_seed(1);
    let varied = |number: usize| {
        let vary = |x: &f64| if number == 0 { *x } else { x * (1.0 + 0.01 * random.f64()) };
        Sample { parameters: sample.parameters.iter().map(vary).collect(), ..sample.clone() }
    };
    (0..4).map(varied).collect()
}

/// Returns the largest relative error of each subexpression and its derivatives, in roundoffs. NaN counts as infinite.
fn errors(declaration: &Declaration, parts: &Parts, sample: &Sample, (order, block_order): (Order, usize)) -> Vec<f64> {
    let doubles = parts.evaluate(&JetInputs::<f64>::new(declaration, sample, None, order).inputs());
    at_precision(BITS, || {
        let exact = parts.evaluate(&JetInputs::<Big>::new(declaration, sample, None, order).inputs());
        let pairs = exact.iter().zip(&doubles);
        pairs
            .map(|(exact, found)| (0..=block_order).map(|k| relative_error(exact, found, k)).fold(0.0, worse))
            .collect()
    })
}

/// Returns the largest error of the derivatives of one order, relative to the largest of them.
fn relative_error(exact: &[Jet<Big>], found: &[Jet<f64>], order: usize) -> f64 {
    let exact: Vec<Big> = exact.iter().flat_map(|jet| derivatives(jet, order)).collect();
    let found: Vec<f64> = found.iter().flat_map(|jet| derivatives(jet, order)).collect();
    let largest = exact.iter().map(|x| x.to_f64().abs()).fold(0.0, worse);
    // The error is unknown if the true value is, or is out of the range of doubles.
    if !largest.is_finite() || largest < f64::MIN_POSITIVE {
        return 0.0;
    }
    let error = (0..exact.len().max(found.len())).map(|entry| {
        let zero = Big::from_f64(0.0);
        exact.get(entry).unwrap_or(&zero).error_of(found.get(entry).copied().unwrap_or(0.0))
    });
    let error = error.fold(0.0, worse) / largest / (f64::EPSILON / 2.0);
    if error.is_nan() { f64::INFINITY } else { error }
}

/// Returns the value, all first derivatives, or all second ones.
fn derivatives<T: Number>(jet: &Jet<T>, order: usize) -> Vec<T> {
    let n = jet.coordinates();
    match order {
        0 => vec![jet.value.clone()],
        1 => (0..n).map(|i| jet.by(i)).collect(),
        _ => (0..n).flat_map(|i| (i..n).map(move |j| (i, j))).map(|(i, j)| jet.by_both(i, j)).collect(),
    }
}

/// Returns a spelling that keeps the digits, chosen by the functions of a subexpression.
fn proposal(part: &Part, declaration: &Declaration) -> String {
    let has = |text: &str| part.text.contains(text);
    let proposal = match part.function {
        "log" => "near 1, `log1p(y)` of y = x − 1 keeps the digits if y is computed without this subtraction",
        "exp" => "`expm1(x)` is exp(x) − 1 without cancellation",
        "singular_values" | "rotation_of" | "stretch_of" => {
            "use symmetric functions of all singular values, as in `sum(i in 0..3, f(s[i]))`; they stay smooth where \
             two of them meet"
        }
        "/" => "numerator and denominator vanish together: divide by their common factor on paper",
        "+" | "-" if has("norm(") && has("dot(") => {
            "‖a‖‖b‖ + a·b is ‖a × b‖² / (‖a‖‖b‖ − a·b) where a·b < 0: write the quotient, or `angle(a, b)`"
        }
        "+" | "-" if has("log(") => {
            "the terms cancel: `log1pmx(x)` is log(1 + x) − x without cancellation; write the rest in the strain \
             E = (FᵀF − I)/2"
        }
        "+" | "-" if has("exp(") => "the terms cancel: `expm1(x)` is exp(x) − 1 without cancellation",
        "+" | "-" if has("cos(") => "the terms cancel: `one_minus_cos(x)` is 1 − cos(x) without cancellation",
        "+" | "-" if has("sin(") => "the terms cancel: `x_minus_sin(x)` is x − sin(x) without cancellation",
        "+" | "-" if has("sqrt(") => "the terms cancel: √x − √y is (x − y)/(√x + √y)",
        "+" | "-" | "*" | "^" | "det" | "dot" | "ddot" | "trace" => {
            "the terms cancel: write them in a quantity that is small there, such as the strain E = (FᵀF − I)/2"
        }
        _ => {
            return format!("write it in a quantity that is small there, or state the domain: {}", domain(declaration));
        }
    };
    proposal.into()
}
