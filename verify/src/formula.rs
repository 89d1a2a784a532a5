//! A formula as written, evaluated and differentiated by arithmetic that is independent of the generated code.

use energy_dsl::{Declaration, Inputs, Kind, Textbook};

use crate::blocks::{Block, BlockName};
use crate::dual::Hyper;
use crate::sample::Sample;

/// A formula's rows with their first and second derivatives at one input.
struct Expansion {
    /// The rows.
    values: Vec<f64>,
    /// Row by coordinate.
    by_position: Vec<Vec<f64>>,
    /// Row by pair of coordinates.
    by_position_twice: Vec<Vec<Vec<f64>>>,
    /// Row by velocity component; empty unless the declaration is a force.
    by_velocity: Vec<Vec<f64>>,
}

/// The rows of a formula in plain double arithmetic.
pub(crate) fn rows(formula: &Textbook, sample: &Sample) -> Vec<f64> {
    formula.evaluate(&sample.inputs())
}

/// Every block of a declaration, from its formula alone.
pub(crate) fn expected_blocks(declaration: &Declaration, formula: &Textbook, sample: &Sample) -> Vec<Block> {
    match declaration.kind {
        Kind::Energy => {
            let expansion = expand(formula, sample, true);
            vec![
                Block::new(BlockName::Energy, 1, expansion.values.clone()),
                Block::new(BlockName::Gradient, expansion.by_position[0].len(), expansion.by_position[0].clone()),
                Block::from_rows(BlockName::Hessian, &expansion.by_position_twice[0]),
            ]
        }
        Kind::Force => {
            let expansion = expand(formula, sample, false);
            vec![
                Block::new(BlockName::Force, expansion.values.len(), expansion.values.clone()),
                Block::from_rows(BlockName::ForceByPosition, &expansion.by_position),
                Block::from_rows(BlockName::ForceByVelocity, &expansion.by_velocity),
            ]
        }
        Kind::Residual => {
            let expansion = expand(formula, sample, false);
            vec![
                Block::new(BlockName::Residual, expansion.values.len(), expansion.values.clone()),
                Block::from_rows(BlockName::Jacobian, &expansion.by_position),
            ]
        }
        Kind::Constraint => constraint_blocks(&expand(formula, sample, true), sample),
    }
}

/// Witkin's ½ k_s CᵀC and −Jᵀ (k_s C + k_d J v) with their derivatives, written out over C, J and ∂²C.
fn constraint_blocks(expansion: &Expansion, sample: &Sample) -> Vec<Block> {
    let Expansion { values, by_position: jacobian, by_position_twice: second, .. } = expansion;
    let (stiffness, damping) = sample.stiffness_and_damping();
    let n = sample.positions.len();
    let rows = values.len();
    let velocity = |i: usize| sample.velocities.get(i).copied().unwrap_or(0.0);
    let rate = |r: usize| (0..n).map(|i| jacobian[r][i] * velocity(i)).sum::<f64>();
    let rate_by = |r: usize, k: usize| (0..n).map(|j| second[r][j][k] * velocity(j)).sum::<f64>();
    let over_rows = |term: &dyn Fn(usize) -> f64| (0..rows).map(term).sum::<f64>();
    let matrix = |entry: &dyn Fn(usize, usize) -> f64| -> Vec<Vec<f64>> {
        (0..n).map(|i| (0..n).map(|k| entry(i, k)).collect()).collect()
    };
    let vector = |entry: &dyn Fn(usize) -> f64| -> Vec<f64> { (0..n).map(entry).collect() };

    let energy = over_rows(&|r| stiffness / 2.0 * values[r] * values[r]);
    let gradient = vector(&|i| over_rows(&|r| stiffness * values[r] * jacobian[r][i]));
    let hessian =
        matrix(&|i, k| over_rows(&|r| stiffness * (jacobian[r][i] * jacobian[r][k] + values[r] * second[r][i][k])));
    let force = vector(&|i| over_rows(&|r| -jacobian[r][i] * (stiffness * values[r] + damping * rate(r))));
    let by_position = matrix(&|i, k| {
        over_rows(&|r| {
            -second[r][i][k] * (stiffness * values[r] + damping * rate(r))
                - jacobian[r][i] * (stiffness * jacobian[r][k] + damping * rate_by(r, k))
        })
    });
    let by_velocity = matrix(&|i, k| over_rows(&|r| -damping * jacobian[r][i] * jacobian[r][k]));
    vec![
        Block::new(BlockName::Constraint, rows, values.clone()),
        Block::from_rows(BlockName::Jacobian, jacobian),
        Block::new(BlockName::Energy, 1, vec![energy]),
        Block::new(BlockName::Gradient, n, gradient),
        Block::from_rows(BlockName::Hessian, &hessian),
        Block::new(BlockName::Force, n, force),
        Block::from_rows(BlockName::ForceByPosition, &by_position),
        Block::from_rows(BlockName::ForceByVelocity, &by_velocity),
    ]
}

/// One hyper-dual evaluation per pair of coordinates, or per coordinate where no second derivative is wanted.
fn expand(formula: &Textbook, sample: &Sample, second: bool) -> Expansion {
    let n = sample.positions.len();
    let values = rows(formula, sample);
    let mut by_position = vec![vec![0.0; n]; values.len()];
    let mut by_position_twice = vec![vec![vec![0.0; n]; n]; if second { values.len() } else { 0 }];
    for i in 0..n {
        for j in if second { i..n } else { i..i + 1 } {
            for (r, row) in evaluate_hyper(formula, sample, (i, j), None).iter().enumerate() {
                if second {
                    by_position_twice[r][i][j] = row.0.eps1eps2;
                    by_position_twice[r][j][i] = row.0.eps1eps2;
                }
                by_position[r][i] = row.0.eps1;
            }
        }
    }
    let mut by_velocity = vec![vec![0.0; sample.velocities.len()]; values.len()];
    for i in 0..sample.velocities.len() {
        for (r, row) in evaluate_hyper(formula, sample, (n, n), Some(i)).iter().enumerate() {
            by_velocity[r][i] = row.0.eps1;
        }
    }
    Expansion { values, by_position, by_position_twice, by_velocity }
}

/// The rows with ε₁ along position `i` (and ε₂ along `j`), or with ε₁ along one velocity.
fn evaluate_hyper(formula: &Textbook, sample: &Sample, (i, j): (usize, usize), velocity: Option<usize>) -> Vec<Hyper> {
    let constants = |numbers: &[f64]| numbers.iter().map(|&x| Hyper::constant(x)).collect::<Vec<_>>();
    let positions: Vec<Hyper> =
        sample.positions.iter().enumerate().map(|(at, &x)| Hyper::variable(x, at == i, at == j)).collect();
    let velocities: Vec<Hyper> =
        sample.velocities.iter().enumerate().map(|(at, &v)| Hyper::variable(v, Some(at) == velocity, false)).collect();
    formula.evaluate(&Inputs {
        parameters: &constants(&sample.parameters),
        rest: &constants(&sample.rest),
        positions: &positions,
        velocities: &velocities,
    })
}
