//! The effect of each function on units.

use super::dimension::Dimension;
use super::infer::{Inference, Units};
use crate::check::typed::Typed;
use crate::diagnostic::Span;
use crate::functions::Shape;

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
pub(super) fn apply(inference: &mut Inference<'_>, call: &Call<'_>) -> Units {
    let number = || Units::one(Dimension::default());
    let all: Vec<&Units> = call.units.iter().collect();
    let size = match call.arguments[0].shape {
        Shape::Matrix(n, _) => f64::from(n),
        _ => 1.0,
    };
    match call.name {
        "+" | "-" | "min" | "max" | "clamp" | "columns" | "vector" => inference.same(call.name, &all, call.span),
        "<" | "<=" | ">" | ">=" | "==" | "!=" => {
            inference.same(call.name, &all, call.span);
            number()
        }
        "neg" | "abs" | "transpose" | "trace" | "conjugate" | "stretch_of" => call.units[0].clone(),
        "*" => product(inference, call),
        "dot" | "cross" | "outer" | "ddot" => scaled(call),
        "/" => call.units[0].map(|d| d.over(&call.main(1))),
        "^" => power(inference, call),
        "sqrt" => call.units[0].map(|d| d.power(0.5)),
        "norm_squared" => call.units[0].map(|d| d.power(2.0)),
        "det" => call.units[0].map(|d| d.power(size)),
        "adjugate" => call.units[0].map(|d| d.power(size - 1.0)),
        "inverse" | "power_of_two" | "scaled_adjugate" => call.units[0].map(|d| d.power(-1.0)),
        "huber" | "pseudo_huber" => inference.same(call.name, &all, call.span).map(|d| d.power(2.0)),
        "norm" => call.units[0].clone(),
        "unit" if call.is(0, Shape::DualQuat) => {
            Units::two(Dimension::default(), call.units[0].other().over(&call.main(0)))
        }
        "atan2" | "dihedral" => {
            inference.same(call.name, &all, call.span);
            number()
        }
        "unit" | "angle" | "sign" | "identity" | "rotation_of" | "scaled_det" => number(),
        "[]" => component(call),
        "exp" if call.is(0, Shape::Twist) => {
            inference.number("exp", &call.main(0), call.span);
            call.units[0].clone()
        }
        "quat" | "dual_quat" | "twist" | "angular" | "linear" | "real" | "dual" | "imaginary" | "rotate"
        | "transform" | "rotation" | "rotation_matrix" => of_motion(inference, call),
        "&&" | "||" => number(),
        // All other functions take plain numbers.
        _ => {
            for units in call.units {
                inference.number(call.name, &units.main(), call.span);
            }
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

fn of_motion(inference: &mut Inference<'_>, call: &Call<'_>) -> Units {
    let all: Vec<&Units> = call.units.iter().collect();
    match call.name {
        "quat" => inference.same("quat", &all, call.span),
        "dual_quat" | "twist" => Units::two(call.main(0), call.main(1)),
        "dual" | "linear" => Units::one(call.units[0].other()),
        "rotate" => {
            inference.number("rotate", &call.main(0), call.span);
            call.units[1].clone()
        }
        "transform" => {
            inference.number("transform", &call.main(0), call.span);
            let dual = Units::one(call.units[0].other());
            inference.same("transform", &[&dual, &call.units[1]], call.span)
        }
        "rotation" | "rotation_matrix" => {
            inference.number(call.name, &call.main(0), call.span);
            Units::one(Dimension::default())
        }
        // `real`, `angular` and `imaginary` return the first part.
        _ => Units::one(call.main(0)),
    }
}
