//! The effect of each function on units.

use super::dimension::Dimension;
use super::infer::{Inference, Units};
use crate::check::typed::Typed;
use crate::diagnostic::Span;
use crate::functions::{Shape, Units as Rule};

/// A function with its arguments.
pub(super) struct Call<'a> {
    pub(super) name: &'static str,
    pub(super) arguments: &'a [Typed],
    pub(super) units: &'a [Units],
    pub(super) span: &'a Span,
    /// The constant value of the last argument.
    pub(super) constant: Option<f64>,
}

impl Call<'_> {
    /// Returns the first or only dimension of an argument.
    fn main(&self, argument: usize) -> Dimension {
        self.units[argument].main()
    }

    fn is(&self, argument: usize, shape: Shape) -> bool {
        self.arguments[argument].shape == shape
    }
}

/// Returns the units of the result.
pub(super) fn apply(inference: &mut Inference<'_>, call: &Call<'_>, rule: Rule) -> Units {
    let number = || Units::one(Dimension::default());
    let all: Vec<&Units> = call.units.iter().collect();
    match rule {
        Rule::Plain => {
            call.units.iter().for_each(|units| _ = inference.number(call.name, &units.main(), call.span));
            number()
        }
        Rule::Number => number(),
        Rule::Same => inference.same(call.name, &all, call.span),
        Rule::Compared => {
            inference.same(call.name, &all, call.span);
            number()
        }
        Rule::SquareOfSame => inference.same(call.name, &all, call.span).map(|d| d.power(2.0)),
        Rule::First => call.units[0].clone(),
        Rule::Power(_) if call.is(0, Shape::Motion) => call.units[0].clone(),
        Rule::Power(exponent) => call.units[0].map(|d| d.power(exponent)),
        Rule::PowerOfSize(more) => {
            let size = if let Shape::Matrix(n, _) = call.arguments[0].shape { f64::from(n) } else { 1.0 };
            call.units[0].map(|d| d.power(size + f64::from(more)))
        }
        Rule::Scaled => scaled(call),
        Rule::Product => product(inference, call),
        Rule::Quotient => call.units[0].map(|d| d.over(&call.main(1))),
        Rule::Raised => power(inference, call),
        Rule::Direction if call.is(0, Shape::DualQuat) => {
            Units::two(Dimension::default(), call.units[0].other().over(&call.main(0)))
        }
        Rule::Direction => number(),
        Rule::Exponential => {
            inference.number(call.name, &call.main(0), call.span);
            if call.is(0, Shape::Twist) { call.units[0].clone() } else { number() }
        }
        Rule::Component => component(call),
        Rule::Parts => Units::two(call.main(0), call.main(1)),
        Rule::FirstPart => Units::one(call.main(0)),
        Rule::SecondPart => Units::one(call.units[0].other()),
        Rule::Rotated => {
            inference.number(call.name, &call.main(0), call.span);
            call.units[1].clone()
        }
        Rule::Transformed => {
            inference.number(call.name, &call.main(0), call.span);
            let dual = Units::one(call.units[0].other());
            inference.same(call.name, &[&dual, &call.units[1]], call.span)
        }
        Rule::Interpolated => {
            let (values, places) = all.split_at(all.len() / 2);
            inference.same(call.name, places, call.span);
            inference.same(call.name, values, call.span)
        }
        Rule::Orientation => {
            inference.number(call.name, &call.main(0), call.span);
            number()
        }
    }
}

/// Returns the product of the dimensions of all arguments.
fn scaled(call: &Call<'_>) -> Units {
    let (a, b) = (&call.units[0], &call.units[1]);
    if a.0.len() > 1 { a.map(|d| d.times(&b.main())) } else { b.map(|d| a.main().times(d)) }
}

fn product(inference: &mut Inference<'_>, call: &Call<'_>) -> Units {
    let (a, b) = (&call.units[0], &call.units[1]);
    if call.is(0, Shape::Motion) && call.is(1, Shape::Motion) {
        return inference.same("*", &[a, b], call.span);
    }
    if !(call.is(0, Shape::DualQuat) && call.is(1, Shape::DualQuat)) {
        return scaled(call);
    }
    // p q + ε (p q′ + p′ q).
    let (one, other) = (a.main().times(&b.other()), a.other().times(&b.main()));
    let dual = inference.same("*", &[&Units::one(one), &Units::one(other)], call.span);
    Units::two(a.main().times(&b.main()), dual.main())
}

fn power(inference: &mut Inference<'_>, call: &Call<'_>) -> Units {
    if let Some(exponent) = call.constant {
        return call.units[0].map(|d| d.power(exponent));
    }
    // With an unknown exponent, only plain numbers can be raised.
    let exponent = inference.number("^", &call.main(1), &call.arguments[1].span);
    if exponent && inference.number("^", &call.main(0), call.span) {
        return Units::one(Dimension::default());
    }
    inference.fresh(call.arguments[0].shape)
}

fn component(call: &Call<'_>) -> Units {
    let half = call.arguments[0].shape.size() / 2;
    let second = call.constant.is_some_and(|index| index >= half as f64);
    Units::one(if second { call.units[0].other() } else { call.main(0) })
}
