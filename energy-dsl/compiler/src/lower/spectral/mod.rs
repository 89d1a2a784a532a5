//! Functions ψ of the singular values of a matrix F, with derivatives that stay finite where singular values meet.
//!
//! With F = Σ σᵢ uᵢ vᵢᵀ, indices of ψ for derivatives by σᵢ, and xᵢⱼ = uᵢᵀ X vⱼ:
//!
//! ```text
//! dψ(X)     = Σᵢ ψᵢ xᵢᵢ
//! d²ψ(X, X) = Σᵢⱼ ψᵢⱼ xᵢᵢ xⱼⱼ + ½ Σᵢ﹤ⱼ (ψᵢ − ψⱼ)/(σᵢ − σⱼ) (xᵢⱼ + xⱼᵢ)² + ½ Σᵢ﹤ⱼ (ψᵢ + ψⱼ)/(σᵢ + σⱼ) (xᵢⱼ − xⱼᵢ)²
//! ```
//!
//! A 3×2 matrix with the normal n of its columns adds Σᵢ ψᵢ/σᵢ (nᵀX vᵢ)². Each quotient belongs to a reflection of the
//! singular values: they change places, change places and signs, or one changes its sign. If ψ is the same after it,
//! `reflection.rs` computes the quotient without cancellation. Otherwise the derivative has no limit where the divisor
//! is 0.

mod reflection;
mod symmetry;

use crate::diff::{Coordinates, Order, first_derivatives, second_derivatives};
use crate::functions::Lowered;
use crate::graph::{Dependence, Graph, NodeId, Primitive, Rule, Spectrum};
use energy_runtime::Flag;
use reflection::{DividedDifference, Reflection};
use symmetry::{Branches, conditions, with_selections};

/// Singular values closer than this part of the largest one are equal up to rounding.
const ROUNDING: f64 = 4e-15;
/// Functions with more conditions are taken whole: the number of branches doubles with each condition.
const MOST_CONDITIONS: usize = 5;

/// Turns functions of singular values into rules where they meet other moving numbers.
#[derive(Default)]
pub(super) struct Spectral {
    dependence: Vec<Dependence>,
}

impl Spectral {
    /// Replaces functions of singular values among operands, if these depend on anything else that moves.
    pub(super) fn separate(&mut self, g: &mut Graph, operands: &mut [Lowered]) {
        if g.spectra().is_empty() {
            return;
        }
        g.trace_dependence(&mut self.dependence);
        let parts = operands.iter().flat_map(|operand| &operand.parts);
        let all = parts.map(|part| self.dependence[part.0 as usize]).fold(Dependence::Fixed, Dependence::join);
        if all == Dependence::Mixed {
            operands.iter_mut().for_each(|operand| self.close(g, &mut operand.parts));
        }
    }

    /// Replaces all functions of singular values.
    pub(super) fn close(&mut self, g: &mut Graph, nodes: &mut [NodeId]) {
        if g.spectra().is_empty() {
            return;
        }
        g.trace_dependence(&mut self.dependence);
        for node in nodes {
            if let Dependence::Spectral(index) = self.dependence[node.0 as usize]
                && !g.op(*node).is_mask()
            {
                *node = rule(g, *node, index);
            }
        }
    }
}

/// A term weight · a aᵀ of the Hessian, over the entries of F.
struct Mode {
    weight: NodeId,
    vector: Vec<NodeId>,
}

/// Returns ψ as a rule of the entries of F.
fn rule(g: &mut Graph, psi: NodeId, index: usize) -> NodeId {
    let spectrum = g.spectra()[index].clone();
    let psi = with_selections(g, psi, &spectrum.values);
    let Spectrum { matrix, values, left, right, .. } = &spectrum;
    let coordinates = Coordinates::of_nodes(g, values);
    let slopes = first_derivatives(g, &[psi], &coordinates, Order::First).remove(0);
    let curvatures = second_derivatives(g, psi, &coordinates);
    let count = values.len();
    let curvature = |g: &mut Graph, i: usize, j: usize| {
        curvatures.get(&(i.min(j) * count + i.max(j))).copied().unwrap_or_else(|| g.constant(0.0))
    };
    let along: Vec<Vec<NodeId>> = (0..count).map(|i| outer(g, &left[i], &right[i])).collect();
    let (modes, flags) = modes(g, psi, &slopes, &spectrum);
    // Σⱼ ψᵢⱼ uⱼ vⱼᵀ.
    let bent: Vec<Vec<NodeId>> = (0..count)
        .map(|i| {
            let row: Vec<NodeId> = (0..count).map(|j| curvature(g, i, j)).collect();
            (0..matrix.len()).map(|k| g.dot(&row, &column(&along, k))).collect()
        })
        .collect();
    let weighted: Vec<Vec<NodeId>> = modes.iter().map(|mode| g.scaled(mode.weight, &mode.vector)).collect();
    let vectors: Vec<Vec<NodeId>> = modes.into_iter().map(|mode| mode.vector).collect();
    let first = (0..matrix.len()).map(|k| g.dot(&slopes, &column(&along, k))).collect();
    let mut second = Vec::new();
    for k in 0..matrix.len() {
        for l in k..matrix.len() {
            let diagonal = g.dot(&column(&along, k), &column(&bent, l));
            let others = g.dot(&column(&vectors, k), &column(&weighted, l));
            second.push(g.add(diagonal, others));
        }
    }
    let rule = Rule::smooth(Primitive::Spectral, matrix.clone(), psi, first, second);
    let rule = flags.into_iter().fold(rule, |rule, (flag, mask)| rule.flagged(1, flag, mask));
    g.add_rule(Rule { inner: Some(psi), ..rule }, &[psi])
}

/// Returns the terms of the Hessian that turn singular vectors, and the flags of their quotients.
fn modes(g: &mut Graph, psi: NodeId, slopes: &[NodeId], spectrum: &Spectrum) -> (Vec<Mode>, Vec<(Flag, NodeId)>) {
    let Spectrum { values, left, right, normal, .. } = spectrum;
    let half = g.constant(0.5);
    let (mut modes, mut flags) = (Vec::new(), Vec::new());
    for i in 0..values.len() {
        for j in i + 1..values.len() {
            let (a, b) = (outer(g, &left[i], &right[j]), outer(g, &left[j], &right[i]));
            let sum = a.iter().zip(&b).map(|(&a, &b)| g.add(a, b)).collect();
            let difference = a.iter().zip(&b).map(|(&a, &b)| g.sub(a, b)).collect();
            let exchange = Reflection::exchange(g, values, slopes, (i, j));
            let reversal = Reflection::reversal(g, values, slopes, (i, j));
            for (reflection, vector, flag) in [(exchange, sum, Flag::Kink), (reversal, difference, Flag::Degenerate)] {
                let (quotient, singular) = quotient(g, psi, slopes[i], &reflection, values[0]);
                flags.extend(singular.map(|mask| (flag, mask)));
                modes.push(Mode { weight: g.mul(half, quotient), vector });
            }
        }
    }
    if let Some(normal) = normal {
        for i in 0..values.len() {
            let negation = Reflection::negation(g, values, slopes, i);
            let (weight, singular) = quotient(g, psi, slopes[i], &negation, values[0]);
            flags.extend(singular.map(|mask| (Flag::Degenerate, mask)));
            modes.push(Mode { weight, vector: outer(g, normal, &right[i]) });
        }
    }
    (modes, flags)
}

/// Returns the quotient that belongs to a reflection, and where it has no limit.
///
/// Conditions of selections keep their outcome in it: the branch that is taken counts, which may be symmetric where the
/// condition is not.
fn quotient(
    g: &mut Graph,
    psi: NodeId,
    slope: NodeId,
    reflection: &Reflection,
    largest: NodeId,
) -> (NodeId, Option<NodeId>) {
    let conditions = Some(conditions(g, psi)).filter(|all| all.len() <= MOST_CONDITIONS).unwrap_or_default();
    let branches = Branches::of(g, psi, &reflection.images, &conditions);
    let symmetric = |g: &mut Graph| DividedDifference::new(g, reflection, &conditions).of(g, slope);
    match branches {
        Branches::Symmetric => (symmetric(g), None),
        Branches::Asymmetric => plain_quotient(g, reflection, largest),
        Branches::SymmetricWhere(mask) => {
            let (smooth, (plain, singular)) = (symmetric(g), plain_quotient(g, reflection, largest));
            let asymmetric = g.not(mask);
            (g.select(mask, smooth, plain), singular.map(|singular| g.and(asymmetric, singular)))
        }
    }
}

fn plain_quotient(g: &mut Graph, reflection: &Reflection, largest: NodeId) -> (NodeId, Option<NodeId>) {
    let zero = g.constant(0.0);
    if g.is(reflection.numerator, 0.0) {
        return (zero, None);
    }
    let rounding = g.constant(ROUNDING);
    let least = g.mul(rounding, largest);
    let size = g.abs(reflection.distance);
    let singular = g.less_or_equal(size, least);
    let quotient = g.div(reflection.numerator, reflection.distance);
    (g.select(singular, zero, quotient), Some(singular))
}

/// Returns the entries of a bᵀ, row by row.
fn outer(g: &mut Graph, a: &[NodeId], b: &[NodeId]) -> Vec<NodeId> {
    a.iter().flat_map(|&a| b.iter().map(|&b| g.mul(a, b)).collect::<Vec<_>>()).collect()
}

fn column(rows: &[Vec<NodeId>], k: usize) -> Vec<NodeId> {
    rows.iter().map(|row| row[k]).collect()
}
