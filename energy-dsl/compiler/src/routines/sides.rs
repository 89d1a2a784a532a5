//! Kinks that derivatives do not notice, as that of max(t, 0)³.

use std::cmp::Ordering;
use std::collections::BTreeMap;

use crate::diff::{Coordinates, Order, first_derivatives, second_derivatives};
use crate::graph::{Graph, NodeId, Op, Substitution};

/// Formulas, each up to an order of its derivatives, and where their sides were compared.
pub(super) struct Sides<'a> {
    roots: &'a [(NodeId, u8)],
    known: BTreeMap<[NodeId; 2], bool>,
}

impl<'a> Sides<'a> {
    pub(super) fn new(roots: &'a [(NodeId, u8)]) -> Self {
        Self { roots, known: BTreeMap::new() }
    }

    /// Returns whether the sides of t = c agree. Several operations may compare the same numbers.
    pub(super) fn agree(&mut self, g: &Graph, t: NodeId, c: NodeId) -> bool {
        let roots = self.roots;
        *self.known.entry([t, c]).or_insert_with(|| agree(g, roots, t, c))
    }
}

/// Returns whether formulas and their derivatives, up to the given orders, are the same at t = c and on both sides of it,
/// as far as comparisons of t with c decide.
///
/// Each formula is a function of t and of the other inputs. If it and its first two derivatives by t are the same
/// expressions for all outcomes of these comparisons, then so are all derivatives by other inputs.
fn agree(g: &Graph, roots: &[(NodeId, u8)], t: NodeId, c: NodeId) -> bool {
    // What this creates must not count among the nodes of the routines.
    let mut g = g.clone();
    roots.iter().all(|&(root, order)| {
        let expressions = derivatives(&mut g, root, order, t);
        let [below, at, above] =
            [Ordering::Less, Ordering::Equal, Ordering::Greater].map(|side| limits(&mut g, &expressions, t, c, side));
        below == at && at == above
    })
}

/// Returns a formula and its derivatives by t up to an order.
fn derivatives(g: &mut Graph, root: NodeId, order: u8, t: NodeId) -> Vec<NodeId> {
    let along = Coordinates::of_nodes(g, &[t]);
    let mut all = vec![root];
    if order >= 1 {
        all.extend(first_derivatives(g, &[root], &along, Order::First).concat());
    }
    if order >= 2 {
        all.extend(second_derivatives(g, root, &along).into_values());
    }
    all
}

/// Returns expressions for t → c, where comparisons find t on this side of c.
fn limits(g: &mut Graph, expressions: &[NodeId], t: NodeId, c: NodeId, side: Ordering) -> Vec<NodeId> {
    let outcomes = [
        (Op::Less(t, c), side.is_lt()),
        (Op::Precedes(t, c), side.is_lt()),
        (Op::LessOrEqual(t, c), side.is_le()),
        (Op::Less(c, t), side.is_gt()),
        (Op::Precedes(c, t), side.is_gt()),
        (Op::LessOrEqual(c, t), side.is_ge()),
        (Op::Equal(t.min(c), t.max(c)), side.is_eq()),
    ];
    let replaced = outcomes.map(|(comparison, outcome)| (g.rebuilt(comparison), g.truth(outcome)));
    let mut substitution = Substitution::new(g, replaced.into_iter().chain([(t, c)]));
    expressions.iter().map(|&node| substitution.of(g, node)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::graph::Input;

    /// Returns the highest order up to which a function of t is the same on both sides of t = 0, in two forms.
    fn order_of(formula: impl Fn(&mut Graph, NodeId, NodeId) -> NodeId) -> Option<u8> {
        let orders = [Graph::robust(&[]), Graph::textbook()].map(|mut g| {
            let [t, y] = [0, 1].map(|number| g.input(Input::Position(number)));
            let root = formula(&mut g, t, y);
            let zero = g.constant(0.0);
            let nodes = g.len();
            let found = (0..=2).rev().find(|&order| agree(&g, &[(root, order)], t, zero));
            assert_eq!(g.len(), nodes);
            found
        });
        assert_eq!(orders[0], orders[1]);
        orders[0]
    }

    fn power(g: &mut Graph, a: NodeId, exponent: usize) -> NodeId {
        (1..exponent).fold(a, |product, _| g.mul(product, a))
    }

    #[test]
    fn powers_of_one_sided_parts_are_smooth() {
        let of_max = |exponent| {
            order_of(|g, t, y| {
                let zero = g.constant(0.0);
                let part = g.max(t, zero);
                let power = power(g, part, exponent);
                g.mul(power, y)
            })
        };
        assert_eq!([1, 2, 3, 4].map(of_max), [Some(0), Some(1), Some(2), Some(2)]);
        // t |t|, and t² |t|.
        let of_abs = |exponent| {
            order_of(|g, t, _| {
                let (size, power) = (g.abs(t), power(g, t, exponent));
                g.mul(size, power)
            })
        };
        assert_eq!([1, 2].map(of_abs), [Some(1), Some(2)]);
    }

    #[test]
    fn branches_are_compared() {
        // y t² on one side, t³ or y t² + 1 on the other.
        let select = |shift: f64| {
            order_of(move |g, t, y| {
                let (zero, shift) = (g.constant(0.0), g.constant(shift));
                let (square, negative) = (g.mul(t, t), g.less(t, zero));
                let (one, cube) = (g.mul(square, y), g.mul(square, t));
                let other = if g.is(shift, 0.0) { cube } else { g.add(one, shift) };
                g.select(negative, one, other)
            })
        };
        assert_eq!([select(0.0), select(1.0)], [Some(1), None]);
        // An exception at t = 0 has other derivatives than its surroundings.
        let exception = order_of(|g, t, y| {
            let zero = g.constant(0.0);
            let (square, here) = (g.mul(t, t), g.equal(t, zero));
            let term = g.mul(square, y);
            g.select(here, zero, term)
        });
        assert_eq!(exception, Some(1));
        // Another condition stays open.
        let open = order_of(|g, t, y| {
            let zero = g.constant(0.0);
            let (part, positive) = (g.min(t, zero), g.less(zero, y));
            let cube = power(g, part, 3);
            g.select(positive, cube, t)
        });
        assert_eq!(open, Some(2));
    }
}
