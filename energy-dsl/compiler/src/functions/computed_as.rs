//! Numbers that are computed by another expression than the one that defines them.

use super::elementary::two_scalars;
use super::{Function, Lowered, Units};
use crate::graph::{Form, Graph, NodeId};

pub(super) const FUNCTIONS: &[Function] = &[
    Function {
        name: "computed_as",
        usage: "computed_as(x, y)",
        docs: "x, computed as y. Both must be equal wherever y is used; y is the one with the smaller rounding error. \
               The value and its first derivatives are those of y; second derivatives are those of x, which are often \
               much shorter. The audit compares y with x in multi-precision arithmetic.",
        shape: two_scalars,
        units: Units::Same,
        lower: |g, a| Lowered::scalar(computed_as(g, a[0].node(), a[1].node(), true)),
        accuracy: "",
    },
    Function {
        name: "valued_as",
        usage: "valued_as(x, y)",
        docs: "Like `computed_as`, but only the value is that of y; all derivatives are those of x. An example near J \
               = 1, where ∇J does not cancel: `valued_as(J - 1, (A - A0) / A0)`.",
        shape: two_scalars,
        units: Units::Same,
        lower: |g, a| Lowered::scalar(computed_as(g, a[0].node(), a[1].node(), false)),
        accuracy: "",
    },
];

fn computed_as(g: &mut Graph, x: NodeId, y: NodeId, slopes: bool) -> NodeId {
    if g.form() == Form::Textbook { x } else { g.compute_as(x, y, slopes) }
}
