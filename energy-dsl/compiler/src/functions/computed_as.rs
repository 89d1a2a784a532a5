//! A number that is computed by another expression than the one that defines it.

use super::elementary::two_scalars;
use super::{Function, Lowered, Units};
use crate::graph::{Form, Graph, NodeId};

pub(super) const FUNCTIONS: &[Function] = &[Function {
    name: "computed_as",
    usage: "computed_as(x, y)",
    docs: "x, computed as y. Both must be equal wherever y is used; y is the one with the smaller rounding error. The \
           value and its first derivatives are those of y; second derivatives are those of x, which is often much \
           shorter and whose second derivatives need no precaution. The audit compares y with x in multi-precision \
           arithmetic. Example: `computed_as(J - 1, (I + r) / (J + 1))` near J = 1.",
    shape: two_scalars,
    units: Units::Same,
    lower: |g, a| Lowered::scalar(computed_as(g, a[0].node(), a[1].node())),
    accuracy: "",
}];

fn computed_as(g: &mut Graph, x: NodeId, y: NodeId) -> NodeId {
    if g.form() == Form::Textbook {
        return x;
    }
    g.compute_as(x, y)
}
