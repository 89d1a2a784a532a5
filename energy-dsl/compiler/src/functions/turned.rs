//! Vectors that an unknown rotation turns. With a = R v and the increment δ of R,
//!
//! ```text
//! ∂a/∂δ = e × a,    ∂²a/∂δⱼ∂δₖ = ½ (eⱼ aₖ + eₖ aⱼ) − δⱼₖ a,
//! ```
//!
//! which takes a fraction of the operations that derivatives through the quaternion take. The same holds for Rᵀ v, with
//! the rows of R in place of the axes e and v in place of a's components.

use super::quaternion::rotated;
use crate::graph::{Form, Graph, NodeId, Op, Primitive, Product, Rule, upper};

/// Returns the vector turned by the quaternion, if that is an unknown rotation or its conjugate.
pub(super) fn turn(g: &mut Graph, q: &[NodeId], v: &[NodeId]) -> Option<Vec<NodeId>> {
    if g.form() == Form::Textbook {
        return None;
    }
    let (increments, backwards) = increments(g, q)?;
    let value = rotated(g, q, v);
    let (axes, along) = match backwards {
        // Row k of R, and the components of v.
        true => (rows(g, q), v.to_vec()),
        false => (identity(g), Vec::new()),
    };
    let moves = v.iter().any(|&part| g.varies(part));
    let columns: Vec<Vec<NodeId>> = if moves { images(g, q) } else { Vec::new() };
    let mut arguments = increments;
    if moves {
        arguments.extend_from_slice(v);
    }
    let turning = Turning { axes, along, columns, backwards };
    let parts: Vec<NodeId> = (0..3_u8)
        .map(|axis| {
            // Derivatives refer to all components, so they follow once all are there.
            let zero = g.constant(0.0);
            let count = arguments.len();
            let (first, second) = (vec![vec![zero]; count], vec![vec![vec![zero]]; count * (count + 1) / 2]);
            let primitive = Primitive::TurnedVector { axis, backwards };
            let rule = Rule::factored(primitive, arguments.clone(), value[usize::from(axis)], first, second);
            g.add_rule(rule, v)
        })
        .collect();
    for (axis, &part) in parts.iter().enumerate() {
        let (first, second) = turning.derivatives(g, &parts, axis);
        g.change_rule(part, |rule| {
            rule.first = first;
            rule.second = Some(second);
        });
    }
    Some(parts)
}

/// Returns the increments of an unknown rotation, and whether the quaternion is its conjugate.
fn increments(g: &Graph, q: &[NodeId]) -> Option<(Vec<NodeId>, bool)> {
    let backwards = matches!(g.op(q[1]), Op::Neg(_));
    let mut found: Option<Vec<NodeId>> = None;
    for (number, &part) in q.iter().enumerate() {
        let part = match g.op(part) {
            Op::Neg(part) if backwards && number > 0 => part,
            _ => part,
        };
        let rule = g.rule(part).filter(|rule| rule.primitive == Primitive::Turned(number as u8))?;
        if found.get_or_insert_with(|| rule.arguments.clone()) != &rule.arguments {
            return None;
        }
    }
    Some((found?, backwards))
}

fn identity(g: &mut Graph) -> Vec<Vec<NodeId>> {
    let (zero, one) = (g.constant(0.0), g.constant(1.0));
    (0..3).map(|row| (0..3).map(|column| if row == column { one } else { zero }).collect()).collect()
}

/// Returns the images of the axes: the columns of the matrix of a quaternion.
fn images(g: &mut Graph, q: &[NodeId]) -> Vec<Vec<NodeId>> {
    let axes = identity(g);
    axes.iter().map(|axis| turn(g, q, axis).expect("compiler bug: it is an unknown rotation")).collect()
}

/// Returns the rows of R, given the conjugate quaternion.
fn rows(g: &mut Graph, conjugate: &[NodeId]) -> Vec<Vec<NodeId>> {
    let mut q = vec![conjugate[0]];
    q.extend(conjugate[1..].iter().map(|&part| g.neg(part)));
    let columns = images(g, &q);
    (0..3).map(|row| columns.iter().map(|column| column[row]).collect()).collect()
}

/// The vectors that the derivatives of a turned vector consist of.
struct Turning {
    /// The axes of the increments, seen from where the result is: e, or the rows of R.
    axes: Vec<Vec<NodeId>>,
    /// Components of the vector along the axes; empty for those of the result.
    along: Vec<NodeId>,
    /// Derivatives of the result by the components of the vector; empty if it is constant.
    columns: Vec<Vec<NodeId>>,
    backwards: bool,
}

impl Turning {
    /// Returns the derivatives of component `axis` of the result `a`.
    fn derivatives(&self, g: &mut Graph, a: &[NodeId], axis: usize) -> (Vec<Product>, Vec<Vec<Product>>) {
        let count = 3 + self.columns.len();
        let mut first: Vec<Product> = (0..3).map(|k| vec![self.across(g, k, a, axis)]).collect();
        first.extend(self.columns.iter().map(|column| vec![column[axis]]));
        let second = upper(count)
            .map(|(j, k)| match (j < 3, k < 3) {
                (true, true) => self.bent(g, a, axis, j, k),
                (true, false) => vec![vec![self.across(g, j, &self.columns[k - 3], axis)]],
                _ => vec![vec![g.constant(0.0)]],
            })
            .collect();
        (first, second)
    }

    /// Returns a component of eₖ × a, or of a × cₖ.
    fn across(&self, g: &mut Graph, k: usize, a: &[NodeId], axis: usize) -> NodeId {
        let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
        let axes = &self.axes[k];
        let (plus, minus) = (g.mul(axes[i], a[j]), g.mul(axes[j], a[i]));
        if self.backwards { g.sub(minus, plus) } else { g.sub(plus, minus) }
    }

    /// Returns a component of ½ (cⱼ aₖ + cₖ aⱼ) − δⱼₖ a.
    fn bent(&self, g: &mut Graph, a: &[NodeId], axis: usize, j: usize, k: usize) -> Vec<Product> {
        let half = g.constant(0.5);
        let along = if self.backwards { &self.along } else { a };
        let mut sum: Vec<Product> = [(j, k), (k, j)].map(|(j, k)| vec![half, self.axes[j][axis], along[k]]).to_vec();
        if j == k {
            let minus = g.constant(-1.0);
            sum.push(vec![minus, a[axis]]);
        }
        sum
    }
}
