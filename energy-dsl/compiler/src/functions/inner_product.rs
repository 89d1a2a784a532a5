//! Inner products as primitives, so that derivatives are gathered at them: the six or nine coordinates of a membrane
//! enter its strain through three inner products.

use crate::graph::{Form, Graph, NodeId, Op, Primitive, Product, Rule, symmetric_index};

/// Creates Σ xᵢ yᵢ. For a vector with itself the primitive is half of it, whose derivatives x and 1 need no factors.
pub(super) fn inner_product(g: &mut Graph, x: &[NodeId], y: &[NodeId]) -> NodeId {
    if x == y
        && let Some(square) = super::rotation_vector::recognise_square(g, x)
    {
        return square;
    }
    // x·y and y·x are the same node.
    let (x, y) = if y < x { (y, x) } else { (x, y) };
    if let Some(quotient) = quotient(g, x, y) {
        return quotient;
    }
    let [a, b] = [x, y].map(|entries| entries.iter().map(|&entry| g.as_computed(entry)).collect::<Vec<_>>());
    let product = undivided(g, x, y);
    match quotient(g, &a, &b) {
        Some(quotient) => computed_by_quotient(g, product, quotient),
        None => product,
    }
}

/// Creates a product that is computed as an equal quotient. Derivatives are those of either, whichever are shorter.
fn computed_by_quotient(g: &mut Graph, product: NodeId, quotient: NodeId) -> NodeId {
    let (one, primitive) = (g.constant(1.0), Primitive::Quotient);
    let rule = Rule::factored(primitive, vec![product], quotient, vec![vec![one]], vec![Vec::new()]);
    g.add_rule(rule, &[])
}

/// Creates Σ xᵢ yᵢ as it is.
fn undivided(g: &mut Graph, x: &[NodeId], y: &[NodeId]) -> NodeId {
    let value = g.dot(x, y);
    let square = x == y;
    // Shared arguments would have to be summed, so such products follow the ordinary rules.
    let distinct = square || x.iter().all(|part| !y.contains(part));
    let moving = x.len() > 1 && x.iter().chain(y).all(|&part| g.varies(part));
    if g.form() == Form::Textbook || !moving || !distinct {
        return value;
    }
    if square {
        let (half_square, two) = (g.half_square(x), g.constant(2.0));
        return g.mul(two, half_square);
    }
    let (n, one) = (x.len(), g.constant(1.0));
    let arguments: Vec<NodeId> = [x, y].concat();
    let first: Vec<Product> = [y, x].concat().into_iter().map(|part| vec![part]).collect();
    let m = arguments.len();
    let mut second = vec![Vec::new(); m * (m + 1) / 2];
    (0..n).for_each(|i| second[symmetric_index(m, i, n + i)] = vec![vec![one]]);
    g.add_rule(Rule::factored(Primitive::InnerProduct, arguments, value, first, second), &[])
}

/// Returns (a·b)/(d e) for x = a/d and y = b/e, such as the entries of an inverse: one quotient has shorter derivatives
/// than each entry. `None` if neither has a common divisor that moves.
fn quotient(g: &mut Graph, x: &[NodeId], y: &[NodeId]) -> Option<NodeId> {
    if g.form() == Form::Textbook {
        return None;
    }
    let (a, b) = (over_common_divisor(g, x), over_common_divisor(g, y));
    if a.is_none() && b.is_none() {
        return None;
    }
    let one = g.constant(1.0);
    let (a, d) = a.unwrap_or_else(|| (x.to_vec(), one));
    let (b, e) = b.unwrap_or_else(|| (y.to_vec(), one));
    let (product, divisor) = (inner_product(g, &a, &b), g.mul(d, e));
    Some(g.div(product, divisor))
}

/// Returns the dividends and the divisor, if all entries are quotients with the same divisor, which moves.
fn over_common_divisor(g: &Graph, x: &[NodeId]) -> Option<(Vec<NodeId>, NodeId)> {
    let split = |&part: &NodeId| match g.op(part) {
        Op::Div(dividend, divisor) => Some((dividend, divisor)),
        // An entry of an inverse is a cofactor times the reciprocal of the determinant.
        Op::Mul(a, b) => [(a, b), (b, a)].into_iter().find_map(|(dividend, reciprocal)| match g.op(reciprocal) {
            Op::Div(one, divisor) if g.is(one, 1.0) => Some((dividend, divisor)),
            _ => None,
        }),
        _ => None,
    };
    let (_, common) = x.first().and_then(split).filter(|&(_, divisor)| x.len() > 1 && g.varies(divisor))?;
    let dividends: Option<Vec<NodeId>> = x
        .iter()
        .map(|part| split(part).filter(|&(_, divisor)| divisor == common).map(|(dividend, _)| dividend))
        .collect();
    Some((dividends?, common))
}
