//! Finds where a formula may be singular: the operations that the user wrote, seen from outside of robust primitives.

use std::collections::BTreeSet;

use super::domain::{Use, Uses, outside, without_limit};
use super::range::is_length;
use super::sides::Sides;
use crate::graph::{Graph, NodeId, Op, Primitive};
use energy_runtime::Flag;

/// Masks of the places where a routine needs more than its ordinary path.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Hazards {
    /// Inputs at which a result may be a convention: degenerate, kink. The general path looks closer.
    pub(super) flags: [Option<NodeId>; 2],
    /// The mask where all operands are of moderate size and away from singularities; `None` if they always are.
    pub(super) sound: Option<NodeId>,
    /// The mask where the formula is not defined; `None` if it always is.
    pub(super) outside: Option<NodeId>,
    /// The mask where a result is a convention without a limit.
    pub(super) definite: Option<NodeId>,
}

/// The degree of a squared length: these guards bound the components of the vector, too.
const SQUARE: u8 = 2;
/// Operands up to 2²⁴⁰ (2³⁶ in single precision): their cubes, and those of their reciprocals, are numbers.
pub(super) const DEGREE: u8 = 3;
/// The largest degree of products of lengths that need no guard of their own: up to 2⁶⁴⁰ (2⁹⁶ in single precision).
const LARGEST_DEGREE: u8 = 8;
/// e⁸⁰ is a number in single precision, too.
const LARGEST_EXPONENT: f64 = 80.0;

impl Hazards {
    fn flag(&mut self, g: &mut Graph, flag: Flag, mask: NodeId) {
        let flags = &mut self.flags[usize::from(flag == Flag::Kink)];
        *flags = Some(flags.map_or(mask, |other| g.or(other, mask)));
    }

    /// Marks where the formula has no limit.
    pub(super) fn never(&mut self, g: &mut Graph, mask: NodeId) {
        self.flag(g, Flag::Degenerate, mask);
        self.definite = Some(self.definite.map_or(mask, |other| g.or(other, mask)));
    }

    fn require(&mut self, g: &mut Graph, mask: NodeId) {
        self.sound = Some(self.sound.map_or(mask, |other| g.and(other, mask)));
    }

    /// Requires a > 0 of moderate size.
    fn require_moderate(&mut self, g: &mut Graph, a: NodeId) {
        if g.as_constant(a).is_none() {
            let degree = if is_squared_length(g, a) { SQUARE } else { DEGREE };
            let moderate = g.is_moderate(a, degree);
            self.require(g, moderate);
        }
    }

    /// Requires a divisor of moderate size. Lengths are guarded instead of their products.
    fn require_divisor(&mut self, g: &mut Graph, b: NodeId) {
        match lengths(g, b) {
            Some((degree, squares)) if degree <= LARGEST_DEGREE => {
                squares.into_iter().for_each(|square| self.require_moderate(g, square));
            }
            _ if matches!(g.op(b), Op::Sqrt(_)) => {}
            _ => {
                let size = g.abs(b);
                self.require_moderate(g, size);
            }
        }
    }

    /// Requires a number that is not infinite. Its function may be finite there while derivatives are not.
    fn require_finite(&mut self, g: &mut Graph, a: NodeId) {
        let (size, infinity) = (g.abs(a), g.constant(f64::INFINITY));
        let finite = g.less(size, infinity);
        self.require(g, finite);
    }

    /// Marks a = b, where derivatives may have two sides.
    fn tie(&mut self, g: &mut Graph, a: NodeId, b: NodeId, used: NodeId) {
        let equal = g.equal(a, b);
        let marked = g.and(equal, used);
        self.flag(g, Flag::Kink, marked);
        let apart = g.not(marked);
        self.require(g, apart);
    }

    /// Marks a = b unless derivatives are the same on both sides.
    fn tie_of_sides(&mut self, g: &mut Graph, [a, b]: [NodeId; 2], used: NodeId, sides: &mut Sides<'_>) {
        let (variable, bound) = if g.as_constant(a).is_some() { (b, a) } else { (a, b) };
        if g.as_constant(bound).is_none() || !sides.agree(g, variable, bound) {
            self.tie(g, a, b, used);
        }
    }

    /// Marks the boundary of a condition.
    fn boundary(&mut self, g: &mut Graph, mask: NodeId, used: NodeId, sides: &mut Sides<'_>) {
        match g.op(mask) {
            Op::And(a, b) | Op::Or(a, b) => [a, b].into_iter().for_each(|mask| self.boundary(g, mask, used, sides)),
            Op::Not(a) => self.boundary(g, a, used, sides),
            Op::Less(a, b) | Op::LessOrEqual(a, b) | Op::Equal(a, b) if g.varies(a) || g.varies(b) => {
                self.tie_of_sides(g, [a, b], used, sides);
                self.edge_of_domain(g, &[a, b], used);
            }
            _ => {}
        }
    }

    /// Marks where a compared number stops being one: beyond, the comparison fails, so that the branch changes.
    fn edge_of_domain(&mut self, g: &mut Graph, compared: &[NodeId], used: NodeId) {
        for node in operations(g, compared) {
            if let Op::Ln(x) | Op::Sqrt(x) | Op::Pow(x, _) = g.op(node)
                && g.varies(x)
            {
                let zero = g.constant(0.0);
                self.tie(g, x, zero, used);
            }
        }
    }

    fn operation(&mut self, g: &mut Graph, node: NodeId, order: u8, used: Use, sides: &mut Sides<'_>) {
        let zero = g.constant(0.0);
        match g.op(node) {
            Op::Div(_, b) if g.as_constant(b).is_none() => {
                self.require_divisor(g, b);
                let by_zero = g.equal(b, zero);
                self.flag(g, Flag::Kink, by_zero);
            }
            Op::Sqrt(a) => {
                self.require_moderate(g, a);
                if order >= 1 {
                    let at_zero = g.equal(a, zero);
                    self.flag(g, Flag::Kink, at_zero);
                }
            }
            Op::Ln(a) => self.require_moderate(g, a),
            Op::Pow(a, _) => {
                self.require_moderate(g, a);
                self.require_moderate(g, node);
                if order >= 1 {
                    let at_zero = g.equal(a, zero);
                    self.flag(g, Flag::Kink, at_zero);
                }
            }
            Op::Exp(a) if g.as_constant(a).is_none() => {
                let (least, most) = (g.constant(f64::MIN), g.constant(LARGEST_EXPONENT));
                let (above, below) = (g.less(least, a), g.less(a, most));
                self.require(g, above);
                self.require(g, below);
            }
            Op::Atan2(y, x) => {
                let square = g.dot(&[x, y], &[x, y]);
                self.require_moderate(g, square);
                let at_zero = g.equal(square, zero);
                self.flag(g, Flag::Kink, at_zero);
            }
            Op::Abs(a) if order >= 1 => self.tie_of_sides(g, [a, zero], used.moving, sides),
            Op::Min(a, b) | Op::Max(a, b) if order >= 1 => {
                // If one is NaN, the other one is returned.
                let sum = g.add(a, b);
                self.require_finite(g, sum);
                self.tie_of_sides(g, [a, b], used.moving, sides);
            }
            Op::Select(mask, ..) => self.boundary(g, mask, used.mask, sides),
            _ => {}
        }
    }
}

/// Returns the hazards of derivatives of `roots` up to the given orders.
pub(super) fn hazards(g: &mut Graph, roots: &[(NodeId, u8)]) -> Hazards {
    let uses = Uses::of(g, roots);
    let mut found = Hazards { outside: outside(g, &uses), definite: without_limit(g, &uses), ..Hazards::default() };
    let (always, never) = (g.truth(true), g.truth(false));
    let mut sides = Sides::new(roots);
    for &(root, order) in roots {
        let all = operations(g, &[root]);
        let conditions: Vec<NodeId> = all.iter().filter_map(|&node| condition(g, node)).collect();
        let compared = operations(g, &conditions);
        for node in all {
            // Conditions need values, but no derivatives.
            let used = uses.of_node(node).unwrap_or(Use { mask: always, moving: never, order: 0 });
            let used = if compared.contains(&node) { Use { mask: always, ..used } } else { used };
            match g.rule(node) {
                Some(rule) => {
                    let saturates = order >= 1 && rule.primitive.saturates();
                    let saturated = if saturates { rule.arguments.clone() } else { Vec::new() };
                    for flag in rule.flags.clone().into_iter().filter(|flag| flag.order <= order) {
                        found.flag(g, flag.flag, flag.mask);
                    }
                    saturated.into_iter().for_each(|argument| found.require_finite(g, argument));
                }
                None => found.operation(g, node, order, used, &mut sides),
            }
        }
    }
    found
}

/// Returns whether a number is the square of a difference of points, twice the half that is a primitive.
fn is_squared_length(g: &Graph, a: NodeId) -> bool {
    let Op::Mul(x, y) = g.op(a) else { return false };
    [(x, y), (y, x)].into_iter().any(|(two, half)| g.is(two, 2.0) && is_half_square(g, half))
}

fn is_half_square(g: &Graph, a: NodeId) -> bool {
    let rule = g.rule(a).filter(|rule| rule.primitive == Primitive::InnerProduct);
    rule.is_some_and(|rule| rule.arguments.len() < 4 && rule.arguments.iter().all(|&part| is_length(g, part)))
}

/// Returns the degree of a product of lengths, and those squared lengths among its factors that have no guards of their
/// own; `None` for other numbers.
fn lengths(g: &mut Graph, product: NodeId) -> Option<(u8, Vec<NodeId>)> {
    match g.op(product) {
        Op::Constant(_) => Some((0, Vec::new())),
        Op::Mul(a, b) => {
            let ((degree, mut squares), (other, others)) = (lengths(g, a)?, lengths(g, b)?);
            squares.extend(others);
            Some((degree.saturating_add(other), squares))
        }
        _ if is_half_square(g, product) => {
            let two = g.constant(2.0);
            Some((SQUARE, vec![g.mul(two, product)]))
        }
        _ if g.rule(product)?.primitive == Primitive::Norm => Some((1, Vec::new())),
        _ => None,
    }
}

/// Returns a flag without what cannot hold where the operands are `sound`: a number of moderate size is not 0.
pub(super) fn unless_moderate(g: &mut Graph, flag: NodeId, sound: Option<NodeId>) -> NodeId {
    match g.op(flag) {
        Op::Or(a, b) => {
            let [a, b] = [a, b].map(|flag| unless_moderate(g, flag, sound));
            g.or(a, b)
        }
        Op::Equal(a, b) if sound.is_some_and(|sound| is_not_zero(g, [a, b], sound)) => g.truth(false),
        _ => flag,
    }
}

/// Returns whether one of two numbers is 0 and a mask says that the other one is not.
fn is_not_zero(g: &Graph, [a, b]: [NodeId; 2], mask: NodeId) -> bool {
    match [g.is(a, 0.0), g.is(b, 0.0)] {
        [true, false] => is_nonzero(g, g.resolve(b), mask),
        [false, true] => is_nonzero(g, g.resolve(a), mask),
        _ => false,
    }
}

/// Returns whether a number that divides is not 0 where a mask holds, because it or its factors are of moderate size.
fn is_nonzero(g: &Graph, number: NodeId, mask: NodeId) -> bool {
    is_moderate(g, number, mask)
        || match g.op(number) {
            Op::Constant(_) => !g.is(number, 0.0),
            Op::Sqrt(a) => is_nonzero(g, g.resolve(a), mask),
            Op::Mul(a, b) => [a, b].into_iter().all(|factor| is_nonzero(g, g.resolve(factor), mask)),
            _ => false,
        }
}

fn is_moderate(g: &Graph, number: NodeId, mask: NodeId) -> bool {
    match g.op(mask) {
        Op::And(a, b) => is_moderate(g, number, a) || is_moderate(g, number, b),
        Op::IsModerate(size, _) => g.resolve(size) == number || g.op(g.resolve(size)) == Op::Abs(number),
        _ => false,
    }
}

/// Returns the condition of a selection.
fn condition(g: &Graph, node: NodeId) -> Option<NodeId> {
    match (g.rule(node), g.op(node)) {
        (None, Op::Select(mask, ..)) => Some(mask),
        _ => None,
    }
}

/// Returns the operations that `roots` depend on. A robust primitive counts as one, but for what users wrote inside.
pub(super) fn operations(g: &Graph, roots: &[NodeId]) -> BTreeSet<NodeId> {
    let mut seen = BTreeSet::new();
    let mut stack = roots.to_vec();
    while let Some(node) = stack.pop() {
        if seen.insert(node) {
            match g.rule(node) {
                Some(rule) => stack.extend(rule.arguments.iter().chain(&rule.inner)),
                None => stack.extend(g.op(node).operands()),
            }
        }
    }
    seen
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::graph::{Input, Interpreter};
    use energy_runtime::Inputs;

    /// Returns whether t = `at` is marked as a kink of a function of t, up to the second derivatives.
    fn is_kink(at: f64, formula: impl Fn(&mut Graph, NodeId) -> NodeId) -> bool {
        let mut g = Graph::robust(&[]);
        let t = g.input(Input::Position(0));
        let root = formula(&mut g, t);
        let Some(mask) = hazards(&mut g, &[(root, 2)]).flags[1] else { return false };
        let inputs = Inputs { parameters: &[], rest: &[], positions: &[at], velocities: &[] };
        Interpreter::new(&g, &[mask]).masks::<f64>(&inputs)[0]
    }

    #[test]
    fn a_kink_counts_where_its_derivatives_are_used() {
        // t² where |t| < b, and |t| + t⁴ elsewhere.
        let branches = |b: f64| {
            move |g: &mut Graph, t: NodeId| {
                let (size, square, bound) = (g.abs(t), g.mul(t, t), g.constant(b));
                let (fourth, inside) = (g.mul(square, square), g.less(size, bound));
                let outside = g.add(size, fourth);
                g.select(inside, square, outside)
            }
        };
        assert!(!is_kink(0.0, branches(1.0)));
        assert!(is_kink(1.0, branches(1.0)) && is_kink(-1.0, branches(1.0)));
        assert!(is_kink(0.0, branches(-1.0)));
        // Conditions need no derivatives: |t| < 1 as such has none at t = 0, the jump at its ends is marked.
        let indicator = |g: &mut Graph, t: NodeId| {
            let (size, one, two) = (g.abs(t), g.constant(1.0), g.constant(2.0));
            let inside = g.less(size, one);
            g.select(inside, one, two)
        };
        assert!(!is_kink(0.0, indicator) && is_kink(1.0, indicator));
    }

    #[test]
    fn smooth_joints_are_no_kinks() {
        let one_sided = |exponent: usize| {
            move |g: &mut Graph, t: NodeId| {
                let zero = g.constant(0.0);
                let part = g.min(t, zero);
                (1..exponent).fold(part, |power, _| g.mul(power, part))
            }
        };
        assert!(is_kink(0.0, one_sided(1)) && is_kink(0.0, one_sided(2)) && !is_kink(0.0, one_sided(3)));
    }
}
