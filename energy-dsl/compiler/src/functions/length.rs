//! Lengths: ‖d‖, d/‖d‖, ‖d‖^α, ‖d‖ − L and its square, with their own derivatives.
//!
//! Vectors are first scaled by a power of two, so that no square overflows or vanishes. With n = d/‖d‖, r = ‖d‖ and P =
//! I − n nᵀ: ∇r = n and ∇²r = P/r. The diagonal of P is the sum of the *other* squares, never 1 − nᵢ².

use super::inner_product::inner_product;
use super::{Function, Lowered, Shape, Units, parallelogram};
use crate::graph::{BySquare, Form, Graph, NodeId, Origin, Primitive, Rule, upper};
use energy_runtime::Flag;

pub(super) const FUNCTIONS: &[Function] = &[
    Function {
        name: "norm",
        usage: "norm(d) or ‖d‖",
        docs: "Length of a vector or quaternion. At 0 it contributes no derivatives, and they are flagged. \
               `norm(d) - L` and its square are robust primitives.",
        shape: vector_to_scalar,
        units: Units::First,
        lower: norm,
        accuracy: "2 / 2 / 6",
    },
    Function {
        name: "norm_squared",
        usage: "norm_squared(d) or ‖d‖²",
        docs: "d·d.",
        shape: vector_to_scalar,
        units: Units::Power(2.0),
        lower: norm_squared,
        accuracy: "3 / 1 / 0",
    },
    Function {
        name: "unit",
        usage: "unit(d) or â",
        docs: "d/‖d‖ of a vector or quaternion. For a dual quaternion, both parts are divided by the norm of the \
             real part. At 0 the result is taken as 0 and flagged.",
        shape: unit_shape,
        units: Units::Direction,
        lower: unit,
        accuracy: "2 / 5 / 8",
    },
];

fn vector_to_scalar(shapes: &[Shape]) -> Result<Shape, String> {
    match shapes {
        [Shape::DualQuat] => Err("takes a vector, but this is a dual quaternion; did you mean norm(real(q))?".into()),
        _ => unit_shape(shapes).map(|_| Shape::Scalar),
    }
}

fn unit_shape(shapes: &[Shape]) -> Result<Shape, String> {
    match *shapes {
        [v @ (Shape::Vector(_) | Shape::Quat | Shape::DualQuat)] => Ok(v),
        [other] => Err(format!("takes a vector, but this is {other}")),
        _ => Err(format!("takes one vector, but got {}", super::arguments(shapes.len()))),
    }
}

/// A scaled vector d, with its length and direction.
pub(super) struct Direction {
    /// The scale, a power of two.
    pub(super) scale: NodeId,
    /// The scaled vector, scale · d.
    pub(super) scaled: Vec<NodeId>,
    /// ‖scale · d‖².
    pub(super) square: NodeId,
    /// ‖scale · d‖.
    pub(super) length: NodeId,
    /// Whether d = 0.
    pub(super) zero: NodeId,
    /// 1/‖scale · d‖², or 0 where d = 0.
    pub(super) per_square: NodeId,
    /// 1/‖scale · d‖, or 0 where d = 0.
    pub(super) reciprocal: NodeId,
    /// d/‖d‖, or 0 where d = 0.
    pub(super) unit: Vec<NodeId>,
}

/// Creates a power of two that scales the largest of the numbers to near 1.
pub(super) fn common_scale(g: &mut Graph, numbers: &[NodeId]) -> NodeId {
    let largest = largest_magnitude(g, numbers);
    g.power_of_two_scale(largest)
}

fn largest_magnitude(g: &mut Graph, numbers: &[NodeId]) -> NodeId {
    let magnitudes: Vec<_> = numbers.iter().map(|&x| g.abs(x)).collect();
    magnitudes.into_iter().reduce(|a, b| g.max(a, b)).expect("a vector has components")
}

/// Records the assumption: if d·d is moderate, d is not 0 and needs no scaling.
pub(super) fn assume_moderate(g: &mut Graph, square: NodeId, scale: NodeId, zero: NodeId) {
    let moderate = g.is_moderate(square, 2);
    let (one, never) = (g.constant(1.0), g.truth(false));
    g.assume(scale, one, moderate);
    g.assume(zero, never, moderate);
}

/// Scales `d` by `scale` and computes its direction.
pub(super) fn direction_scaled(g: &mut Graph, d: &[NodeId], scale: NodeId) -> Direction {
    let scaled = g.scaled(scale, d);
    let square = g.sum_of_squares(&scaled);
    let length = g.sqrt(square);
    let (null, one) = (g.constant(0.0), g.constant(1.0));
    let zero = g.equal(square, null);
    // 1/‖d‖ = √s/s, so that root and division overlap.
    let per_square = g.div(one, square);
    let per_square = g.select(zero, null, per_square);
    let reciprocal = g.mul(length, per_square);
    let unit = g.scaled(reciprocal, &scaled);
    Direction { scale, scaled, square, length, zero, per_square, reciprocal, unit }
}

/// Computes the direction of `d`.
pub(super) fn direction(g: &mut Graph, d: &[NodeId]) -> Direction {
    let scale = common_scale(g, d);
    let at = direction_scaled(g, d, scale);
    assume_moderate(g, at.square, scale, at.zero);
    at
}

/// Returns entry (i, j) of P = I − n nᵀ: −nᵢ nⱼ off the diagonal, the sum of the other squares on it.
pub(super) fn projector(g: &mut Graph, n: &[NodeId], i: usize, j: usize) -> NodeId {
    if i == j {
        let others: Vec<_> = n.iter().enumerate().filter(|(k, _)| *k != i).map(|(_, &x)| x).collect();
        return g.sum_of_squares(&others);
    }
    let product = g.mul(n[i], n[j]);
    g.neg(product)
}

fn norm(g: &mut Graph, args: &[Lowered]) -> Lowered {
    Lowered::scalar(length(g, &args[0].parts))
}

fn length(g: &mut Graph, d: &[NodeId]) -> NodeId {
    if g.form() == Form::Textbook {
        let square = g.sum_of_squares(d);
        return g.sqrt(square);
    }
    let at = direction(g, d);
    let value = g.div(at.length, at.scale);
    // Differentiates by a and b if d = a × b.
    let curvature = g.mul(at.reciprocal, at.scale);
    let (arguments, (first, second)) = match parallelogram::edges(g, d) {
        Some(edges) => (edges.concat(), parallelogram::derivatives(g, &edges, &at.unit, curvature)),
        None => {
            let first = at.unit.iter().map(|&n| vec![n]).collect();
            let second = upper(d.len()).map(|(i, j)| vec![vec![curvature, projector(g, &at.unit, i, j)]]).collect();
            (d.to_vec(), (first, second))
        }
    };
    let rule = Rule::factored(Primitive::Norm, arguments, value, first, second).flagged(1, Flag::Degenerate, at.zero);
    // 1/r and −1/r³.
    let (square, minus) = (g.half_square(d), g.neg(curvature));
    let by_square =
        BySquare { square, zero: at.zero, slope: vec![curvature], curvature: vec![minus, curvature, curvature] };
    g.add_rule(Rule { vector: Some(d.to_vec()), by_square: Some(by_square), ..rule }, d)
}

fn norm_squared(g: &mut Graph, args: &[Lowered]) -> Lowered {
    Lowered::scalar(inner_product(g, &args[0].parts, &args[0].parts))
}

pub(super) fn unit(g: &mut Graph, args: &[Lowered]) -> Lowered {
    let (q, shape) = (&args[0], args[0].shape);
    if shape == Shape::DualQuat {
        return super::quaternion::unit_dual(g, q);
    }
    let parts = unit_parts(g, &q.parts);
    if shape == Shape::Quat {
        g.note_origin(&parts, Origin::UnitQuaternion);
    }
    Lowered { shape, parts }
}

fn unit_parts(g: &mut Graph, d: &[NodeId]) -> Vec<NodeId> {
    if g.form() == Form::Textbook {
        let square = g.sum_of_squares(d);
        let length = g.sqrt(square);
        return d.iter().map(|&x| g.div(x, length)).collect();
    }
    let at = direction(g, d);
    let (n, m) = (&at.unit, d.len());
    let curvature = g.mul(at.reciprocal, at.scale);
    let square = g.mul(curvature, curvature);
    let component = |g: &mut Graph, i: usize| {
        let first = (0..m)
            .map(|j| {
                let entry = projector(g, n, i, j);
                g.mul(curvature, entry)
            })
            .collect();
        // ∂²nᵢ/∂dⱼ∂dₖ = −(Pᵢⱼ nₖ + Pᵢₖ nⱼ + Pⱼₖ nᵢ)/r².
        let second = upper(m)
            .map(|(j, k)| {
                let p = [projector(g, n, i, j), projector(g, n, i, k), projector(g, n, j, k)];
                let sum = g.dot(&p, &[n[k], n[j], n[i]]);
                let entry = g.mul(square, sum);
                g.neg(entry)
            })
            .collect();
        let rule = Rule::smooth(Primitive::Unit(i as u8), d.to_vec(), n[i], first, second);
        g.add_rule(rule.flagged(0, Flag::Degenerate, at.zero), &[])
    };
    (0..m).map(|i| component(g, i)).collect()
}

/// Recognises ‖d‖^α, where α is a parameter or a constant. With g = α ‖d‖^(α−1), the gradient is g n and the Hessian
/// (g/r) (I + (α − 2) n nᵀ). An even constant power is a polynomial of d·d. At d = 0 both are their limits, or 0 and
/// flagged without a limit.
pub(super) fn recognise_norm_power(g: &mut Graph, base: NodeId, exponent: NodeId) -> Option<NodeId> {
    let rule = g.rule(base)?;
    let (d, length) = (rule.vector.clone()?, rule.value);
    if g.varies(exponent) {
        return None;
    }
    if let Some(power) = g.as_constant(exponent).filter(|power| *power > 0.0 && power % 2.0 == 0.0) {
        let (square, half) = (inner_product(g, &d, &d), g.constant(power / 2.0));
        return Some(g.plain_pow(square, half));
    }
    let at = direction(g, &d);
    let (null, one, two) = (g.constant(0.0), g.constant(1.0), g.constant(2.0));
    let value = g.plain_pow(length, exponent);
    let less_one = g.sub(exponent, one);
    let power = g.plain_pow(length, less_one);
    let slope = g.mul(exponent, power);
    let slope = g.select(at.zero, null, slope);
    let first = at.unit.iter().map(|&n| vec![slope, n]).collect();

    let reciprocal = g.mul(at.reciprocal, at.scale);
    let ratio = g.mul(slope, reciprocal);
    let quadratic = g.equal(exponent, two);
    let at_zero = g.select(quadratic, two, null);
    let ratio = g.select(at.zero, at_zero, ratio);
    let less_two = g.sub(exponent, two);
    let second = upper(d.len())
        .map(|(i, j)| {
            let along = g.product(None, &[less_two, at.unit[i], at.unit[j]]);
            // Two products could be opposite infinities where the power overflows.
            let entry = if i == j { g.add(one, along) } else { along };
            vec![vec![ratio, entry]]
        })
        .collect();
    let (at_most_one, below_two) = (g.less_or_equal(exponent, one), g.less(exponent, two));
    let (cone, singular) = (g.and(at.zero, at_most_one), g.and(at.zero, below_two));
    // α r^(α−2) and α (α − 2) r^(α−4).
    let by_square = BySquare {
        square: g.half_square(&d),
        zero: at.zero,
        slope: vec![ratio],
        curvature: vec![ratio, less_two, reciprocal, reciprocal],
    };
    let rule = Rule::factored(Primitive::NormPower, d, value, first, second);
    let rule = rule.flagged(1, Flag::Degenerate, cone).flagged(2, Flag::Degenerate, singular);
    Some(g.add_rule(Rule { by_square: Some(by_square), ..rule }, &[exponent]))
}

/// Recognises C = ‖d‖ − L, where L does not move. C = (r − L) + ρ, where r is the rounded length and ρ = (d·d − r²)/2r
/// its rounding error, including the rounding errors of the edge. Near rest r − L is exact, and ρ is most of the
/// strain.
///
/// ½C² has the gradient (C/r) d and the Hessian (C/r) I + (L/r) n nᵀ. Both are right at d = 0, too, if L = 0.
pub(super) fn recognise_elongation(g: &mut Graph, norm: NodeId, rest_length: NodeId) -> Option<NodeId> {
    let d = g.rule(norm)?.vector.clone()?;
    if g.varies(rest_length) {
        return None;
    }
    // A length is not negative, so it needs no absolute value.
    let largest = largest_magnitude(g, &d);
    let largest = g.max(largest, rest_length);
    let scale = g.power_of_two_scale(largest);
    let at = direction_scaled(g, &d, scale);
    assume_moderate(g, at.square, scale, at.zero);
    let length = g.mul(scale, rest_length);
    let (null, one, half) = (g.constant(0.0), g.constant(1.0), g.constant(0.5));
    let slack = g.equal(length, null);
    let rounding = rounding_of_length(g, &d, &at);
    let (reciprocal, per_square) = if g.is(rounding, 0.0) {
        (at.reciprocal, at.per_square)
    } else {
        // Below a strain of u, the correction nearly cancels r − L. It uses 1/r of the rounded length, rounded once.
        let reciprocal = g.div(one, at.length);
        (reciprocal, g.mul(reciprocal, reciprocal))
    };
    let [reciprocal, per_square] = [reciprocal, per_square].map(|factor| g.select(at.zero, one, factor));
    let correction = g.mul(rounding, reciprocal);
    let rounded = g.sub(at.length, length);
    let scaled_value = g.add(rounded, correction);
    let value = g.div(scaled_value, scale);

    // C/r; at d = 0 its limit 1 for a spring without rest length, else 0. The common factor 1/r comes first.
    let at_zero = g.select(slack, one, null);
    let elongation = g.select(at.zero, at_zero, scaled_value);
    // (L/r) n nᵀ = (L/r³) d dᵀ of the scaled vector.
    let square = g.mul(value, value);
    let half_value = g.mul(half, square);
    let half_first = d.iter().map(|&x| vec![reciprocal, elongation, x]).collect();
    let half_second = upper(d.len())
        .map(|(i, j)| {
            let stretching = vec![reciprocal, length, per_square, at.scaled[i], at.scaled[j]];
            if i == j { vec![vec![reciprocal, elongation], stretching] } else { vec![stretching] }
        })
        .collect();
    let not_slack = g.not(slack);
    let collapsed = g.and(at.zero, not_slack);
    let by_square = BySquare {
        square: g.half_square(&d),
        zero: at.zero,
        slope: vec![reciprocal, elongation],
        curvature: vec![reciprocal, length, per_square, scale, scale],
    };
    let rule = Rule::factored(Primitive::HalfElongationSquared, d.clone(), half_value, half_first, half_second)
        .flagged(1, Flag::Degenerate, collapsed);
    let half_square = g.add_rule(Rule { by_square: Some(by_square), ..rule }, &[rest_length]);

    // Differentiated with respect to ‖d‖, so that everything that depends on both gathers there.
    let rule = Rule::smooth(Primitive::Elongation, vec![norm], value, vec![one], vec![null]);
    Some(g.add_rule(Rule { half_square: Some(half_square), ..rule }, &[rest_length]))
}

/// Returns ‖d‖ (‖d‖ − r) for the rounded length r of the scaled vector: half of d·d − r² as if in doubled precision,
/// including the rounding errors of d.
fn rounding_of_length(g: &mut Graph, d: &[NodeId], at: &Direction) -> NodeId {
    let squares: Vec<_> = at.scaled.iter().map(|&e| g.mul(e, e)).collect();
    let mut errors: Vec<_> = at.scaled.iter().map(|&e| g.product_error(e, e)).collect();
    let mut sum = squares[0];
    for &square in &squares[1..] {
        errors.push(g.sum_error(sum, square));
        sum = g.add(sum, square);
    }
    errors.push(g.root_error(sum, at.length));
    let errors = g.sum(errors);
    let half = g.constant(0.5);
    let errors = g.mul(half, errors);
    let tails: Vec<_> = d.iter().map(|&x| g.rounding_tail(x)).collect();
    let along = g.dot(&at.scaled, &tails);
    let along = g.mul(at.scale, along);
    g.add(errors, along)
}
