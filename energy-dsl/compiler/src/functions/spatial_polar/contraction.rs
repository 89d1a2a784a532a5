//! Weighted sums of second derivatives in closed form.
//!
//! Let M = RᵀW, a = Σ wᵢ × rᵢ and b = K⁻¹ a. For the entries of R, the sum is
//! ω(X)·(M − S \[b\]ₓ − tr M) ω(Y) + c(X)·ω(Y) + c(Y)·ω(X). Here c = (b·rₖ) eₗ − Rₖₗ b for X = eₖ eₗᵀ. The first matrix
//! is symmetric, as S \[b\]ₓ + \[b\]ₓ S = \[a\]ₓ.

use super::Decomposition;
use super::matrix::{Matrix, Vector, product, rows, symmetric, times, trace, transposed};
use crate::graph::{Contraction, Graph, NodeId, Primitive, Product};

/// Creates the contraction of the entries of R.
pub(super) fn of_rotation(at: &Decomposition, arguments: &[NodeId], values: Vec<NodeId>) -> Contraction {
    let matrices = [at.rotation, at.consistent, at.inverse].into_iter().flatten().flatten();
    let factors = matrices.chain(at.turns.iter().copied().flatten()).chain([at.scale]).collect();
    let (family, arguments) = (Primitive::Rotation(0), arguments.to_vec());
    Contraction { family, fewest: 2, values, arguments, factors, first: None, second: of_entries }
}

/// Returns Σ wᵢⱼ ∇²Rᵢⱼ.
fn of_entries(g: &mut Graph, factors: &[NodeId], weights: &[NodeId]) -> Vec<Vec<Product>> {
    let [r, s, inverse] = [0, 9, 18].map(|first| rows(&factors[first..first + 9]));
    let turns = vectors(&factors[27..54]);
    let square_of_scale = g.mul(factors[54], factors[54]);
    let weights = rows(&g.scaled(square_of_scale, weights));
    let crossed: Matrix = std::array::from_fn(|i| g.cross(&weights[i], &r[i]));
    let spin = transposed(&crossed).map(|column| g.sum(column.to_vec()));
    let b = times(g, &inverse, &spin);
    let pulled = product(g, &transposed(&r), &weights);
    let form = form(g, &pulled, &s, &b);
    let along = times(g, &r, &b);
    let lever = |g: &mut Graph, x: usize| -> Vector {
        let (k, l) = (x / 3, x % 3);
        let minus = b.map(|b| g.mul(r[k][l], b));
        std::array::from_fn(|i| if i == l { g.sub(along[k], minus[i]) } else { g.neg(minus[i]) })
    };
    let levers: Vec<Vector> = (0..9).map(|x| lever(g, x)).collect();
    let bent: Vec<Vector> = (0..9)
        .map(|y| {
            let turned = times(g, &form, &turns[y]);
            std::array::from_fn(|i| g.add(turned[i], levers[y][i]))
        })
        .collect();
    entries(|x, y| [pairs(&turns[x], &bent[y]), pairs(&levers[x], &turns[y])].concat())
}

/// Returns M − S \[b\]ₓ − tr M, made symmetric.
fn form(g: &mut Graph, m: &Matrix, s: &Matrix, b: &Vector) -> Matrix {
    let trace = trace(g, m);
    // Row by row, s \[b\]ₓ is s × b.
    let form = std::array::from_fn(|i| {
        let turned = g.cross(&s[i], b);
        std::array::from_fn(|j| {
            let entry = g.sub(m[i][j], turned[j]);
            if i == j { g.sub(entry, trace) } else { entry }
        })
    });
    symmetric(g, &form)
}

fn vectors(components: &[NodeId]) -> Vec<Vector> {
    components.chunks_exact(3).map(|of| [of[0], of[1], of[2]]).collect()
}

fn pairs(a: &Vector, b: &Vector) -> Vec<Product> {
    a.iter().zip(b).map(|(&a, &b)| vec![a, b]).collect()
}

/// Returns a matrix of the entries of F with each other, row by row.
fn entries(of: impl Fn(usize, usize) -> Vec<Product>) -> Vec<Vec<Product>> {
    (0..81).map(|place| of(place / 9, place % 9)).collect()
}

/// Creates the contraction of tr S, tr S − 3 and ‖F − R‖², of those that are known.
pub(super) fn of_stretch(g: &mut Graph, at: &Decomposition, arguments: &[NodeId]) -> Contraction {
    let family = Primitive::StretchTrace;
    let vectors = at.spins.iter().chain(&at.turns).flatten().copied();
    let mut factors: Vec<NodeId> = [at.scale, at.degenerate].into_iter().chain(vectors).collect();
    let mut values = Vec::new();
    // Multiples of the Hessian of tr S, and of the identity.
    let multiples = [(family, [1.0, 0.0]), (Primitive::StretchTraceExcess, [1.0, 0.0])];
    for (primitive, of) in multiples.into_iter().chain([(Primitive::DistanceToRotation, [-2.0, 2.0])]) {
        if let Some(value) = g.known_rule(primitive, arguments) {
            values.push(value);
            factors.extend(of.map(|multiple| g.constant(multiple)));
        }
    }
    Contraction { family, fewest: 1, values, arguments: arguments.to_vec(), factors, first: None, second: of_norms }
}

/// Returns Σ wᵢ ∇²vᵢ with the Hessian a(X)·ω(Y) of tr S. The Hessian of the distance is 0 where R is not defined.
fn of_norms(g: &mut Graph, factors: &[NodeId], weights: &[NodeId]) -> Vec<Vec<Product>> {
    let ([scale, degenerate], vectors_of) = ([factors[0], factors[1]], &factors[2..56]);
    let zero = g.constant(0.0);
    let (mut bend, mut stretch) = (zero, zero);
    for (&weight, multiples) in weights.iter().zip(factors[56..].chunks_exact(2)) {
        let is_distance = !g.is(multiples[1], 0.0);
        let weight = if is_distance { g.select(degenerate, zero, weight) } else { weight };
        let terms = [multiples[0], multiples[1]].map(|multiple| g.mul(multiple, weight));
        (bend, stretch) = (g.add(bend, terms[0]), g.add(stretch, terms[1]));
    }
    let bend = g.mul(scale, bend);
    let (spins, turns) = (vectors(&vectors_of[..27]), vectors(&vectors_of[27..]));
    entries(|x, y| {
        let turning = spins[x].iter().zip(&turns[y]).map(|(&spin, &turn)| vec![bend, spin, turn]);
        turning.chain([vec![if x == y { stretch } else { zero }]]).collect()
    })
}
