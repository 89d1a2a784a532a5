//! Comparisons for the condition of `if`.

use super::{Function, Lowered, Shape, Units};
use crate::graph::Graph;

pub(super) const FUNCTIONS: &[Function] = &[
    Function {
        name: "<",
        usage: "a < b",
        docs: "Less than.",
        shape: compare,
        units: Units::Compared,
        lower: less,
        accuracy: "",
    },
    Function {
        name: "<=",
        usage: "a <= b",
        docs: "Less than or equal to.",
        shape: compare,
        units: Units::Compared,
        lower: less_or_equal,
        accuracy: "",
    },
    Function {
        name: ">",
        usage: "a > b",
        docs: "Greater than.",
        shape: compare,
        units: Units::Compared,
        lower: greater,
        accuracy: "",
    },
    Function {
        name: ">=",
        usage: "a >= b",
        docs: "Greater than or equal to.",
        shape: compare,
        units: Units::Compared,
        lower: greater_or_equal,
        accuracy: "",
    },
    Function {
        name: "==",
        usage: "a == b",
        docs: "Exactly equal.",
        shape: compare,
        units: Units::Compared,
        lower: equal,
        accuracy: "",
    },
    Function {
        name: "!=",
        usage: "a != b",
        docs: "Not equal.",
        shape: compare,
        units: Units::Compared,
        lower: not_equal,
        accuracy: "",
    },
    Function {
        name: "&&",
        usage: "p && q",
        docs: "Both conditions hold.",
        shape: connect,
        units: Units::Number,
        lower: and,
        accuracy: "",
    },
    Function {
        name: "||",
        usage: "p || q",
        docs: "At least one condition \
        holds.",
        shape: connect,
        units: Units::Number,
        lower: or,
        accuracy: "",
    },
];

fn compare(shapes: &[Shape]) -> Result<Shape, String> {
    match *shapes {
        [Shape::Scalar, Shape::Scalar] => Ok(Shape::Truth),
        [a, b] => Err(format!("only scalars can be compared, but these are {a} and {b}")),
        _ => Err("takes two operands".into()),
    }
}

fn connect(shapes: &[Shape]) -> Result<Shape, String> {
    match *shapes {
        [Shape::Truth, Shape::Truth] => Ok(Shape::Truth),
        [a, b] => Err(format!("connects two comparisons, but these are {a} and {b}")),
        _ => Err("takes two operands".into()),
    }
}

fn less(g: &mut Graph, a: &[Lowered]) -> Lowered {
    Lowered::truth(g.less(a[0].node(), a[1].node()))
}

fn less_or_equal(g: &mut Graph, a: &[Lowered]) -> Lowered {
    Lowered::truth(g.less_or_equal(a[0].node(), a[1].node()))
}

fn greater(g: &mut Graph, a: &[Lowered]) -> Lowered {
    Lowered::truth(g.less(a[1].node(), a[0].node()))
}

fn greater_or_equal(g: &mut Graph, a: &[Lowered]) -> Lowered {
    Lowered::truth(g.less_or_equal(a[1].node(), a[0].node()))
}

fn equal(g: &mut Graph, a: &[Lowered]) -> Lowered {
    Lowered::truth(g.equal(a[0].node(), a[1].node()))
}

fn not_equal(g: &mut Graph, a: &[Lowered]) -> Lowered {
    let equal = g.equal(a[0].node(), a[1].node());
    Lowered::truth(g.not(equal))
}

fn and(g: &mut Graph, a: &[Lowered]) -> Lowered {
    Lowered::truth(g.and(a[0].node(), a[1].node()))
}

fn or(g: &mut Graph, a: &[Lowered]) -> Lowered {
    Lowered::truth(g.or(a[0].node(), a[1].node()))
}
