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
pub(super) fn outside(g: &mut Graph, roots: &[(NodeId, u8)]) -> Option<NodeId> {
    let uses = Uses::of(g, roots.iter().map(|&(root, _)| root));
    let mut magnitudes = Magnitudes::default();
    let mut masks = Vec::new();
    for (node, used) in uses.0 {
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
        masks.push(g.and(mask, used));
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
pub(super) fn without_limit(g: &mut Graph, roots: &[(NodeId, u8)]) -> Option<NodeId> {
    let mut masks = BTreeSet::new();
    for &(root, order) in roots {
        for (node, used) in Uses::of(g, [root]).0 {
            let flags = g.rule(node).map(|rule| rule.flags.clone()).unwrap_or_default();
            for flag in flags.into_iter().filter(|flag| flag.definite && flag.order <= order) {
                masks.insert(g.and(flag.mask, used));
            }
        }
    }
    masks.into_iter().reduce(|a, b| g.or(a, b))
}

/// The operations of a formula, each with the mask where its result is used.
struct Uses(BTreeMap<NodeId, NodeId>);

impl Uses {
    fn of(g: &mut Graph, roots: impl IntoIterator<Item = NodeId>) -> Self {
        let roots: Vec<NodeId> = roots.into_iter().collect();
        let always = g.truth(true);
        let mut masks: BTreeMap<NodeId, NodeId> = roots.iter().map(|&root| (root, always)).collect();
        // Operands have smaller numbers than their users.
        for node in operations(g, &roots).into_iter().rev() {
            let Some(&used) = masks.get(&node) else { continue };
            let mut add = |g: &mut Graph, operand: NodeId, mask: NodeId| {
                let known = masks.get(&operand).copied();
                let mask = known.map_or(mask, |known| g.or(known, mask));
                masks.insert(operand, mask);
            };
            match (g.rule(node), g.op(node)) {
                (Some(rule), _) => {
                    let operands: Vec<NodeId> = rule.arguments.iter().chain(&rule.inner).copied().collect();
                    operands.into_iter().for_each(|operand| add(g, operand, used));
                }
                (None, Op::Select(mask, yes, no)) => {
                    let opposite = g.not(mask);
                    let (if_yes, if_no) = (g.and(used, mask), g.and(used, opposite));
                    [(yes, if_yes), (no, if_no)].into_iter().for_each(|(node, mask)| add(g, node, mask));
                }
                (None, op) => op.operands().for_each(|operand| add(g, operand, used)),
            }
        }
        Self(masks)
    }
}
