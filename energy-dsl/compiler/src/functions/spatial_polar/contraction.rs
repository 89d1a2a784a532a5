//! Σ wᵢⱼ ∇²Rᵢⱼ in closed form.
//!
//! With M = RᵀW, a = Σ wᵢ × rᵢ and b = K⁻¹ a, it is ω(X)·(M − S \[b\]ₓ − tr M) ω(Y) + c(X)·ω(Y) + c(Y)·ω(X), where
//! c = (b·rₖ) eₗ − Rₖₗ b for X = eₖ eₗᵀ. The first matrix is symmetric, as S \[b\]ₓ + \[b\]ₓ S = \[a\]ₓ.

use super::Decomposition;
use super::matrix::{Matrix, Vector, product, rows, symmetric, times, trace, transposed};
use crate::graph::{Contraction, Graph, NodeId, upper};

/// Creates the contraction of the entries of R.
pub(super) fn of_rotation(at: &Decomposition, arguments: &[NodeId], values: Vec<NodeId>) -> Contraction {
    let matrices = [at.rotation, at.consistent, at.inverse].into_iter().flatten().flatten();
    let factors = matrices.chain(at.turns.iter().copied().flatten()).chain([at.scale]).collect();
    Contraction { values, arguments: arguments.to_vec(), factors, first: None, second }
}

fn second(g: &mut Graph, factors: &[NodeId], weights: &[NodeId]) -> Vec<Vec<NodeId>> {
    let [r, s, inverse] = [0, 9, 18].map(|first| rows(&factors[first..first + 9]));
    let turns: Vec<Vector> = factors[27..54].chunks_exact(3).map(|turn| [turn[0], turn[1], turn[2]]).collect();
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
    upper(9)
        .map(|(x, y)| {
            let (first, second) = (g.dot(&turns[x], &bent[y]), g.dot(&levers[x], &turns[y]));
            vec![g.add(first, second)]
        })
        .collect()
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
