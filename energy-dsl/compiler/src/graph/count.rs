use super::{Graph, NodeId};
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
    reachable(graph, outputs).into_iter().for_each(|node| graph.fused(node).add_to(&mut count));
    count
}
