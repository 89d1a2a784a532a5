//! Quotients (f(σ) − f(σ′))/ℓ, where σ′ is the mirror image of the singular values σ, at the distance ℓ.
//!
//! They follow the formula of f, as derivatives do: with x′ for the image of x, and x − x′ = ℓ δx,
//!
//! ```text
//! δ(x + y) = δx + δy        δ(x y) = δx y + x′ δy        δ(x/y) = (δx − (x′/y′) δy)/y        δ√x = δx/(√x + √x′)
//! ```
//!
//! So nothing cancels, and where ℓ = 0 the quotient is its limit, a derivative.

use std::collections::BTreeMap;

use crate::diff::{Coordinates, Order, first_derivatives};
use crate::functions::{Lowered, find};
use crate::graph::{Graph, NodeId, Op, Substitution};

/// Nodes and weights of Gauss's rule with four points, on [0, 1].
const GAUSS: [(f64, f64); 4] = [
    (0.069_431_844_202_973_71, 0.173_927_422_568_726_93),
    (0.330_009_478_207_571_87, 0.326_072_577_431_273_07),
    (0.669_990_521_792_428_1, 0.326_072_577_431_273_07),
    (0.930_568_155_797_026_3, 0.173_927_422_568_726_93),
];
/// Steps of an argument up to this size, absolute and relative, are short for Gauss's rule.
const SHORT: f64 = 0.0625;

/// A reflection of the singular values, with the quotient of derivatives of ψ that it determines.
pub(super) struct Reflection {
    /// All singular values and their images.
    pub(super) images: Vec<(NodeId, NodeId)>,
    /// (σ − σ′)/ℓ of each.
    changes: Vec<f64>,
    /// ℓ.
    pub(super) distance: NodeId,
    /// ℓ times the quotient, computed as a plain difference.
    pub(super) numerator: NodeId,
}

impl Reflection {
    /// σᵢ and σⱼ change places. The quotient is (ψᵢ − ψⱼ)/(σᵢ − σⱼ).
    pub(super) fn exchange(g: &mut Graph, values: &[NodeId], slopes: &[NodeId], (i, j): (usize, usize)) -> Self {
        let (a, b) = (values[i], values[j]);
        let (distance, numerator) = (g.plain_difference(a, b), g.plain_difference(slopes[i], slopes[j]));
        Self::new(values, &[(i, b, 1.0), (j, a, -1.0)], distance, numerator)
    }

    /// σᵢ and σⱼ change places and signs. The quotient is (ψᵢ + ψⱼ)/(σᵢ + σⱼ).
    pub(super) fn reversal(g: &mut Graph, values: &[NodeId], slopes: &[NodeId], (i, j): (usize, usize)) -> Self {
        let (a, b) = (values[i], values[j]);
        let (minus_a, minus_b) = (g.neg(a), g.neg(b));
        let (distance, numerator) = (g.add(a, b), g.add(slopes[i], slopes[j]));
        Self::new(values, &[(i, minus_b, 1.0), (j, minus_a, 1.0)], distance, numerator)
    }

    /// σᵢ changes its sign. The quotient is ψᵢ/σᵢ.
    pub(super) fn negation(g: &mut Graph, values: &[NodeId], slopes: &[NodeId], i: usize) -> Self {
        let (minus, two) = (g.neg(values[i]), g.constant(2.0));
        let (distance, numerator) = (g.mul(two, values[i]), g.mul(two, slopes[i]));
        Self::new(values, &[(i, minus, 1.0)], distance, numerator)
    }

    /// Moves some values, given by index, image and change. The others stay.
    fn new(values: &[NodeId], moved: &[(usize, NodeId, f64)], distance: NodeId, numerator: NodeId) -> Self {
        let mut images: Vec<(NodeId, NodeId)> = values.iter().map(|&value| (value, value)).collect();
        let mut changes = vec![0.0; values.len()];
        for &(index, image, change) in moved {
            images[index].1 = image;
            changes[index] = change;
        }
        Self { images, changes, distance, numerator }
    }
}

/// Quotients (f(σ) − f(σ′))/ℓ of one reflection.
pub(super) struct DividedDifference {
    image: Substitution,
    distance: NodeId,
    known: BTreeMap<NodeId, NodeId>,
}

impl DividedDifference {
    /// Prepares quotients in which some conditions keep their outcome.
    pub(super) fn new(g: &mut Graph, reflection: &Reflection, conditions: &[NodeId]) -> Self {
        let moved = reflection.images.iter().zip(&reflection.changes);
        let known = moved.map(|(&(value, _), &change)| (value, g.constant(change))).collect();
        let kept = conditions.iter().map(|&condition| (condition, condition));
        let image = Substitution::new(g, reflection.images.iter().copied().chain(kept));
        Self { image, distance: reflection.distance, known }
    }

    /// Returns δf.
    pub(super) fn of(&mut self, g: &mut Graph, f: NodeId) -> NodeId {
        if let Some(&known) = self.known.get(&f) {
            return known;
        }
        let change = self.compute(g, f);
        self.known.insert(f, change);
        change
    }

    fn compute(&mut self, g: &mut Graph, f: NodeId) -> NodeId {
        let zero = g.constant(0.0);
        if !g.varies(f) || g.op(f).is_constant_in_exact_arithmetic() {
            return zero;
        }
        match g.op(f) {
            Op::Neg(x) => {
                let change = self.of(g, x);
                g.neg(change)
            }
            Op::Add(x, y) => {
                let (dx, dy) = (self.of(g, x), self.of(g, y));
                g.add(dx, dy)
            }
            Op::Sub(x, y) => {
                let (dx, dy) = (self.of(g, x), self.of(g, y));
                g.plain_difference(dx, dy)
            }
            Op::Mul(x, y) => {
                let (dx, dy, image) = (self.of(g, x), self.of(g, y), self.image.of(g, x));
                g.dot(&[dx, image], &[y, dy])
            }
            Op::Div(x, y) => {
                let (dx, dy, image) = (self.of(g, x), self.of(g, y), self.image.of(g, f));
                let product = g.mul(image, dy);
                let numerator = g.plain_difference(dx, product);
                g.div(numerator, y)
            }
            Op::Sqrt(x) => {
                let (dx, image) = (self.of(g, x), self.image.of(g, f));
                let sum = g.add(f, image);
                g.div(dx, sum)
            }
            Op::Exp(x) => self.of_exponential(g, x),
            Op::Ln(x) => {
                let (base, step) = self.relative_step(g, x);
                let logarithm = call(g, "log1p", step);
                let (dx, one) = (self.of(g, x), g.constant(1.0));
                let quotient = quotient_or(g, logarithm, step, one);
                let slope = g.div(quotient, base);
                g.mul(dx, slope)
            }
            Op::Pow(x, exponent) if !g.varies(exponent) => self.of_power(g, x, exponent),
            Op::Select(mask, yes, no) => self.of_selection(g, f, (mask, yes, no)),
            _ => self.of_any(g, f),
        }
    }

    /// Returns ℓ δx = x − x′.
    fn step(&mut self, g: &mut Graph, x: NodeId) -> NodeId {
        let change = self.of(g, x);
        g.mul(self.distance, change)
    }

    /// δeˣ = eᵐ δx sinh(h)/h, with the mean m of x and x′, and 2h = x − x′.
    fn of_exponential(&mut self, g: &mut Graph, x: NodeId) -> NodeId {
        let (half, one) = (g.constant(0.5), g.constant(1.0));
        let (change, step, image) = (self.of(g, x), self.step(g, x), self.image.of(g, x));
        let (sum, h) = (g.add(x, image), g.mul(half, step));
        let mean = g.mul(half, sum);
        let sine = call(g, "sinh", h);
        let quotient = quotient_or(g, sine, h, one);
        let power = g.exp(mean);
        let slope = g.mul(power, quotient);
        g.mul(change, slope)
    }

    /// δxᶜ = bᶜ⁻¹ δx ((1 + r)ᶜ − 1)/r, with b and r of [`Self::relative_step`].
    fn of_power(&mut self, g: &mut Graph, x: NodeId, exponent: NodeId) -> NodeId {
        let (base, step) = self.relative_step(g, x);
        let logarithm = call(g, "log1p", step);
        let growth = g.mul(exponent, logarithm);
        let growth = call(g, "expm1", growth);
        let quotient = quotient_or(g, growth, step, exponent);
        let power = g.plain_pow(base, exponent);
        let slope = g.div(power, base);
        let (slope, change) = (g.mul(slope, quotient), self.of(g, x));
        g.mul(change, slope)
    }

    /// Returns the larger one b of x and x′, and r, with which the other one is b (1 + r).
    fn relative_step(&mut self, g: &mut Graph, x: NodeId) -> (NodeId, NodeId) {
        let (step, image) = (self.step(g, x), self.image.of(g, x));
        let larger = g.precedes(image, x);
        let opposite = g.neg(step);
        let (base, step) = (g.select(larger, x, image), g.select(larger, opposite, step));
        (base, g.div(step, base))
    }

    /// Returns the quotient of the chosen branch, or the plain quotient where the image is in the other branch.
    fn of_selection(&mut self, g: &mut Graph, f: NodeId, (mask, yes, no): (NodeId, NodeId, NodeId)) -> NodeId {
        let (dyes, dno, image) = (self.of(g, yes), self.of(g, no), self.image.of(g, mask));
        let change = g.select(mask, dyes, dno);
        if image == mask {
            return change;
        }
        let (not_mask, not_image) = (g.not(mask), g.not(image));
        let (both, neither) = (g.and(mask, image), g.and(not_mask, not_image));
        let same = g.or(both, neither);
        let plain = self.plain_quotient(g, f);
        g.select(same, change, plain)
    }

    fn plain_quotient(&mut self, g: &mut Graph, f: NodeId) -> NodeId {
        let image = self.image.of(g, f);
        let difference = g.plain_difference(f, image);
        g.div(difference, self.distance)
    }

    /// Returns the quotient for any function of x, y, …: the mean of its slope between both images where they are
    /// close, the plain quotient elsewhere.
    fn of_any(&mut self, g: &mut Graph, f: NodeId) -> NodeId {
        let arguments = match g.rule(f) {
            Some(rule) => rule.arguments.clone(),
            None => g.op(f).operands().filter(|&operand| !g.op(operand).is_mask()).collect(),
        };
        let steps: Vec<NodeId> = arguments.iter().map(|&x| self.step(g, x)).collect();
        let changes: Vec<NodeId> = arguments.iter().map(|&x| self.of(g, x)).collect();
        let images: Vec<NodeId> = arguments.iter().map(|&x| self.image.of(g, x)).collect();
        let coordinates = Coordinates::of_nodes(g, &arguments);
        let slopes = first_derivatives(g, &[f], &coordinates, Order::First).remove(0);
        let means = GAUSS.map(|(place, weight)| {
            let (place, weight) = (g.constant(place), g.constant(weight));
            let between = images.iter().zip(&steps).map(|(&image, &step)| {
                let part = g.mul(place, step);
                g.add(image, part)
            });
            let between: Vec<NodeId> = between.collect();
            let mut moved = Substitution::new(g, arguments.iter().copied().zip(between));
            let slopes: Vec<NodeId> = slopes.iter().map(|&slope| moved.of(g, slope)).collect();
            let slope = g.dot(&slopes, &changes);
            g.mul(weight, slope)
        });
        let near = g.sum(means);
        let far = self.plain_quotient(g, f);
        let (short, one) = (g.constant(SHORT), g.constant(1.0));
        let sizes: Vec<NodeId> = arguments.iter().map(|&x| g.abs(x)).collect();
        let lengths: Vec<NodeId> = steps.iter().map(|&step| g.abs(step)).collect();
        let (size, length) = (g.sum(sizes), g.sum(lengths));
        let size = g.min(size, one);
        let limit = g.mul(short, size);
        let apart = g.precedes(limit, length);
        g.select(apart, far, near)
    }
}

fn call(g: &mut Graph, name: &str, x: NodeId) -> NodeId {
    let function = find(name).expect("a function of the language");
    (function.lower)(g, &[Lowered::scalar(x)]).node()
}

/// Returns a/b, or the limit where b = 0.
fn quotient_or(g: &mut Graph, a: NodeId, b: NodeId, limit: NodeId) -> NodeId {
    let zero = g.constant(0.0);
    let vanishes = g.equal(b, zero);
    let quotient = g.div(a, b);
    g.select(vanishes, limit, quotient)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::functions::RECOGNISERS;
    use crate::graph::{Input, Interpreter};
    use energy_runtime::Inputs;

    type Formula = fn(&mut Graph, NodeId, NodeId) -> NodeId;

    fn of_vector(g: &mut Graph, name: &str, a: NodeId, b: NodeId) -> NodeId {
        (find(name).expect("known").lower)(g, &[Lowered::vector([a, b])]).parts[0]
    }

    const FORMULAS: [(&str, Formula); 10] = [
        ("product", |g, a, b| {
            let square = g.mul(b, b);
            g.mul(a, square)
        }),
        ("quotient", |g, a, b| g.div(a, b)),
        ("root", |g, a, _| g.plain_sqrt(a)),
        ("exponential", |g, a, b| {
            let product = g.mul(a, b);
            let product = g.add(product, a);
            g.exp(product)
        }),
        ("logarithm", |g, a, _| g.ln(a)),
        ("power", |g, a, _| {
            let exponent = g.constant(-1.3);
            g.plain_pow(a, exponent)
        }),
        ("sine", |g, a, _| g.sin(a)),
        ("direction", |g, a, b| {
            let direction = of_vector(g, "unit", a, b);
            g.resolve(direction)
        }),
        ("length", |g, a, b| of_vector(g, "norm", a, b)),
        ("selection", |g, a, _| {
            let (limit, square) = (g.constant(0.75), g.mul(a, a));
            let mask = g.less(a, limit);
            g.select(mask, square, a)
        }),
    ];

    /// Returns δf of an exchange, and f − f′ over the distance.
    fn both(formula: Formula, a: f64, b: f64) -> [f64; 2] {
        let g = &mut Graph::robust(RECOGNISERS);
        let values = [0, 1].map(|i| g.input(Input::Position(i)));
        let reflection = Reflection::exchange(g, &values, &values, (0, 1));
        let f = formula(g, values[0], values[1]);
        let found = DividedDifference::new(g, &reflection, &[]).of(g, f);
        let mirrored = formula(g, values[1], values[0]);
        let inputs = Inputs { parameters: &[], rest: &[], positions: &[a, b], velocities: &[] };
        let numbers = Interpreter::new(g, &[found, f, mirrored]).evaluate(&inputs, &[]);
        [numbers[0], (numbers[1] - numbers[2]) / (a - b)]
    }

    #[test]
    fn quotients_equal_plain_differences_far_from_the_mirror() {
        for (name, formula) in FORMULAS {
            for (a, b) in [(0.5, 1.25), (3.0, 0.25), (0.8, 0.85)] {
                let [found, plain] = both(formula, a, b);
                assert!((found - plain).abs() <= 1e-13 * plain.abs(), "{name} at {a}, {b}: {found:e}, not {plain:e}");
            }
        }
    }

    #[test]
    fn quotients_keep_their_digits_at_the_mirror() {
        for (name, formula) in FORMULAS.into_iter().filter(|(name, _)| *name != "selection") {
            let [limit, far] = [both(formula, 1.5, 1.5)[0], both(formula, 1.5 + 1e-5, 1.5 - 1e-5)[1]];
            assert!((limit - far).abs() <= 1e-9 * limit.abs().max(1.0), "{name}: {limit:e}, not {far:e}");
        }
    }
}
