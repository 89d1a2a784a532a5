//! sin x / x and related functions with removable singularities at 0. S(y) = sin √y / √y and cos √y are even entire
//! functions of x = √y: as functions of y, no derivative divides by x. With Sₘ the m-th derivative of S, (cos √y)′ =
//! −S/2 and 2y Sₘ₊₂ + (2m + 3) Sₘ₊₁ + Sₘ/2 = 0. Where that cancels, the power series Sₘ = Σ (−1)ᵏ k!/(k−m)!
//! yᵏ⁻ᵐ/(2k+1)! is used.

use super::elementary::one_scalar;
use super::power_series::{Interval, economised, polynomial};
use super::{Function, Lowered, Units};
use crate::graph::{Form, Graph, NodeId, Primitive, Rule};

pub(super) const FUNCTIONS: &[Function] = &[
    Function {
        name: "cos_sqrt",
        usage: "cos_sqrt(y)",
        docs: "cos √y, y ≥ 0. Regular at 0, with the derivative −½ sinc_sqrt(y).",
        shape: one_scalar,
        units: Units::Plain,
        lower: |g, a| Lowered::scalar(cos_sqrt(g, a[0].node())),
        accuracy: "4 / 3 / 6 for y ≤ 1.5",
    },
    Function {
        name: "sinc_sqrt",
        usage: "sinc_sqrt(y)",
        docs: "sin √y / √y, y ≥ 0. Regular at 0, where it is 1.",
        shape: one_scalar,
        units: Units::Plain,
        lower: |g, a| Lowered::scalar(sinc_sqrt(g, a[0].node())),
        accuracy: "5 / 6 / 10 for y ≤ 6.5",
    },
    Function {
        name: "sinc",
        usage: "sinc(x)",
        docs: "sin x / x. Regular at 0, where it is 1.",
        shape: one_scalar,
        units: Units::Plain,
        lower: |g, a| Lowered::scalar(sinc(g, a[0].node())),
        accuracy: "2 / 6 / 12 for |x| ≤ 1.5",
    },
    Function {
        name: "cosc",
        usage: "cosc(x)",
        docs: "(1 − cos x)/x² = ½ sinc²(x/2). Regular at 0, where it is ½.",
        shape: one_scalar,
        units: Units::Plain,
        lower: |g, a| Lowered::scalar(cosc(g, a[0].node())),
        accuracy: "5 / 9 / 16 for |x| ≤ 1.5",
    },
];

/// Shared parts of the functions of one argument: one sine, one cosine, one division.
struct Shared {
    y: NodeId,
    cosine: NodeId,
    /// S = sin x / x.
    sinc: NodeId,
    /// S₁ = (cos x − S)/(2y).
    slope: NodeId,
    /// 1/(2y).
    half_inverse: NodeId,
}

/// Below these bounds, cos x − S and S/2 + 3 S₁ lose more digits than the series.
const SLOPE_SERIES_BELOW: f64 = 2.0;
const CURVATURE_SERIES_BELOW: f64 = 6.0;

/// Computes the shared parts from x and y = x².
fn shared(g: &mut Graph, x: NodeId, y: NodeId) -> Shared {
    let (null, one, half) = (g.constant(0.0), g.constant(1.0), g.constant(0.5));
    let (sine, cosine) = (g.sin(x), g.cos(x));
    let reciprocal = g.div(one, x);
    let quotient = g.mul(sine, reciprocal);
    let at_zero = g.equal(x, null);
    let sinc = g.select(at_zero, one, quotient);
    let square = g.mul(reciprocal, reciprocal);
    let half_inverse = g.mul(half, square);
    let difference = g.sub(cosine, sinc);
    let direct = g.mul(difference, half_inverse);
    let slope = near_zero(g, y, SLOPE_SERIES_BELOW, 1, direct);
    Shared { y, cosine, sinc, slope, half_inverse }
}

impl Shared {
    /// Returns S₂ = −(S/2 + 3 S₁)/(2y).
    fn curvature(&self, g: &mut Graph) -> NodeId {
        let (half, three) = (g.constant(0.5), g.constant(3.0));
        let (a, b) = (g.mul(half, self.sinc), g.mul(three, self.slope));
        let sum = g.add(a, b);
        let direct = g.mul(sum, self.half_inverse);
        let direct = g.neg(direct);
        near_zero(g, self.y, CURVATURE_SERIES_BELOW, 2, direct)
    }
}

/// Records the assumption that x = √y is at most a quarter turn, π/2. As half of a rotation vector it nearly always is.
/// Then series in y replace root, sine, cosine and division.
pub(super) fn assume_at_most_a_quarter_turn(g: &mut Graph, y: NodeId) {
    const BELOW: f64 = 2.5;
    if g.form() == Form::Textbook {
        return;
    }
    let x = g.sqrt(y);
    let shared = shared(g, x, y);
    let limit = g.constant(BELOW);
    let small = g.less(y, limit);
    let cosine = cosine_series(g, y, BELOW);
    g.assume(shared.cosine, cosine, small);
    let curvature = shared.curvature(g);
    for (node, order) in [(shared.sinc, 0), (shared.slope, 1), (curvature, 2)] {
        let series = polynomial(g, y, coefficients(BELOW, order));
        g.assume(node, series, small);
    }
}

/// Returns cos √y = S + 2y S₁ = 1 + y (R + 2 S₁) with S = 1 + y R, for y ≤ `below`. If S and S₁ are computed anyway,
/// this takes two operations, and only the last one rounds at the size of the result.
fn cosine_series(g: &mut Graph, y: NodeId, below: f64) -> NodeId {
    let (one, two) = (g.constant(1.0), g.constant(2.0));
    let rest = polynomial(g, y, coefficients(below, 0).split_off(1));
    let slope = polynomial(g, y, coefficients(below, 1));
    let doubled = g.mul(two, slope);
    let sum = g.add(rest, doubled);
    let product = g.mul(y, sum);
    g.add(one, product)
}

/// Selects the series of Sₘ where y < `below`, else `direct`.
fn near_zero(g: &mut Graph, y: NodeId, below: f64, order: u32, direct: NodeId) -> NodeId {
    let series = polynomial(g, y, coefficients(below, order));
    let below = g.constant(below);
    let near = g.less(y, below);
    g.select(near, series, direct)
}

/// Returns the coefficients of the series of Sₘ for y ≤ `below`.
fn coefficients(below: f64, order: u32) -> Vec<f64> {
    // (−1)ᵏ k!/(k−m)!/(2k+1)!, from k = m on.
    let coefficient = |power: u32| {
        let k = power + order;
        let falling: f64 = (power + 1..=k).map(f64::from).product();
        let factorial: f64 = (1..=2 * k + 1).map(f64::from).product();
        (if k.is_multiple_of(2) { 1.0 } else { -1.0 }) * falling / factorial
    };
    economised(coefficient, Interval::FromZero(below))
}

/// Returns S₁ as a rule of y, so that it can be differentiated.
fn slope(g: &mut Graph, shared: &Shared) -> NodeId {
    let curvature = shared.curvature(g);
    let mut rule = Rule::smooth(Primitive::SincSqrtSlope, vec![shared.y], shared.slope, vec![curvature], Vec::new());
    rule.second = None;
    g.add_rule(rule, &[])
}

/// Creates cos √y.
pub(super) fn cos_sqrt(g: &mut Graph, y: NodeId) -> NodeId {
    let x = g.sqrt(y);
    if g.form() == Form::Textbook {
        return g.cos(x);
    }
    let shared = shared(g, x, y);
    let sinc = sinc_sqrt(g, y);
    let half = g.constant(-0.5);
    let (first, second) = (g.mul(half, sinc), g.mul(half, shared.slope));
    g.add_rule(Rule::smooth(Primitive::CosSqrt, vec![y], shared.cosine, vec![first], vec![second]), &[])
}

/// Creates sin √y / √y.
pub(super) fn sinc_sqrt(g: &mut Graph, y: NodeId) -> NodeId {
    let x = g.sqrt(y);
    if g.form() == Form::Textbook {
        let sine = g.sin(x);
        return g.div(sine, x);
    }
    let shared = shared(g, x, y);
    let (first, second) = (slope(g, &shared), shared.curvature(g));
    g.add_rule(Rule::smooth(Primitive::SincSqrt, vec![y], shared.sinc, vec![first], vec![second]), &[])
}

/// Creates sin x / x. The first derivative is 2x S₁, the second −(S + 4 S₁).
fn sinc(g: &mut Graph, x: NodeId) -> NodeId {
    if g.form() == Form::Textbook {
        let sine = g.sin(x);
        return g.div(sine, x);
    }
    let y = g.mul(x, x);
    let shared = shared(g, x, y);
    let (two, four) = (g.constant(2.0), g.constant(4.0));
    let first = g.product(None, &[two, x, shared.slope]);
    let quadruple = g.mul(four, shared.slope);
    let sum = g.add(shared.sinc, quadruple);
    let second = g.neg(sum);
    g.add_rule(Rule::smooth(Primitive::Sinc, vec![x], shared.sinc, vec![first], vec![second]), &[])
}

/// Creates (1 − cos x)/x² = ½ sinc²(x/2).
fn cosc(g: &mut Graph, x: NodeId) -> NodeId {
    if g.form() == Form::Textbook {
        let (one, cosine, square) = (g.constant(1.0), g.cos(x), g.mul(x, x));
        let difference = g.sub(one, cosine);
        return g.div(difference, square);
    }
    let half = g.constant(0.5);
    let halved = g.mul(half, x);
    let root = sinc(g, halved);
    let square = g.mul(root, root);
    g.mul(half, square)
}
