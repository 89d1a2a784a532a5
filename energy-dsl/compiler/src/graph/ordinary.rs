//! Splits off the path of ordinary configurations. Robust primitives scale their vectors and select other values where
//! a vector vanishes, which is rarely needed. Each such precaution has an [`Assumption`] under which it can be skipped
//! without changing a bit. One mask tells whether all assumptions hold.

use std::collections::{BTreeMap, BTreeSet};

use rustc_hash::FxHashMap;

use super::{Graph, NodeId, Op};

/// If `guard` holds, evaluated under the assumptions themselves, `node` equals `instead`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Assumption {
    /// The node with the precaution.
    pub node: NodeId,
    /// The node without the precaution.
    pub instead: NodeId,
    /// The mask under which both are equal.
    pub guard: NodeId,
}

impl Graph {
    /// Returns whether a mask is constant under the assumptions.
    pub(crate) fn is_decided(&mut self, mask: NodeId) -> bool {
        ordinary(self, &[mask]).is_some_and(|(masks, _)| matches!(self.op(masks[0]), Op::Truth(_)))
    }

    /// Returns all assumptions.
    pub(super) fn assumptions(&self) -> &[Assumption] {
        &self.assumptions
    }

    /// Records that `node` equals `instead` where `guard` holds.
    pub(crate) fn assume(&mut self, node: NodeId, instead: NodeId, guard: NodeId) {
        if node != instead && !self.assumptions.iter().any(|a| a.node == node) {
            self.assumptions.push(Assumption { node, instead, guard });
        }
    }
}

/// Returns `outputs` with all precautions.
pub fn general(g: &mut Graph, outputs: &[NodeId]) -> Vec<NodeId> {
    let mut path = Path::default();
    let (cautious, always) = (g.cautious(), g.truth(true));
    path.done.insert(cautious, always);
    outputs.iter().map(|&output| path.rebuild(g, output)).collect()
}

/// Returns `outputs` under all assumptions, and the mask where these hold; `None` without precautions.
pub fn ordinary(g: &mut Graph, outputs: &[NodeId]) -> Option<(Vec<NodeId>, NodeId)> {
    let mut path = Path { assumptions: g.assumptions.iter().map(|a| (a.node, *a)).collect(), ..Path::default() };
    let (cautious, never) = (g.cautious(), g.truth(false));
    path.done.insert(cautious, never);
    let outputs = outputs.iter().map(|&output| path.rebuild(g, output)).collect();
    // Guards may depend on further assumptions.
    let mut masks = BTreeMap::new();
    while let Some(&guard) = path.guards.iter().find(|guard| !masks.contains_key(*guard)) {
        let mask = path.rebuild(g, guard);
        masks.insert(guard, mask);
    }
    let guard = masks.into_values().collect::<BTreeSet<_>>().into_iter().reduce(|a, b| g.and(a, b))?;
    Some((outputs, guard))
}

/// A rebuilt copy of some expressions.
#[derive(Default)]
pub(super) struct Path {
    assumptions: FxHashMap<NodeId, Assumption>,
    /// The copy of each node.
    done: FxHashMap<NodeId, NodeId>,
    guards: BTreeSet<NodeId>,
}

impl Path {
    /// Replaces some nodes by others.
    pub(super) fn replacing(done: FxHashMap<NodeId, NodeId>) -> Self {
        Self { done, ..Self::default() }
    }

    /// Returns what a node has become, if it was rebuilt.
    pub(super) fn known(&self, node: NodeId) -> Option<NodeId> {
        self.done.get(&node).copied()
    }

    /// Rebuilds a node under the assumptions. Operands have smaller indices, so a stack of pending nodes suffices.
    /// Operands of a decided selection that it does not use are never visited.
    pub(super) fn rebuild(&mut self, g: &mut Graph, node: NodeId) -> NodeId {
        let node = g.resolve(node);
        let mut stack = vec![node];
        while let Some(&next) = stack.last() {
            if self.done.contains_key(&next) {
                stack.pop();
                continue;
            }
            if let Some(assumption) = self.assumptions.get(&next).copied() {
                self.guards.insert(assumption.guard);
                let instead = g.resolve(assumption.instead);
                match self.done.get(&instead) {
                    Some(&instead) => {
                        g.keep_name(next, instead);
                        self.done.insert(next, instead);
                    }
                    None => stack.push(instead),
                }
                continue;
            }
            let needed = self.needed(g, next);
            let missing: Vec<NodeId> = needed.into_iter().filter(|o| !self.done.contains_key(o)).collect();
            if missing.is_empty() {
                g.budget().spend(1, 0);
                let rebuilt = self.simplify(g, next);
                g.keep_name(next, rebuilt);
                self.done.insert(next, rebuilt);
                stack.pop();
            } else {
                stack.extend(missing);
            }
        }
        self.done[&node]
    }

    /// Returns the operands to rebuild first. For a selection that is the mask, then the branches it leaves open.
    fn needed(&self, g: &Graph, node: NodeId) -> Vec<NodeId> {
        let op = g.op(node);
        if let Op::Select(mask, yes, no) = op {
            let mask = g.resolve(mask);
            let Some(&known) = self.done.get(&mask) else { return vec![mask] };
            match g.op(known) {
                Op::Truth(true) => return vec![g.resolve(yes)],
                Op::Truth(false) => return vec![g.resolve(no)],
                _ => {}
            }
        }
        op.operands().map(|o| g.resolve(o)).collect()
    }

    fn simplify(&self, g: &mut Graph, node: NodeId) -> NodeId {
        let op = g.op(node);
        if let Op::Select(mask, yes, no) = op {
            let [mask, yes, no] = [mask, yes, no].map(|o| self.done.get(&g.resolve(o)).copied());
            let mask = mask.expect("a mask comes first");
            return match g.op(mask) {
                Op::Truth(true) => yes.expect("chosen"),
                Op::Truth(false) => no.expect("chosen"),
                _ => g.select(mask, yes.expect("open"), no.expect("open")),
            };
        }
        let rebuilt = op.with_operands(|o| self.done[&g.resolve(o)]);
        match (op, rebuilt) {
            (Op::Sub(a, _), Op::Sub(_, b)) if g.is(a, 0.0) => return g.minus_or_plus_zero(b),
            // Operands of an omitted scale are still rounded.
            (Op::Mul(a, b), Op::Mul(x, y)) | (Op::Div(a, b), Op::Div(x, y)) => {
                for (scale, scaled) in [(a, y), (b, x)] {
                    if g.is_scale(g.resolve(scale)) {
                        g.round(scaled);
                    }
                }
            }
            _ => {}
        }
        g.rebuilt(rebuilt)
    }
}
