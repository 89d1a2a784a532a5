use super::{Graph, NodeId, Op};
use energy_runtime::OperationCount;

/// Returns the nodes needed to compute `outputs`, in topological order. Rules are replaced by their values.
#[must_use]
pub fn reachable(graph: &Graph, outputs: &[NodeId]) -> Vec<NodeId> {
    let mut is_needed = vec![false; graph.len()];
    let mut stack: Vec<NodeId> = outputs.iter().map(|&o| graph.resolve(o)).collect();
    while let Some(node) = stack.pop() {
        if !std::mem::replace(&mut is_needed[node.0 as usize], true) {
            stack.extend(graph.fused(node).operands().map(|o| graph.resolve(o)));
        }
    }
    graph.budget().spend(graph.len() as u64 / 8, 0);
    (0..).zip(is_needed).filter(|(_, is_needed)| *is_needed).map(|(number, _)| NodeId(number)).collect()
}

/// Counts the operations needed to compute `outputs`.
#[must_use]
pub fn count(graph: &Graph, outputs: &[NodeId]) -> OperationCount {
    let mut count = OperationCount::default();
    for node in reachable(graph, outputs) {
        match graph.fused(node) {
            Op::Constant(_) | Op::Truth(_) | Op::Cautious | Op::Pi | Op::Input(_) => {}
            Op::Rule(_) => unreachable!("resolved"),
            Op::Div(..) | Op::Sqrt(_) => count.divisions_and_roots += 1,
            Op::Sin(_) | Op::Cos(_) | Op::Exp(_) | Op::Ln(_) | Op::Atan2(..) | Op::ModerateAtan2(..) | Op::Pow(..) => {
                count.transcendental += 1
            }
            Op::SumError(..) | Op::DifferenceError(..) | Op::ProductError(..) | Op::RootError(..) => {
                count.error_terms += 1
            }
            // Counts the product here; its error term is counted apart.
            Op::FusedMulSub(..) => {
                count.basic += 1;
                count.error_terms += 1;
            }
            Op::MulAdd(..) | Op::MulSub(..) | Op::NegMulAdd(..) | Op::NegMulSub(..) => count.fused += 1,
            _ => count.basic += 1,
        }
    }
    count
}
