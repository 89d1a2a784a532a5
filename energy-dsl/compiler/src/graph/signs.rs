//! Signs of results. Constructors move signs outwards, where they meet. The remaining ones precede whole products, and
//! are cheaper before a factor that several products share.

use std::collections::BTreeMap;

use super::{Graph, NodeId, Op, reachable};

/// Moves the signs of `outputs` into factors where that leaves fewer of them. No bit changes.
pub fn with_signs_inside(g: &mut Graph, outputs: &[NodeId]) -> Vec<NodeId> {
    // The new nodes must not influence which product is fused: other routines share the sums.
    let users = g.users.clone();
    let outputs = moved(g, outputs);
    g.users[..users.len()].copy_from_slice(&users);
    outputs
}

fn moved(g: &mut Graph, outputs: &[NodeId]) -> Vec<NodeId> {
    let mut open = negative_products(g, outputs);
    let mut instead = BTreeMap::new();
    while let Some(factor) = most_common_factor(&open) {
        let minus = g.neg(factor);
        let (with, without): (Vec<_>, Vec<_>) = open.into_iter().partition(|(_, factors)| factors.contains(&factor));
        for (output, [a, b]) in with {
            let other = if a == factor { b } else { a };
            instead.insert(output, g.signed_product(minus, other));
        }
        open = without;
    }
    outputs.iter().map(|&output| *instead.get(&g.resolve(output)).unwrap_or(&output)).collect()
}

/// Returns the outputs −a·b whose product has no other use.
fn negative_products(g: &Graph, outputs: &[NodeId]) -> Vec<(NodeId, [NodeId; 2])> {
    let mut reads: BTreeMap<NodeId, usize> = BTreeMap::new();
    for node in reachable(g, outputs) {
        g.fused(node).operands().for_each(|operand| *reads.entry(g.resolve(operand)).or_default() += 1);
    }
    let mut outputs: Vec<NodeId> = outputs.iter().map(|&output| g.resolve(output)).collect();
    outputs.sort_unstable();
    outputs.dedup();
    let product = |output: NodeId| {
        let Op::Neg(product) = g.op(output) else { return None };
        let alone = reads.get(&product) == Some(&1) && !reads.contains_key(&output) && !outputs.contains(&product);
        match g.op(product) {
            Op::Mul(a, b) if alone && a != b => Some((output, [a, b])),
            _ => None,
        }
    };
    outputs.iter().filter_map(|&output| product(output)).collect()
}

/// Returns the factor that most products share, if several do; the oldest of equals.
fn most_common_factor(products: &[(NodeId, [NodeId; 2])]) -> Option<NodeId> {
    let mut uses: BTreeMap<NodeId, usize> = BTreeMap::new();
    products.iter().flat_map(|(_, factors)| factors).for_each(|&factor| *uses.entry(factor).or_default() += 1);
    let most = uses.values().copied().max().filter(|&most| most > 1)?;
    uses.into_iter().find(|&(_, n)| n == most).map(|(factor, _)| factor)
}
