//! Evaluation and differentiation of a formula as written, independent of the generated code.

use energy_compiler::Textbook;
use energy_dsl::{Declaration, Inputs, Kind, Number};

use crate::blocks::{Block, BlockName};
use crate::jet::{Jet, Order};
use crate::sample::Sample;

/// The rows of a formula with first and second derivatives at one input.
struct Expansion<T> {
    /// Values of the rows.
    values: Vec<T>,
    /// First derivatives, by row, then coordinate.
    by_position: Vec<Vec<T>>,
    /// Second derivatives, by row, then pair of coordinates; empty if not requested.
    by_position_twice: Vec<Vec<Vec<T>>>,
    /// Derivatives by row, then velocity component; empty unless the declaration is a force.
    by_velocity: Vec<Vec<T>>,
}

/// Evaluates the rows of a formula in plain double precision.
pub fn rows(formula: &Textbook, sample: &Sample) -> Vec<f64> {
    formula.evaluate(&sample.inputs())
}

/// Computes every block of a declaration from its formula alone, by dual numbers in double precision.
pub fn expected_blocks(declaration: &Declaration, formula: &Textbook, sample: &Sample) -> Vec<Block> {
    blocks_over(declaration, formula, sample)
}

/// Computes every block over any number type, by jets. Creates the numbers itself, so that they have the caller's
/// precision.
pub fn blocks_over<T: Number<Mask = bool>>(
    declaration: &Declaration,
    formula: &Textbook,
    sample: &Sample,
) -> Vec<Block<T>> {
    blocks(declaration.kind, expand_by_jets(formula, sample, None, order(declaration.kind)), sample)
}

/// Computes every block at the sum of an input and a small offset, which doubles need not represent.
pub(crate) fn blocks_near<T: Number<Mask = bool>>(
    declaration: &Declaration,
    formula: &Textbook,
    sample: &Sample,
    offset: &Sample,
) -> Vec<Block<T>> {
    blocks(declaration.kind, expand_by_jets(formula, sample, Some(offset), order(declaration.kind)), sample)
}

/// Returns the order of differentiation that the blocks of a kind need.
pub(crate) fn order(kind: Kind) -> Order {
    match kind {
        Kind::Energy | Kind::Constraint => Order::Second,
        Kind::Force | Kind::Residual => Order::First,
    }
}

fn blocks<T: Number>(kind: Kind, expansion: Expansion<T>, sample: &Sample) -> Vec<Block<T>> {
    match kind {
        Kind::Energy => vec![
            Block::new(BlockName::Energy, 1, expansion.values),
            Block::new(BlockName::Gradient, expansion.by_position[0].len(), expansion.by_position[0].clone()),
            Block::from_rows(BlockName::Hessian, &expansion.by_position_twice[0]),
        ],
        Kind::Force => vec![
            Block::new(BlockName::Force, expansion.values.len(), expansion.values),
            Block::from_rows(BlockName::ForceByPosition, &expansion.by_position),
            Block::from_rows(BlockName::ForceByVelocity, &expansion.by_velocity),
        ],
        Kind::Residual => vec![
            Block::new(BlockName::Residual, expansion.values.len(), expansion.values),
            Block::from_rows(BlockName::Jacobian, &expansion.by_position),
        ],
        Kind::Constraint => constraint_blocks(&expansion, sample),
    }
}

/// Computes Witkin's ½ k_s CᵀC and −Jᵀ (k_s C + k_d J v) with their derivatives from C, J and ∂²C.
fn constraint_blocks<T: Number>(expansion: &Expansion<T>, sample: &Sample) -> Vec<Block<T>> {
    let (stiffness, damping) = sample.stiffness_and_damping();
    let (stiffness, damping) = (T::from_f64(stiffness), T::from_f64(damping));
    let (n, rows) = (sample.positions.len(), expansion.values.len());
    let velocities: Vec<T> = (0..n).map(|i| T::from_f64(sample.velocities.get(i).copied().unwrap_or(0.0))).collect();
    let c = |r: usize| expansion.values[r].clone();
    let j = |r: usize, i: usize| expansion.by_position[r][i].clone();
    let c_by = |r: usize, i: usize, k: usize| expansion.by_position_twice[r][i][k].clone();
    let v = |i: usize| velocities[i].clone();
    let rate: Vec<T> = (0..rows).map(|r| sum(n, |i| j(r, i) * v(i))).collect();
    let rate_by: Vec<Vec<T>> = (0..rows).map(|r| (0..n).map(|k| sum(n, |i| c_by(r, i, k) * v(i))).collect()).collect();
    let pull: Vec<T> = (0..rows).map(|r| stiffness.clone() * c(r) + damping.clone() * rate[r].clone()).collect();
    let matrix = |entry: &dyn Fn(usize, usize) -> T| -> Vec<Vec<T>> {
        (0..n).map(|i| (0..n).map(|k| entry(i, k)).collect()).collect()
    };
    let vector = |entry: &dyn Fn(usize) -> T| -> Vec<T> { (0..n).map(entry).collect() };

    let energy = stiffness.clone() / T::from_f64(2.0) * sum(rows, |r| c(r) * c(r));
    let gradient = vector(&|i| stiffness.clone() * sum(rows, |r| c(r) * j(r, i)));
    let hessian = matrix(&|i, k| stiffness.clone() * sum(rows, |r| j(r, i) * j(r, k) + c(r) * c_by(r, i, k)));
    let force = vector(&|i| -sum(rows, |r| j(r, i) * pull[r].clone()));
    let by_position = matrix(&|i, k| {
        -sum(rows, |r| {
            c_by(r, i, k) * pull[r].clone()
                + j(r, i) * (stiffness.clone() * j(r, k) + damping.clone() * rate_by[r][k].clone())
        })
    });
    let by_velocity = matrix(&|i, k| -(damping.clone() * sum(rows, |r| j(r, i) * j(r, k))));
    vec![
        Block::new(BlockName::Constraint, rows, expansion.values.clone()),
        Block::from_rows(BlockName::Jacobian, &expansion.by_position),
        Block::new(BlockName::Energy, 1, vec![energy]),
        Block::new(BlockName::Gradient, n, gradient),
        Block::from_rows(BlockName::Hessian, &hessian),
        Block::new(BlockName::Force, n, force),
        Block::from_rows(BlockName::ForceByPosition, &by_position),
        Block::from_rows(BlockName::ForceByVelocity, &by_velocity),
    ]
}

fn sum<T: Number>(count: usize, term: impl Fn(usize) -> T) -> T {
    (0..count).fold(T::from_f64(0.0), |sum, i| sum + term(i))
}

/// Inputs with their derivatives.
pub(crate) struct JetInputs<T> {
    parameters: Vec<Jet<T>>,
    rest: Vec<Jet<T>>,
    positions: Vec<Jet<T>>,
    velocities: Vec<Jet<T>>,
}

impl<T: Number<Mask = bool>> JetInputs<T> {
    /// Creates inputs with all coordinates variable: first positions, then velocities unless second derivatives are
    /// wanted. The numbers are those of the sample plus the offset.
    pub(crate) fn new(sample: &Sample, offset: Option<&Sample>, order: Order) -> Self {
        let (n, m) = (sample.positions.len(), if order == Order::First { sample.velocities.len() } else { 0 });
        let numbers = |pick: fn(&Sample) -> &[f64]| -> Vec<T> {
            let plain = pick(sample).iter().map(|&x| T::from_f64(x));
            match offset {
                Some(offset) => plain.zip(pick(offset)).map(|(x, &dx)| x + T::from_f64(dx)).collect(),
                None => plain.collect(),
            }
        };
        let constants = |numbers: Vec<T>| numbers.into_iter().map(Jet::constant).collect::<Vec<_>>();
        let moving = |numbers: Vec<T>, first: usize| -> Vec<Jet<T>> {
            let variable = |(i, x): (usize, T)| Jet::variable(x, first + i, n + m, order);
            numbers.into_iter().enumerate().map(variable).collect()
        };
        let velocities = numbers(|sample| &sample.velocities);
        Self {
            parameters: constants(numbers(|sample| &sample.parameters)),
            rest: constants(numbers(|sample| &sample.rest)),
            positions: moving(numbers(|sample| &sample.positions), 0),
            velocities: if m > 0 { moving(velocities, n) } else { constants(velocities) },
        }
    }

    pub(crate) fn inputs(&self) -> Inputs<'_, Jet<T>> {
        Inputs {
            parameters: &self.parameters,
            rest: &self.rest,
            positions: &self.positions,
            velocities: &self.velocities,
        }
    }
}

/// Evaluates once with all coordinates variable: first positions, then velocities.
fn expand_by_jets<T: Number<Mask = bool>>(
    formula: &Textbook,
    sample: &Sample,
    offset: Option<&Sample>,
    order: Order,
) -> Expansion<T> {
    let (n, m) = (sample.positions.len(), if order == Order::First { sample.velocities.len() } else { 0 });
    let rows = formula.evaluate(&JetInputs::new(sample, offset, order).inputs());
    let row = |row: &Jet<T>, range: std::ops::Range<usize>| range.map(|i| row.by(i)).collect::<Vec<T>>();
    let twice = |row: &Jet<T>| (0..n).map(|i| (0..n).map(|j| row.by_both(i, j)).collect()).collect();
    Expansion {
        by_position: rows.iter().map(|r| row(r, 0..n)).collect(),
        by_position_twice: if order == Order::Second { rows.iter().map(twice).collect() } else { Vec::new() },
        by_velocity: rows.iter().map(|r| row(r, n..n + m)).collect(),
        values: rows.into_iter().map(|r| r.value).collect(),
    }
}
