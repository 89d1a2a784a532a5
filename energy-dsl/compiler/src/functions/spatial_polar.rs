//! The polar decomposition F = R S of 3×3 matrices with det R = 1.
//!
//! The singular values are σ₁ ≥ σ₂ ≥ |σ₃|; σ₃ has the sign of det F. T = tr S = σ₁ + σ₂ + σ₃ is the largest root of
//! p(λ) = λ⁴ − 2iλ² − 8Jλ + 2‖FᵀF‖² − i² with i = ‖F‖² and J = det F. The gradient of T is R. So differentiating
//! p(T; F) = 0 gives
//!
//! ```text
//! R = ((λ² + i) F + 2λ cof F − 2 F FᵀF) / (λ³ − iλ − 2J).
//! ```
//!
//! Let rᵢ be the rows of R and K = T I − S. Moving F by X turns R by ω(X) = K⁻¹ a(X): dR = R \[ω\]ₓ with \[a\]ₓ = RᵀX −
//! XᵀR. For X = eₖ eₗᵀ, a = eₗ × rₖ. So the Hessian of T is a(X)ᵀ K⁻¹ a(Y). It is finite where singular values meet:
//! det K = (σ₁ + σ₂)(σ₂ + σ₃)(σ₃ + σ₁).

use super::Lowered;
use super::inner_product::inner_product;
use super::length::{common_scale, upper};
use crate::graph::{Form, Graph, NodeId, Primitive, Rule, symmetric_index};
use energy_runtime::Flag;

/// Three components.
type Vector = [NodeId; 3];
/// Three rows.
type Matrix = [Vector; 3];

/// Laguerre's steps of the textbook form. It starts at √(3i) ≥ T and converges from above, because all roots are real.
const TEXTBOOK_STEPS: usize = 10;
/// Where σ₂ + σ₃ is less than this part of σ₁, half of the digits of R are lost, and it is taken as 0.
const LEAST_GAP: f64 = 1e-7;

/// The rotation R of a 3×3 matrix, row by row, and T = tr S.
pub(super) struct Polar {
    pub(super) rotation: Vec<NodeId>,
    pub(super) trace: NodeId,
}

/// Computes the polar decomposition.
pub(super) fn polar(g: &mut Graph, f: &Lowered) -> Polar {
    match g.form() {
        Form::Textbook => textbook(g, &rows(&f.parts)),
        Form::Robust => robust(g, &f.parts),
    }
}

fn rows(parts: &[NodeId]) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| parts[3 * i + j]))
}

fn textbook(g: &mut Graph, f: &Matrix) -> Polar {
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

/// The polynomial p of a matrix F.
struct Quartic {
    /// FᵀF.
    gram: Matrix,
    cofactors: Matrix,
    /// i = ‖F‖².
    square: NodeId,
    /// J = det F.
    determinant: NodeId,
    /// 2‖FᵀF‖² − i².
    constant: NodeId,
}

impl Quartic {
    fn new(g: &mut Graph, f: &Matrix) -> Self {
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

fn robust(g: &mut Graph, arguments: &[NodeId]) -> Polar {
    let at = Decomposition::new(g, arguments);
    let rules = at.rotation_rules(g, arguments);
    let along = g.dot(&at.rotation.concat(), &at.scaled.concat());
    let trace = g.select(at.degenerate, at.root, along);
    let trace = g.div(trace, at.scale);
    let first = rules.iter().map(|&rule| vec![rule]).collect();
    let second = upper(9).map(|(x, y)| vec![vec![at.scale, at.turning(g, x, y)]]).collect();
    let rule = Rule::factored(Primitive::StretchTrace, arguments.to_vec(), trace, first, second);
    let trace = g.add_rule(rule.flagged(1, Flag::Degenerate, at.degenerate), &[]);
    Polar { rotation: rules, trace }
}

/// Recognises tr S − 3. Near rest it is the trace of the strain E = S − I, which keeps its digits.
pub(super) fn recognise_stretch_difference(g: &mut Graph, trace: NodeId, three: NodeId) -> Option<NodeId> {
    let rule = g.rule(trace).filter(|rule| rule.primitive == Primitive::StretchTrace)?.clone();
    if !g.is(three, 3.0) {
        return None;
    }
    let at = Decomposition::new(g, &rule.arguments);
    let strain = at.strain(g, &rule.arguments);
    let (near, far) = (self::trace(g, &strain.matrix), g.plain_difference(rule.value, three));
    let value = g.select(strain.small, near, far);
    Some(g.add_rule(Rule { primitive: Primitive::StretchTraceExcess, value, ..rule }, &[]))
}

/// Returns ‖F − R‖² = ‖E‖² with E = S − I. Its gradient is 2 (F − R) = 2 R E, its Hessian twice that of ½ ‖F‖² − tr S.
pub(super) fn distance_to_rotation(g: &mut Graph, arguments: &[NodeId]) -> NodeId {
    let at = Decomposition::new(g, arguments);
    let strain = at.strain(g, arguments);
    let (two, three) = (g.constant(2.0), g.constant(3.0));
    let all = strain.matrix.concat();
    let value = g.dot(&all, &all);
    // Without a rotation, the distance still has the limit ‖F‖² − 2 tr S + 3.
    let square = g.dot(arguments, arguments);
    let trace = g.div(at.root, at.scale);
    let twice = g.mul(two, trace);
    let limit = g.plain_difference(square, twice);
    let limit = g.add(limit, three);
    let value = g.select(at.degenerate, limit, value);
    let slopes = product(g, &at.rotation, &strain.matrix);
    let first = slopes.concat().into_iter().map(|slope| vec![two, slope]).collect();
    let second = upper(9)
        .map(|(x, y)| {
            let turning = at.turning(g, x, y);
            let turning = g.mul(at.scale, turning);
            let (zero, one) = (g.constant(0.0), g.constant(1.0));
            let entry = g.sub(if x == y { one } else { zero }, turning);
            vec![vec![two, g.select(at.degenerate, zero, entry)]]
        })
        .collect();
    let rule = Rule::factored(Primitive::DistanceToRotation, arguments.to_vec(), value, first, second);
    g.add_rule(rule.flagged(1, Flag::Degenerate, at.degenerate), &[])
}

/// The values of R and S, and how R turns. All numbers are those of scale · F.
struct Decomposition {
    scale: NodeId,
    scaled: Matrix,
    rotation: Matrix,
    stretch: Matrix,
    /// K⁻¹.
    inverse: Matrix,
    /// a(X) of the nine entries X of F.
    spins: Vec<Vector>,
    /// ω(X) = K⁻¹ a(X).
    turns: Vec<Vector>,
    /// tr S.
    root: NodeId,
    degenerate: NodeId,
}

impl Decomposition {
    fn new(g: &mut Graph, arguments: &[NodeId]) -> Self {
        let scale = common_scale(g, arguments);
        let scaled = rows(arguments).map(|row| row.map(|entry| g.mul(scale, entry)));
        let quartic = Quartic::new(g, &scaled);
        let (zero, one) = (g.constant(0.0), g.constant(1.0));
        let moderate = g.is_moderate(quartic.square, 2);
        g.assume(scale, one, moderate);
        let singular = eigenvalue_roots(g, &quartic);
        let mut root = g.sum(singular);
        for _ in 0..2 {
            root = quartic.newton(g, root);
        }
        let gap = g.add(singular[1], singular[2]);
        let least = g.constant(LEAST_GAP);
        let least = g.mul(least, singular[0]);
        let degenerate = g.less_or_equal(gap, least);
        let mut rotation = quartic.rotation(g, &scaled, root);
        for _ in 0..2 {
            rotation = polished(g, &rotation, &scaled);
        }
        let rotation = rotation.map(|row| row.map(|entry| g.select(degenerate, zero, entry)));
        let stretch = product(g, &transposed(&rotation), &scaled);
        let stretch = symmetric(g, &stretch);
        let Compliance { adjugate, determinant } = compliance(g, &stretch);
        let reciprocal = g.div(one, determinant);
        let reciprocal = g.select(degenerate, zero, reciprocal);
        let inverse = adjugate.map(|row| row.map(|entry| g.mul(reciprocal, entry)));
        let spins: Vec<Vector> = (0..9).map(|k| cross_with_axis(g, k % 3, &rotation[k / 3])).collect();
        let turns = spins.iter().map(|spin| times(g, &inverse, spin)).collect();
        Self { scale, scaled, rotation, stretch, inverse, spins, turns, root, degenerate }
    }

    /// Returns a(X)·K⁻¹ a(Y): the rate of entry X of R with Y, and the Hessian of tr S.
    fn turning(&self, g: &mut Graph, x: usize, y: usize) -> NodeId {
        g.dot(&self.spins[x], &self.turns[y])
    }

    /// Returns the entries of R as rules.
    fn rotation_rules(&self, g: &mut Graph, arguments: &[NodeId]) -> Vec<NodeId> {
        let seconds = Seconds::new(g, self);
        let square_of_scale = g.mul(self.scale, self.scale);
        let rule = |entry: usize| {
            let first = (0..9).map(|by| vec![self.scale, self.turning(g, entry, by)]).collect();
            let second = upper(9).map(|(x, y)| vec![vec![square_of_scale, seconds.entry(g, self, entry, x, y)]]);
            let second = second.collect();
            let primitive = Primitive::Rotation(entry as u8);
            let value = self.rotation[entry / 3][entry % 3];
            let rule = Rule::factored(primitive, arguments.to_vec(), value, first, second);
            g.add_rule(rule.flagged(0, Flag::Degenerate, self.degenerate), &[])
        };
        (0..9).map(rule).collect()
    }

    /// Returns E = S − I. Near rest it solves E (S + I) = FᵀF − I, whose right side keeps its digits.
    fn strain(&self, g: &mut Graph, arguments: &[NodeId]) -> Strain {
        let (zero, one, limit) = (g.constant(0.0), g.constant(1.0), g.constant(0.25));
        let stretch = self.stretch.map(|row| row.map(|entry| g.div(entry, self.scale)));
        let columns = transposed(&rows(arguments));
        let mut green = [[zero; 3]; 3];
        for (i, j) in upper(3) {
            let product = inner_product(g, &columns[i], &columns[j]);
            green[i][j] = if i == j { g.sub(product, one) } else { product };
            green[j][i] = green[i][j];
        }
        let (mut far, mut sum) = (stretch, stretch);
        for i in 0..3 {
            far[i][i] = g.sub(stretch[i][i], one);
            sum[i][i] = g.add(stretch[i][i], one);
        }
        let Compliance { adjugate, determinant } = inverted(g, &sum);
        let near = product(g, &green, &adjugate);
        let near = near.map(|row| row.map(|entry| g.div(entry, determinant)));
        let near = symmetric(g, &near);
        let all = green.concat();
        let size = g.dot(&all, &all);
        let close = g.less(size, limit);
        let upright = g.less(zero, self.root);
        let small = g.and(close, upright);
        let matrix = std::array::from_fn(|i| std::array::from_fn(|j| g.select(small, near[i][j], far[i][j])));
        Strain { matrix, small }
    }
}

/// The strain E = S − I, and whether it is small.
struct Strain {
    matrix: Matrix,
    small: NodeId,
}

/// Returns σ₁, σ₂ and σ₃ of a 3×3 matrix. Near equal ones, half of the digits are lost.
pub(super) fn signed_singular_values(g: &mut Graph, f: &[NodeId]) -> [NodeId; 3] {
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

/// Returns R after a step of Newton's method. It turns R by K⁻¹ a with \[a\]ₓ = RᵀF − FᵀR, and makes it orthogonal
/// again.
fn polished(g: &mut Graph, r: &Matrix, f: &Matrix) -> Matrix {
    let stretch = product(g, &transposed(r), f);
    let spin = [(2, 1), (0, 2), (1, 0)].map(|(i, j)| g.sub(stretch[i][j], stretch[j][i]));
    let mean = symmetric(g, &stretch);
    let compliance = compliance(g, &mean);
    let zero = g.constant(0.0);
    let singular = g.equal(compliance.determinant, zero);
    let turn: Vector = std::array::from_fn(|i| {
        let numerator = g.dot(&compliance.adjugate[i], &spin);
        let quotient = g.div(numerator, compliance.determinant);
        g.select(singular, zero, quotient)
    });
    // Row by row, R [ω]ₓ is r × ω.
    let turned = r.map(|row| {
        let change = g.cross(&row, &turn);
        std::array::from_fn(|j| g.add(row[j], change[j]))
    });
    // R (3 − RᵀR)/2.
    let gram = product(g, &transposed(&turned), &turned);
    let cubic = product(g, &turned, &gram);
    let (half, three_halves) = (g.constant(0.5), g.constant(1.5));
    std::array::from_fn(|i| {
        std::array::from_fn(|j| {
            let (more, less) = (g.mul(three_halves, turned[i][j]), g.mul(half, cubic[i][j]));
            g.sub(more, less)
        })
    })
}

/// The inverse of a symmetric matrix, as adj M/det M.
struct Compliance {
    adjugate: Matrix,
    determinant: NodeId,
}

/// Returns K⁻¹ of K = (tr S) I − S.
fn compliance(g: &mut Graph, stretch: &Matrix) -> Compliance {
    let others = |g: &mut Graph, i: usize| g.add(stretch[(i + 1) % 3][(i + 1) % 3], stretch[(i + 2) % 3][(i + 2) % 3]);
    let stiffness = std::array::from_fn(|i| {
        std::array::from_fn(|j| if i == j { others(g, i) } else { g.neg(stretch[i.min(j)][i.max(j)]) })
    });
    inverted(g, &stiffness)
}

fn inverted(g: &mut Graph, matrix: &Matrix) -> Compliance {
    let adjugate = [1, 2, 0].map(|i| g.cross(&matrix[i], &matrix[(i + 1) % 3]));
    let determinant = g.dot(&matrix[0], &adjugate[0]);
    Compliance { adjugate, determinant }
}

/// The second derivatives of R: d²R(X, Y) = R (\[ω(Y)\]ₓ \[ω(X)\]ₓ + \[dω\]ₓ) with dω = K⁻¹ (da − dK ω(X)). For X = eₖ
/// eₗᵀ, da = eₗ × (rₖ × ω(Y)). Also, dK = tr(dS) I − dS with dS = RᵀY − \[ω(Y)\]ₓ S.
struct Seconds {
    /// dω for each pair X ≤ Y.
    changes: Vec<Vector>,
}

impl Seconds {
    fn new(g: &mut Graph, at: &Decomposition) -> Self {
        let rates: Vec<Matrix> = (0..9).map(|y| stretch_rate(g, at, y)).collect();
        let change = |(x, y): (usize, usize)| {
            let moved = g.cross(&at.rotation[x / 3], &at.turns[y]);
            let of_spin = cross_with_axis(g, x % 3, &moved);
            let trace = trace(g, &rates[y]);
            let along = times(g, &rates[y], &at.turns[x]);
            let residual = std::array::from_fn(|i| {
                let stiffness = g.mul(trace, at.turns[x][i]);
                let sum = g.add(of_spin[i], along[i]);
                g.sub(sum, stiffness)
            });
            times(g, &at.inverse, &residual)
        };
        Self { changes: upper(9).map(change).collect() }
    }

    /// Returns ∂²R/∂X∂Y of an entry of R, x ≤ y: rᵢ·ω(X) ω(Y)ⱼ − ω(X)·ω(Y) Rᵢⱼ + (rᵢ × dω)ⱼ.
    fn entry(&self, g: &mut Graph, at: &Decomposition, entry: usize, x: usize, y: usize) -> NodeId {
        let (row, j) = (&at.rotation[entry / 3], entry % 3);
        let change = &self.changes[symmetric_index(9, x, y)];
        let along = g.dot(row, &at.turns[x]);
        let turned = g.mul(along, at.turns[y][j]);
        let inner = g.dot(&at.turns[x], &at.turns[y]);
        let shrunk = g.mul(inner, row[j]);
        let crossed = g.cross(row, change);
        let difference = g.sub(turned, shrunk);
        g.add(difference, crossed[j])
    }
}

/// Returns dS = RᵀY − \[ω\]ₓ S for Y = eₖ eₗᵀ. It is symmetric.
fn stretch_rate(g: &mut Graph, at: &Decomposition, y: usize) -> Matrix {
    let (k, l, stretch) = (y / 3, y % 3, &at.stretch);
    let turned: Vec<Vector> = (0..3)
        .map(|j| {
            let column = [stretch[0][j], stretch[1][j], stretch[2][j]];
            g.cross(&at.turns[y], &column)
        })
        .collect();
    let rate: Matrix = std::array::from_fn(|i| {
        std::array::from_fn(|j| {
            let minus = turned[j][i];
            if j == l { g.sub(at.rotation[k][i], minus) } else { g.neg(minus) }
        })
    });
    symmetric(g, &rate)
}

/// Returns eₗ × v.
fn cross_with_axis(g: &mut Graph, axis: usize, v: &Vector) -> Vector {
    let mut result = [g.constant(0.0); 3];
    let (next, last) = ((axis + 1) % 3, (axis + 2) % 3);
    result[next] = g.neg(v[last]);
    result[last] = v[next];
    result
}

fn transposed(m: &Matrix) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| m[j][i]))
}

fn product(g: &mut Graph, a: &Matrix, b: &Matrix) -> Matrix {
    let columns = transposed(b);
    std::array::from_fn(|i| std::array::from_fn(|j| g.dot(&a[i], &columns[j])))
}

fn times(g: &mut Graph, m: &Matrix, v: &Vector) -> Vector {
    std::array::from_fn(|i| g.dot(&m[i], v))
}

fn trace(g: &mut Graph, m: &Matrix) -> NodeId {
    g.sum(vec![m[0][0], m[1][1], m[2][2]])
}

/// Returns (M + Mᵀ)/2.
fn symmetric(g: &mut Graph, m: &Matrix) -> Matrix {
    let half = g.constant(0.5);
    let mut result = *m;
    for (i, j) in [(0, 1), (0, 2), (1, 2)] {
        let sum = g.add(m[i][j], m[j][i]);
        result[i][j] = g.mul(half, sum);
        result[j][i] = result[i][j];
    }
    result
}
