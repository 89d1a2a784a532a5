//! The domain of a formula: where its logarithms, roots and powers have a value, and its primitives a limit.
//!
//! A branch of a selection counts only where it is taken. A condition has no domain: where it compares a number without
//! a value, it fails.

use std::collections::{BTreeMap, BTreeSet};

use super::hazards::operations;
use super::magnitude::Magnitudes;
use crate::graph::{Graph, NodeId, Op, Primitive};

/// Returns the mask where the argument of a logarithm, a root or a power is negative by more than its rounding errors;
/// `None` if that is impossible.
pub(super) fn outside(g: &mut Graph, uses: &Uses) -> Option<NodeId> {
    let mut magnitudes = Magnitudes::default();
    let mut masks = Vec::new();
    for (&node, used) in &uses.0 {
        let Some(argument) = domain(g, node) else { continue };
        let (zero, bound) = (g.constant(0.0), magnitudes.rounding_bound(g, argument));
        let least = g.sub(zero, bound);
        let mut mask = g.less(argument, least);
        if let Op::Pow(..) = g.op(node) {
            // A negative number has powers with an integer exponent.
            let is_number = g.equal(node, node);
            let undefined = g.not(is_number);
            mask = g.and(mask, undefined);
        }
        masks.push(g.and(mask, used.mask));
    }
    masks.into_iter().reduce(|a, b| g.or(a, b))
}

/// Returns the number that must not be negative for an operation to have a value; `None` if any number may do.
fn domain(g: &mut Graph, node: NodeId) -> Option<NodeId> {
    let argument = match g.rule(node) {
        Some(rule) if matches!(rule.primitive, Primitive::Log1p | Primitive::Log1pmx) => {
            let (argument, one) = (rule.arguments[0], g.constant(1.0));
            g.add(one, argument)
        }
        Some(_) => return None,
        None => match g.op(node) {
            Op::Ln(a) | Op::Sqrt(a) | Op::Pow(a, _) => a,
            _ => return None,
        },
    };
    g.as_constant(argument).is_none().then_some(argument)
}

/// Returns the mask where a primitive is a convention without a limit; `None` if that is impossible.
pub(super) fn without_limit(g: &mut Graph, uses: &Uses) -> Option<NodeId> {
    let mut masks = BTreeSet::new();
    for (&node, used) in &uses.0 {
        let flags = g.rule(node).map(|rule| rule.flags.clone()).unwrap_or_default();
        for flag in flags.into_iter().filter(|flag| flag.definite && flag.order <= used.order) {
            let used = if flag.order == 0 { used.mask } else { used.moving };
            masks.insert(g.and(flag.mask, used));
        }
    }
    masks.into_iter().reduce(|a, b| g.or(a, b))
}

/// The use of an operation's result.
#[derive(Clone, Copy)]
pub(super) struct Use {
    /// Where it is used.
    pub(super) mask: NodeId,
    /// Where its derivatives are used.
    pub(super) moving: NodeId,
    /// The highest order of its derivatives.
    pub(super) order: u8,
}

/// The operations of formulas that are differentiated up to some order. A robust primitive counts as one.
pub(super) struct Uses(BTreeMap<NodeId, Use>);

impl Uses {
    pub(super) fn of(g: &mut Graph, roots: &[(NodeId, u8)]) -> Self {
        let (always, mut uses) = (g.truth(true), Self(BTreeMap::new()));
        roots.iter().for_each(|&(root, order)| uses.add(g, root, Use { mask: always, moving: always, order }));
        let roots: Vec<NodeId> = roots.iter().map(|&(root, _)| root).collect();
        // Operands have smaller numbers than their users.
        for node in operations(g, &roots).into_iter().rev() {
            let Some(&used) = uses.0.get(&node) else { continue };
            match (g.rule(node), g.op(node)) {
                (Some(rule), _) => {
                    let operands: Vec<NodeId> = rule.arguments.iter().chain(&rule.inner).copied().collect();
                    operands.into_iter().for_each(|operand| uses.add(g, operand, used));
                }
                (None, Op::Select(mask, yes, no)) => {
                    let opposite = g.not(mask);
                    for (branch, taken) in [(yes, mask), (no, opposite)] {
                        let [mask, moving] = [used.mask, used.moving].map(|used| g.and(used, taken));
                        uses.add(g, branch, Use { mask, moving, ..used });
                    }
                }
                (None, Op::Min(a, b) | Op::Max(a, b)) => {
                    let is_max = matches!(g.op(node), Op::Max(..));
                    for (operand, other) in [(a, b), (b, a)] {
                        // The derivatives of the other operand are taken.
                        let left = if is_max { g.less(operand, other) } else { g.less(other, operand) };
                        let taken = g.not(left);
                        let moving = g.and(used.moving, taken);
                        uses.add(g, operand, Use { moving, ..used });
                    }
                }
                (None, op) => op.operands().for_each(|operand| uses.add(g, operand, used)),
            }
        }
        uses
    }

    /// Returns the use of one of the operations. `None` if only conditions use it.
    pub(super) fn of_node(&self, node: NodeId) -> Option<Use> {
        self.0.get(&node).copied()
    }

    fn add(&mut self, g: &mut Graph, node: NodeId, used: Use) {
        let joined = match self.0.get(&node) {
            Some(&Use { mask, moving, order }) => {
                Use { mask: g.or(mask, used.mask), moving: g.or(moving, used.moving), order: order.max(used.order) }
            }
            None => used,
        };
        self.0.insert(node, joined);
    }
}
