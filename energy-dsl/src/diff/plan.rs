use super::coordinates::Coordinates;
use super::{adjoint, forward};
use crate::graph::{Graph, NodeId, count, symmetric_index};

/// U, ∇U and the upper triangle of ∇²U in reduced coordinates.
#[derive(Clone, Debug)]
pub struct SecondOrder {
    /// U.
    pub value: NodeId,
    /// ∇U.
    pub gradient: Vec<NodeId>,
    /// ∇²U, upper triangle row by row.
    pub hessian: Vec<NodeId>,
}

/// First and second derivatives of a scalar by the route that needs less arithmetic.
pub fn second_order(g: &mut Graph, value: NodeId, coordinates: &Coordinates) -> SecondOrder {
    let n = coordinates.len();
    let zero = g.constant(0.0);
    let dense = |entries: std::collections::BTreeMap<usize, NodeId>| {
        let mut hessian = vec![zero; n * (n + 1) / 2];
        for (place, entry) in entries {
            hessian[symmetric_index(n, place / n, place % n)] = entry;
        }
        hessian
    };
    let gradients =
        [forward::first_derivatives(g, &[value], coordinates).remove(0), adjoint::gradient(g, value, coordinates)];
    let forward_hessian = dense(forward::second_derivatives(g, value, coordinates));
    let mut hessians = vec![forward_hessian];
    if let Some(entries) = adjoint::second_derivatives(g, value, coordinates) {
        hessians.push(dense(entries));
    }
    hessians
        .into_iter()
        .flat_map(|hessian| gradients.clone().map(|gradient| (gradient, hessian.clone())))
        .map(|(gradient, hessian)| SecondOrder { value, gradient, hessian })
        .min_by_key(|plan| {
            let outputs: Vec<_> = std::iter::once(plan.value)
                .chain(plan.gradient.iter().copied())
                .chain(plan.hessian.iter().copied())
                .collect();
            let operations = count(g, &outputs);
            // A division or root costs about as much as five products, a transcendental as twenty.
            operations.total() + 4 * operations.divisions_and_roots + 19 * operations.transcendental
        })
        .expect("the forward route always exists")
}
