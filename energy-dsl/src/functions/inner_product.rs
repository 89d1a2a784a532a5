//! x·y as one primitive, so that derivatives can be gathered at inner products: a membrane's nine or six coordinates enter its
//! strain through three of them.

use crate::graph::{Form, Graph, NodeId, Primitive, Product, Rule, symmetric_index};

/// Σ xᵢ yᵢ.
pub(super) fn inner_product(g: &mut Graph, x: &[NodeId], y: &[NodeId]) -> NodeId {
    // One order for x·y and y·x.
    let (x, y) = if y < x { (y, x) } else { (x, y) };
    let value = g.dot(x, y);
    let moving = x.len() > 1 && x.iter().chain(y).all(|&part| g.varies(part));
    if g.form() == Form::Textbook || !moving {
        return value;
    }
    let (n, one, two) = (x.len(), g.constant(1.0), g.constant(2.0));
    let square = x == y;
    let arguments: Vec<NodeId> = if square { x.to_vec() } else { [x, y].concat() };
    let first: Vec<Product> = if square {
        x.iter().map(|&part| vec![two, part]).collect()
    } else {
        y.iter().chain(x).map(|&part| vec![part]).collect()
    };
    let m = arguments.len();
    let mut second = vec![Vec::new(); m * (m + 1) / 2];
    for i in 0..n {
        if square {
            second[symmetric_index(m, i, i)] = vec![vec![two]];
        } else {
            second[symmetric_index(m, i, n + i)] = vec![vec![one]];
        }
    }
    // Shared arguments would have to be summed: leave such products to the ordinary rules.
    let distinct = square || x.iter().all(|part| !y.contains(part));
    if !distinct {
        return value;
    }
    g.add_rule(Rule::factored(Primitive::InnerProduct, arguments, value, first, second), &[])
}
