//! Natural cubic splines through the numbers of a table: twice continuously differentiable, and linear beyond both ends.

use super::{Function, Lowered, Shape, Units};
use crate::graph::{Form, Graph, NodeId, Primitive, Rule};

pub(super) const FUNCTIONS: &[Function] = &[Function {
    name: "interpolate",
    usage: "interpolate(K, t) or interpolate(K, x, t)",
    docs: "The natural cubic spline through the numbers of the array K at t = 0, 1, 2, …, or at the increasing numbers of \
           the array x. It has two continuous derivatives, and is linear beyond both ends.",
    shape: |shapes| match shapes.len() {
        5.. if shapes.len() % 2 == 1 && shapes.iter().all(|&shape| shape == Shape::Scalar) => Ok(Shape::Scalar),
        _ => Err("takes arrays of two numbers or more, and a number".into()),
    },
    units: Units::Interpolated,
    lower: |g, a| {
        let nodes: Vec<NodeId> = a.iter().map(Lowered::node).collect();
        let (table, t) = nodes.split_at(nodes.len() - 1);
        let (values, knots) = table.split_at(table.len() / 2);
        Lowered::scalar(interpolated(g, values, knots, t[0]))
    },
    accuracy: "",
}];

/// A part of a spline between two knots: their places, the values and the second derivatives there.
type Piece = [NodeId; 6];

fn interpolated(g: &mut Graph, values: &[NodeId], knots: &[NodeId], t: NodeId) -> NodeId {
    let pieces = pieces(g, values, knots);
    let piece = found(g, &pieces, knots, t);
    let [value, slope, curvature] = evaluated(g, piece, t);
    let table_varies = values.iter().chain(knots).any(|&number| g.varies(number));
    if g.form() == Form::Textbook || table_varies {
        return value;
    }
    // Nothing jumps at a knot up to the second derivative, so that none needs a closer look.
    let rule = Rule::smooth(Primitive::Spline, vec![t], value, vec![slope], vec![curvature]);
    let table: Vec<NodeId> = values.iter().chain(knots).copied().collect();
    g.add_rule(rule, &table)
}

/// Returns all pieces, with those beyond the ends.
fn pieces(g: &mut Graph, values: &[NodeId], knots: &[NodeId]) -> Vec<Piece> {
    let (count, zero, six) = (values.len(), g.constant(0.0), g.constant(6.0));
    let widths: Vec<NodeId> = knots.windows(2).map(|pair| g.sub(pair[1], pair[0])).collect();
    let rises: Vec<NodeId> = values
        .windows(2)
        .zip(&widths)
        .map(|(pair, &width)| {
            let rise = g.sub(pair[1], pair[0]);
            g.div(rise, width)
        })
        .collect();
    let bends = second_derivatives(g, &widths, &rises);
    // The slope at an end is that of the chord, less what the curvature at the other side adds.
    let end_slope = |g: &mut Graph, piece: usize, bend: NodeId, is_last: bool| {
        let product = g.mul(widths[piece], bend);
        let added = g.div(product, six);
        if is_last { g.add(rises[piece], added) } else { g.sub(rises[piece], added) }
    };
    let (first, last) = (end_slope(g, 0, bends[1], false), end_slope(g, count - 2, bends[count - 2], true));
    let beyond = |g: &mut Graph, knot: usize, width: NodeId, slope: NodeId, is_last: bool| -> Piece {
        let rise = g.mul(width, slope);
        match is_last {
            true => {
                let (end, value) = (g.add(knots[knot], width), g.add(values[knot], rise));
                [knots[knot], end, values[knot], value, zero, zero]
            }
            false => {
                let (start, value) = (g.sub(knots[knot], width), g.sub(values[knot], rise));
                [start, knots[knot], value, values[knot], zero, zero]
            }
        }
    };
    let mut pieces = vec![beyond(g, 0, widths[0], first, false)];
    pieces.extend((0..count - 1).map(|i| [knots[i], knots[i + 1], values[i], values[i + 1], bends[i], bends[i + 1]]));
    pieces.push(beyond(g, count - 1, widths[count - 2], last, true));
    pieces
}

/// Returns the second derivatives at the knots, 0 at both ends: the solution of
///
/// ```text
/// hᵢ₋₁ Mᵢ₋₁ + 2 (hᵢ₋₁ + hᵢ) Mᵢ + hᵢ Mᵢ₊₁ = 6 (rᵢ − rᵢ₋₁),
/// ```
///
/// where h are the widths of the pieces and r the slopes of their chords. The matrix is diagonally dominant, so it is
/// eliminated without pivots.
fn second_derivatives(g: &mut Graph, widths: &[NodeId], rises: &[NodeId]) -> Vec<NodeId> {
    let (two, six, zero) = (g.constant(2.0), g.constant(6.0), g.constant(0.0));
    let inner = widths.len() - 1;
    let (mut pivots, mut sides) = (Vec::with_capacity(inner), Vec::with_capacity(inner));
    for i in 0..inner {
        let sum = g.add(widths[i], widths[i + 1]);
        let (mut pivot, change) = (g.mul(two, sum), g.sub(rises[i + 1], rises[i]));
        let mut side = g.mul(six, change);
        if let (Some(&before), Some(&side_before)) = (pivots.last(), sides.last()) {
            let factor = g.div(widths[i], before);
            let (fill, carried) = (g.mul(factor, widths[i]), g.mul(factor, side_before));
            (pivot, side) = (g.sub(pivot, fill), g.sub(side, carried));
        }
        pivots.push(pivot);
        sides.push(side);
    }
    let mut bends = vec![zero; widths.len() + 1];
    for i in (0..inner).rev() {
        let coupled = g.mul(widths[i + 1], bends[i + 2]);
        let rest = g.sub(sides[i], coupled);
        bends[i + 1] = g.div(rest, pivots[i]);
    }
    bends
}

/// Returns the piece that t is in.
fn found(g: &mut Graph, pieces: &[Piece], knots: &[NodeId], t: NodeId) -> Piece {
    knots.iter().zip(&pieces[1..]).fold(pieces[0], |before, (&knot, piece)| {
        let is_after = g.less_or_equal(knot, t);
        std::array::from_fn(|number| g.select(is_after, piece[number], before[number]))
    })
}

/// Returns value, slope and second derivative of a piece: with b = (t − x₀)/h and a = 1 − b,
///
/// ```text
/// s = a y₀ + b y₁ + h²/6 ((a³ − a) M₀ + (b³ − b) M₁).
/// ```
fn evaluated(g: &mut Graph, [x0, x1, y0, y1, m0, m1]: Piece, t: NodeId) -> [NodeId; 3] {
    let (one, three, six) = (g.constant(1.0), g.constant(3.0), g.constant(6.0));
    let width = g.sub(x1, x0);
    let [along, left] = [(t, x0), (x1, t)].map(|(to, from)| {
        let distance = g.sub(to, from);
        g.div(distance, width)
    });
    let sixth = g.div(width, six);
    let bent = |g: &mut Graph, part: NodeId| {
        let square = g.mul(part, part);
        let less = g.sub(square, one);
        let triple = g.mul(three, square);
        (g.mul(part, less), g.sub(triple, one))
    };
    let ((cubic_b, slope_b), (cubic_a, slope_a)) = (bent(g, along), bent(g, left));
    let (chord, bending) = (g.dot(&[left, along], &[y0, y1]), g.dot(&[cubic_a, cubic_b], &[m0, m1]));
    let square = g.mul(sixth, width);
    let added = g.mul(square, bending);
    let value = g.add(chord, added);
    let rise = g.sub(y1, y0);
    let mean = g.div(rise, width);
    let (forward, backward) = (g.mul(slope_b, m1), g.mul(slope_a, m0));
    let difference = g.sub(forward, backward);
    let turned = g.mul(sixth, difference);
    let slope = g.add(mean, turned);
    let curvature = g.dot(&[left, along], &[m0, m1]);
    [value, slope, curvature]
}
