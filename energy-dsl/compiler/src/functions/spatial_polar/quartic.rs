//! The polynomial p(λ) = λ⁴ − 2iλ² − 8Jλ + 2‖FᵀF‖² − i² with i = ‖F‖² and J = det F, whose largest root is T = tr S.
//!
//! The gradient of T is R. So differentiating p(T; F) = 0 gives
//!
//! ```text
//! R = ((λ² + i) F + 2λ cof F − 2 F FᵀF) / (λ³ − iλ − 2J).
//! ```
//!
//! The slope is p′(T) = 4 (σ₁ + σ₂)(σ₂ + σ₃)(σ₃ + σ₁), so rounding errors are amplified by the square of the condition
//! number σ₁/(σ₂ + σ₃).

use super::matrix::{Inverse, Matrix, product, rows, symmetric, trace, transposed};
use super::newton::{compliance, polished};
use super::{Factors, Polar};
use crate::graph::{Form, Graph, NodeId};

/// Laguerre's steps of the textbook form. It starts at √(3i) ≥ T and converges from above, because all roots are real.
/// Far from a nearly double root, each step divides the distance by four only: this number reaches gaps of 1e-13.
const TEXTBOOK_STEPS: usize = 28;
/// The largest condition numbers for which two steps of Newton's method correct the errors of R: in double precision
/// and in single precision.
const LARGEST_CONDITION: (f64, f64) = (500.0, 32.0);
/// The largest ratio (σ₂ − σ₃)/(σ₂ + σ₃). It amplifies the errors of R in S.
const LARGEST_REFLECTION: f64 = 16.0;

/// The polynomial p of a matrix F.
pub(super) struct Quartic {
    /// FᵀF.
    gram: Matrix,
    cofactors: Matrix,
    /// i = ‖F‖².
    pub(super) square: NodeId,
    /// J = det F.
    determinant: NodeId,
    /// 2‖FᵀF‖² − i².
    constant: NodeId,
}

impl Quartic {
    pub(super) fn new(g: &mut Graph, f: &Matrix) -> Self {
        let columns = transposed(f);
        let gram = product(g, &columns, f);
        let square = trace(g, &gram);
        let cofactors = [1, 2, 0].map(|i| g.cross(&f[i], &f[(i + 1) % 3]));
        let determinant = g.dot(&f[0], &cofactors[0]);
        let (all, two) = (gram.concat(), g.constant(2.0));
        let norm = g.dot(&all, &all);
        let (doubled, squared) = (g.mul(two, norm), g.mul(square, square));
        let constant = g.sub(doubled, squared);
        Self { gram, cofactors, square, determinant, constant }
    }

    /// Returns p′(λ)/4 = λ³ − iλ − 2J.
    fn slope(&self, g: &mut Graph, root: NodeId) -> NodeId {
        let two = g.constant(2.0);
        let squared = g.mul(root, root);
        let reduced = g.sub(squared, self.square);
        let (cubic, linear) = (g.mul(reduced, root), g.mul(two, self.determinant));
        g.sub(cubic, linear)
    }

    /// Returns p(λ).
    fn value(&self, g: &mut Graph, root: NodeId) -> NodeId {
        let [two, eight] = [2.0, 8.0].map(|number| g.constant(number));
        let squared = g.mul(root, root);
        let twice = g.mul(two, self.square);
        let reduced = g.sub(squared, twice);
        let cubic = g.mul(reduced, root);
        let linear = g.mul(eight, self.determinant);
        let sum = g.sub(cubic, linear);
        let product = g.mul(sum, root);
        g.add(product, self.constant)
    }

    /// Returns λ − p(λ)/p′(λ), or λ where p′ = 0.
    fn newton(&self, g: &mut Graph, root: NodeId) -> NodeId {
        let (zero, four) = (g.constant(0.0), g.constant(4.0));
        let (value, slope) = (self.value(g, root), self.slope(g, root));
        let slope = g.mul(four, slope);
        let step = g.div(value, slope);
        let flat = g.equal(slope, zero);
        let step = g.select(flat, zero, step);
        g.sub(root, step)
    }

    /// Returns λ − p/(p′/4 + √(9 (p′/4)² − ¾ p p″)), Laguerre's step.
    fn laguerre(&self, g: &mut Graph, root: NodeId) -> NodeId {
        let [three, nine] = [3.0, 9.0].map(|number| g.constant(number));
        let (value, slope) = (self.value(g, root), self.slope(g, root));
        // p″/4 = 3λ² − i.
        let squared = g.mul(root, root);
        let squared = g.mul(three, squared);
        let curvature = g.sub(squared, self.square);
        let square_of_slope = g.mul(slope, slope);
        let first = g.mul(nine, square_of_slope);
        let second = g.mul(value, curvature);
        let second = g.mul(three, second);
        let discriminant = g.sub(first, second);
        let distance = g.sqrt(discriminant);
        let divisor = g.add(slope, distance);
        let step = g.div(value, divisor);
        g.sub(root, step)
    }

    /// Returns R.
    fn rotation(&self, g: &mut Graph, f: &Matrix, root: NodeId) -> Matrix {
        let two = g.constant(2.0);
        let squared = g.mul(root, root);
        let (linear, twice) = (g.add(squared, self.square), g.mul(two, root));
        let slope = self.slope(g, root);
        let cubic = product(g, f, &self.gram);
        std::array::from_fn(|i| {
            std::array::from_fn(|j| {
                let minus = g.mul(two, cubic[i][j]);
                let sum = g.dot(&[linear, twice], &[f[i][j], self.cofactors[i][j]]);
                let numerator = g.sub(sum, minus);
                g.div(numerator, slope)
            })
        })
    }
}

/// Computes R and T in the textbook form.
pub(super) fn textbook(g: &mut Graph, f: &Matrix) -> Polar {
    let quartic = Quartic::new(g, f);
    let three = g.constant(3.0);
    let bound = g.mul(three, quartic.square);
    let mut root = g.sqrt(bound);
    for _ in 0..TEXTBOOK_STEPS {
        root = quartic.laguerre(g, root);
    }
    let rotation = quartic.rotation(g, f, root);
    Polar { rotation: rotation.concat(), trace: root }
}

/// Computes R, K⁻¹ and T of a matrix. The mask tells where they are accurate.
pub(super) fn factors(g: &mut Graph, quartic: &Quartic, f: &Matrix) -> (Factors, NodeId) {
    let [first, second, third] = eigenvalue_roots(g, quartic);
    let mut root = g.sum([first, second, third]);
    for _ in 0..2 {
        root = quartic.newton(g, root);
    }
    let mut rotation = quartic.rotation(g, f, root);
    for _ in 0..2 {
        rotation = polished(g, &rotation, f);
    }
    let stretch = product(g, &transposed(&rotation), f);
    let stretch = symmetric(g, &stretch);
    let Inverse { adjugate, determinant } = compliance(g, &stretch);
    let one = g.constant(1.0);
    let reciprocal = g.div(one, determinant);
    let inverse = adjugate.map(|row| row.map(|entry| g.mul(reciprocal, entry)));
    let (gap, width) = (g.add(second, third), g.sub(second, third));
    let largest = g.by_precision(LARGEST_CONDITION.0, LARGEST_CONDITION.1);
    let by_condition = g.mul(largest, gap);
    let reflection = g.constant(LARGEST_REFLECTION);
    let by_reflection = g.mul(reflection, gap);
    let (is_thick, is_upright) = (g.less(first, by_condition), g.less(width, by_reflection));
    (Factors { rotation, stretch, inverse, trace: root }, g.and(is_thick, is_upright))
}

/// Returns σ₁, σ₂ and σ₃ of a 3×3 matrix. Near equal ones, half of the digits are lost.
pub(in super::super) fn signed_singular_values(g: &mut Graph, f: &[NodeId]) -> [NodeId; 3] {
    let quartic = Quartic::new(g, &rows(f));
    eigenvalue_roots(g, &quartic)
}

/// Returns σ₁, σ₂ and σ₃, from the eigenvalues of FᵀF by the trigonometric formula.
fn eigenvalue_roots(g: &mut Graph, quartic: &Quartic) -> [NodeId; 3] {
    let [zero, one, two, three, six] = [0.0, 1.0, 2.0, 3.0, 6.0].map(|number| g.constant(number));
    let mean = g.div(quartic.square, three);
    let mut deviator = quartic.gram;
    for (i, row) in deviator.iter_mut().enumerate() {
        row[i] = g.sub(row[i], mean);
    }
    let all = deviator.concat();
    let norm = g.dot(&all, &all);
    let variance = g.div(norm, six);
    let spread = g.sqrt(variance);
    let cofactors = g.cross(&deviator[1], &deviator[2]);
    let determinant = g.dot(&deviator[0], &cofactors);
    let cube = g.mul(variance, spread);
    let cube = g.mul(two, cube);
    let cosine = g.div(determinant, cube);
    // The textbook form has no value where two are equal: neither has its derivative.
    let is_robust = g.form() == Form::Robust;
    let cosine = if is_robust { between_minus_one_and_one(g, cosine, cube) } else { cosine };
    let (less, more) = (g.sub(one, cosine), g.add(one, cosine));
    let product = g.mul(less, more);
    let sine = g.sqrt(product);
    let angle = g.atan2(sine, cosine);
    let third = g.div(angle, three);
    // m + 2p cos φ and m + 2p cos(φ + 2π/3) = m − p (cos φ + √3 sin φ).
    let (cosine, sine) = (g.cos(third), g.sin(third));
    let root_of_three = g.constant(3.0_f64.sqrt());
    let doubled = g.mul(two, cosine);
    let along = g.mul(spread, doubled);
    let largest = g.add(mean, along);
    let across = g.mul(root_of_three, sine);
    let sum = g.add(cosine, across);
    let back = g.mul(spread, sum);
    let smallest = g.sub(mean, back);
    let both = g.add(largest, smallest);
    let middle = g.sub(quartic.square, both);
    let [first, second, third] = [largest, middle, smallest].map(|eigenvalue| {
        let positive = if is_robust { g.max(eigenvalue, zero) } else { eigenvalue };
        g.sqrt(positive)
    });
    let inverted = g.less(quartic.determinant, zero);
    let opposite = g.neg(third);
    [first, second, g.select(inverted, opposite, third)]
}

/// Returns a cosine whose divisor may be 0.
fn between_minus_one_and_one(g: &mut Graph, cosine: NodeId, divisor: NodeId) -> NodeId {
    let (zero, one) = (g.constant(0.0), g.constant(1.0));
    let (alike, minus_one) = (g.equal(divisor, zero), g.neg(one));
    let cosine = g.select(alike, one, cosine);
    let below = g.min(cosine, one);
    g.max(below, minus_one)
}
