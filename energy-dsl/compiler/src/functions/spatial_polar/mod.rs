//! The polar decomposition F = R S of 3×3 matrices with det R = 1.
//!
//! The singular values are σ₁ ≥ σ₂ ≥ |σ₃|; σ₃ has the sign of det F, and T = tr S = σ₁ + σ₂ + σ₃. Let rᵢ be the rows of
//! R and K = T I − S. Moving F by X turns R by ω(X) = K⁻¹ a(X): dR = R \[ω\]ₓ with \[a\]ₓ = RᵀX − XᵀR. For X = eₖ eₗᵀ,
//! a = eₗ × rₖ. So the Hessian of T is a(X)ᵀ K⁻¹ a(Y). It is finite where singular values meet: det K = (σ₁ + σ₂)(σ₂ +
//! σ₃)(σ₃ + σ₁).
//!
//! The condition number of R is κ = σ₁/(σ₂ + σ₃). Where it is small, `quartic.rs` finds R and T in few operations.
//! Elsewhere, for needles and near mirror images, `singular_vectors.rs` does.

mod contraction;
mod matrix;
mod newton;
mod quartic;
mod singular_vectors;

use super::Lowered;
use super::inner_product::inner_product;
use super::length::common_scale;
use crate::graph::{Form, Graph, NodeId, Primitive, Rule, symmetric_index, upper};
use matrix::{Inverse, Matrix, Vector, inverted, product, rows, symmetric, times, trace, transposed};
use quartic::Quartic;

pub(super) use quartic::signed_singular_values;

/// The rotation R of a 3×3 matrix, row by row, and T = tr S.
pub(super) struct Polar {
    pub(super) rotation: Vec<NodeId>,
    pub(super) trace: NodeId,
}

/// Computes the polar decomposition.
pub(super) fn polar(g: &mut Graph, f: &Lowered) -> Polar {
    match g.form() {
        Form::Textbook => quartic::textbook(g, &rows(&f.parts)),
        Form::Robust => robust(g, &f.parts),
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
    let trace = g.add_rule(rule.without_limit(1, at.degenerate), &[]);
    at.note_stretch(g, arguments);
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
    let arguments = rule.arguments.clone();
    let excess = g.add_rule(Rule { primitive: Primitive::StretchTraceExcess, value, ..rule }, &[]);
    at.note_stretch(g, &arguments);
    Some(excess)
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
    let distance = g.add_rule(rule.without_limit(1, at.degenerate), &[]);
    at.note_stretch(g, arguments);
    distance
}

/// R, S, K⁻¹ and T of a matrix. S and K⁻¹ are those of the same matrix close to F: in second derivatives, their errors
/// cancel.
struct Factors {
    rotation: Matrix,
    stretch: Matrix,
    inverse: Matrix,
    trace: NodeId,
}

/// The values of R and S, and how R turns. All numbers are those of scale · F.
struct Decomposition {
    scale: NodeId,
    scaled: Matrix,
    rotation: Matrix,
    stretch: Matrix,
    /// S with the errors of K⁻¹.
    consistent: Matrix,
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
        let one = g.constant(1.0);
        let moderate = g.is_moderate(quartic.square, 2);
        g.assume(scale, one, moderate);
        let (quick, suffices) = quartic::factors(g, &quartic, &scaled);
        let (careful, singular) = singular_vectors::factors(g, arguments, &scaled);
        let mut pick = |quick: NodeId, careful: NodeId| {
            let picked = g.select(suffices, quick, careful);
            g.assume(picked, quick, suffices);
            picked
        };
        let mut picks =
            |a: &Matrix, b: &Matrix| std::array::from_fn(|i| std::array::from_fn(|j| pick(a[i][j], b[i][j])));
        let (rotation, inverse) = (picks(&quick.rotation, &careful.rotation), picks(&quick.inverse, &careful.inverse));
        let consistent = picks(&quick.stretch, &careful.stretch);
        let root = pick(quick.trace, careful.trace);
        let (fails, never) = (g.not(suffices), g.truth(false));
        let degenerate = g.and(fails, singular);
        g.assume(degenerate, never, suffices);
        let stretch = product(g, &transposed(&rotation), &scaled);
        let stretch = symmetric(g, &stretch);
        let spins: Vec<Vector> = (0..9).map(|k| cross_with_axis(g, k % 3, &rotation[k / 3])).collect();
        let turns = spins.iter().map(|spin| times(g, &inverse, spin)).collect();
        Self { scale, scaled, rotation, stretch, consistent, inverse, spins, turns, root, degenerate }
    }

    /// Returns a(X)·K⁻¹ a(Y): the rate of entry X of R with Y, and the Hessian of tr S.
    fn turning(&self, g: &mut Graph, x: usize, y: usize) -> NodeId {
        g.dot(&self.spins[x], &self.turns[y])
    }

    /// Notes the contraction of the known functions of S, if there are any.
    fn note_stretch(&self, g: &mut Graph, arguments: &[NodeId]) {
        let contraction = contraction::of_stretch(g, self, arguments);
        if !contraction.values.is_empty() {
            g.note_contraction(contraction);
        }
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
            g.add_rule(rule.without_limit(0, self.degenerate), &[])
        };
        let values: Vec<NodeId> = (0..9).map(rule).collect();
        if values.iter().all(|&value| g.rule(value).is_some()) {
            g.note_contraction(contraction::of_rotation(self, arguments, values.clone()));
        }
        values
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
        let Inverse { adjugate, determinant } = inverted(g, &sum);
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
    let (k, l, stretch) = (y / 3, y % 3, &at.consistent);
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
