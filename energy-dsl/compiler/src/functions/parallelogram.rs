//! ‖a × b‖, the area of the parallelogram of a and b. With r = ‖a × b‖ and n = (a × b)/r: ∂r/∂a = b × n, ∂r/∂b = n × a,
//! ∂²r/∂a² = (b·b/r) n nᵀ, ∂²r/∂b² = (a·a/r) n nᵀ and ∂²r/∂aᵢ∂bⱼ = εᵢⱼₖ nₖ − (a·b/r) nᵢ nⱼ.

use crate::graph::{Graph, NodeId, Origin, Product, symmetric_index, upper};

/// Returns a and b if `d` is their cross product and all their components are independent.
pub(super) fn edges(g: &Graph, d: &[NodeId]) -> Option<[Vec<NodeId>; 2]> {
    let Origin::Cross([a, b]) = g.origin(d)? else { return None };
    let all = [&a[..], b].concat();
    let distinct = all.iter().enumerate().all(|(i, x)| !all[..i].contains(x));
    (distinct && all.iter().all(|&x| g.varies(x))).then(|| [a.clone(), b.clone()])
}

/// Returns the first and second derivatives of r with respect to the components of a, then b; `per_length` is 1/r.
pub(super) fn derivatives(
    g: &mut Graph,
    [a, b]: &[Vec<NodeId>; 2],
    n: &[NodeId],
    per_length: NodeId,
) -> (Vec<Product>, Vec<Vec<Product>>) {
    let slopes = [g.fused_cross(b, n), g.fused_cross(n, a)];
    let first = slopes.iter().flatten().map(|&slope| vec![slope]).collect();
    let mut bent = |x: &[NodeId], y: &[NodeId]| {
        let product = g.dot(x, y);
        g.mul(product, per_length)
    };
    let (by_a, by_b, mixed) = (bent(b, b), bent(a, a), bent(a, b));
    let mixed = g.neg(mixed);
    let mut second = vec![Vec::new(); 21];
    for (offset, weight) in [(0, by_a), (3, by_b)] {
        for (i, j) in upper(3) {
            second[symmetric_index(6, offset + i, offset + j)] = vec![vec![weight, n[i], n[j]]];
        }
    }
    for i in 0..3 {
        for j in 0..3 {
            let mut terms = vec![vec![mixed, n[i], n[j]]];
            match (j + 3 - i) % 3 {
                1 => terms.push(vec![n[3 - i - j]]),
                2 => terms.push(vec![g.neg(n[3 - i - j])]),
                _ => {}
            }
            second[symmetric_index(6, i, 3 + j)] = terms;
        }
    }
    (first, second)
}
