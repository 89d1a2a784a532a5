//! Derivatives of B = F⁻¹. For F = D R with a constant matrix R, and Z = R B, they are δB = −B δD Z and
//! δ²B = 2 B δD Z δD Z.
//!
//! Weighted sums of them are shorter than each: with M = Bᵀ W Zᵀ, Σ w δB = −M : δD, and the second derivatives are
//! Z_jk M_il + Z_li M_kj for D_ij and D_kl.

use crate::graph::{Contraction, Form, Graph, NodeId, Op, Origin, Primitive, Product, Rule, upper};

/// Returns whether the entries of F⁻¹ are primitives. Only 3×3 matrices need them: for other sizes, the derivatives are
/// short anyway. The entries of F must be linear functions: the derivatives of B have its errors, which follow from
/// those of F. The inverse of FᵀF or of a rotation may be far better conditioned than the entries suggest.
pub(super) fn has_primitives(g: &Graph, f: &[NodeId]) -> bool {
    g.form() == Form::Robust && f.len() == 9 && f.iter().any(|&entry| g.varies(entry)) && g.are_linear(f)
}

/// Returns the entries of F⁻¹, row by row, as primitives of the entries of F, or of D if F = D R.
pub(super) fn primitives(g: &mut Graph, f: &[NodeId], b: Vec<NodeId>) -> Vec<NodeId> {
    let (arguments, z) = match g.origin(f).cloned() {
        Some(Origin::Deformed { moving, constant }) => (moving, product(g, &constant, &b)),
        _ => (f.to_vec(), b.clone()),
    };
    let minus: Vec<NodeId> = b.iter().map(|&entry| g.neg(entry)).collect();
    let primitive = |entry: usize| {
        let (p, q) = (entry / 3, entry % 3);
        let first = (0..9).map(|x| vec![minus[3 * p + x / 3], z[3 * (x % 3) + q]]).collect();
        let second = upper(9).map(|(x, y)| {
            let ((i, j), (k, l)) = ((x / 3, x % 3), (y / 3, y % 3));
            let through = |i, j, k, l| vec![b[3 * p + i], z[3 * j + k], z[3 * l + q]];
            vec![through(i, j, k, l), through(k, l, i, j)]
        });
        let number = u8::try_from(entry).expect("nine entries");
        let rule = Rule::factored(Primitive::Inverse(number), arguments.clone(), b[entry], first, second.collect());
        g.add_rule(Rule { inner: Some(b[entry]), ..rule }, &b)
    };
    let values: Vec<NodeId> = (0..9).map(primitive).collect();
    let factors = [&b[..], &z].concat();
    let (family, values_of) = (Primitive::Inverse(0), values.clone());
    g.note_contraction(Contraction {
        family,
        fewest: 2,
        values: values_of,
        arguments,
        factors,
        first: Some(first),
        second,
    });
    values
}

fn places() -> impl Iterator<Item = (usize, usize)> {
    (0..3).flat_map(|i| (0..3).map(move |j| (i, j)))
}

fn column(of: &[NodeId], j: usize) -> [NodeId; 3] {
    [of[j], of[3 + j], of[6 + j]]
}

/// Returns A B.
fn product(g: &mut Graph, a: &[NodeId], b: &[NodeId]) -> Vec<NodeId> {
    places().map(|(i, j)| g.dot(&a[3 * i..][..3], &column(b, j))).collect()
}

/// Returns M = Bᵀ W Zᵀ.
fn pulled(g: &mut Graph, b: &[NodeId], z: &[NodeId], weights: &[NodeId]) -> Vec<NodeId> {
    // A factor of all weights multiplies Bᵀ W: without it, that is often symmetric.
    let (common, weights) = common_factor(g, weights);
    let left: Vec<NodeId> = places().map(|(i, q)| g.dot(&column(b, i), &column(&weights, q))).collect();
    let left = g.scaled(common, &left);
    places().map(|(i, l)| g.dot(&left[3 * i..][..3], &z[3 * l..][..3])).collect()
}

/// Returns a factor of all numbers, and the other factors.
fn common_factor(g: &mut Graph, numbers: &[NodeId]) -> (NodeId, Vec<NodeId>) {
    let split = |&number: &NodeId| match g.op(number) {
        Op::Mul(a, b) => vec![(a, b), (b, a)],
        _ => Vec::new(),
    };
    let factors: Vec<Vec<(NodeId, NodeId)>> = numbers.iter().map(split).collect();
    for &(common, _) in &factors[0] {
        let others = factors.iter().map(|of| of.iter().find(|(factor, _)| *factor == common).map(|&(_, other)| other));
        if let Some(others) = others.collect::<Option<Vec<NodeId>>>() {
            let (further, others) = common_factor(g, &others);
            return (g.mul(common, further), others);
        }
    }
    // Entries of B as numbers: nothing differentiates them any more.
    (g.constant(1.0), numbers.iter().map(|&number| g.as_computed(number)).collect())
}

fn first(g: &mut Graph, factors: &[NodeId], weights: &[NodeId]) -> Vec<NodeId> {
    let (b, z) = factors.split_at(9);
    pulled(g, b, z, weights).into_iter().map(|entry| g.neg(entry)).collect()
}

fn second(g: &mut Graph, factors: &[NodeId], weights: &[NodeId]) -> Vec<Vec<Product>> {
    let (b, z) = factors.split_at(9);
    let m = pulled(g, b, z, weights);
    let entry = |xy: usize| {
        let ((i, j), (k, l)) = ((xy / 27, xy / 9 % 3), (xy / 3 % 3, xy % 3));
        vec![vec![z[3 * j + k], m[3 * i + l]], vec![z[3 * l + i], m[3 * k + j]]]
    };
    (0..81).map(entry).collect()
}
