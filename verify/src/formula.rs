//! Evaluation and differentiation of a formula as written, independent of the generated code.

use energy_compiler::Textbook;
use energy_dsl::{Declaration, FieldKind, Inputs, Kind, Number};

use crate::blocks::{Block, BlockName};
use crate::chart;
use crate::jet::{Jet, Order};
use crate::sample::{Sample, state_size};

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
    /// Derivatives by row, then number of the state.
    by_state: Vec<Vec<T>>,
    /// Second derivatives, by row, then coordinate, then number of the state; empty if not requested.
    by_position_and_state: Vec<Vec<Vec<T>>>,
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
    blocks(declaration, formula, sample, None)
}

/// Computes every block at the sum of an input and a small offset, which doubles need not represent.
pub(crate) fn blocks_near<T: Number<Mask = bool>>(
    declaration: &Declaration,
    formula: &Textbook,
    sample: &Sample,
    offset: &Sample,
) -> Vec<Block<T>> {
    blocks(declaration, formula, sample, Some(offset))
}

/// Returns the order of differentiation that the blocks of a kind need.
pub(crate) fn order(kind: Kind) -> Order {
    match kind {
        Kind::Energy | Kind::Constraint => Order::Second,
        Kind::Force | Kind::Residual => Order::First,
    }
}

fn blocks<T: Number<Mask = bool>>(
    declaration: &Declaration,
    formula: &Textbook,
    sample: &Sample,
    offset: Option<&Sample>,
) -> Vec<Block<T>> {
    let order = order(declaration.kind);
    let inputs = JetInputs::new(declaration, sample, offset, order);
    let expansion = inputs.expansion(formula.evaluate(&inputs.inputs()));
    let slopes_by_state = match declaration.kind {
        Kind::Energy => expansion.by_position_and_state.first().cloned(),
        Kind::Constraint => Some(constraint_slopes_by_state(declaration, &expansion, sample)),
        Kind::Residual => Some(expansion.by_state.clone()),
        Kind::Force => None,
    };
    let mut blocks = of_kind(declaration, expansion, sample);
    if !declaration.state.is_empty() {
        let next = inputs.expansion(formula.evaluate_next(&inputs.inputs()));
        blocks.push(Block::new(BlockName::Next, next.values.len(), next.values));
        blocks.push(Block::from_rows(BlockName::NextByUnknowns, &next.by_position));
        blocks.push(Block::from_rows(BlockName::NextByState, &next.by_state));
        blocks.extend(slopes_by_state.map(|rows| Block::from_rows(BlockName::SlopesByState, &rows)));
    }
    blocks
}

/// Returns the blocks that all declarations of a kind have.
fn of_kind<T: Number>(declaration: &Declaration, expansion: Expansion<T>, sample: &Sample) -> Vec<Block<T>> {
    match declaration.kind {
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
        Kind::Constraint => constraint_blocks(declaration, &expansion, sample),
    }
}

/// Computes Witkin's ½ k_s CᵀC and −Jᵀ (k_s C + k_d J v) with their derivatives from C, J and ∂²C.
fn constraint_blocks<T: Number>(declaration: &Declaration, expansion: &Expansion<T>, sample: &Sample) -> Vec<Block<T>> {
    let (stiffness, damping) = sample.stiffness_and_damping(declaration);
    let (stiffness, damping) = (T::from_f64(stiffness), T::from_f64(damping));
    let (n, rows) = (declaration.increments(), expansion.values.len());
    let turning: Vec<Vec<Vec<T>>> = (0..rows).map(|r| plain(declaration, expansion, r)).collect();
    let velocities: Vec<T> = (0..n).map(|i| T::from_f64(sample.velocities.get(i).copied().unwrap_or(0.0))).collect();
    let c = |r: usize| expansion.values[r].clone();
    let j = |r: usize, i: usize| expansion.by_position[r][i].clone();
    let c_by = |r: usize, i: usize, k: usize| expansion.by_position_twice[r][i][k].clone();
    let v = |i: usize| velocities[i].clone();
    let rate: Vec<T> = (0..rows).map(|r| sum(n, |i| j(r, i) * v(i))).collect();
    // The force is differentiated along exp, which is not symmetric for rotations.
    let j_by = |r: usize, i: usize, k: usize| turning[r][i][k].clone();
    let rate_by: Vec<Vec<T>> = (0..rows).map(|r| (0..n).map(|k| sum(n, |i| j_by(r, i, k) * v(i))).collect()).collect();
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
            j_by(r, i, k) * pull[r].clone()
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

/// Returns ∂J/∂u of one row along exp: ∂²C, and half of the torque's cross-product matrix for each rotation.
fn plain<T: Number>(declaration: &Declaration, expansion: &Expansion<T>, row: usize) -> Vec<Vec<T>> {
    let mut matrix = expansion.by_position_twice[row].clone();
    let half = T::from_f64(0.5);
    for rotation in chart::rotations(declaration) {
        for (i, j, k) in [(0, 1, 2), (1, 2, 0), (2, 0, 1)] {
            let [i, j, k] = [i, j, k].map(|axis| rotation.increment + axis);
            let torque = half.clone() * expansion.by_position[row][k].clone();
            matrix[i][j] = matrix[i][j].clone() + torque.clone();
            matrix[j][i] = matrix[j][i].clone() - torque;
        }
    }
    matrix
}

/// Returns ∂²(½ k_s CᵀC)/∂u∂(state).
fn constraint_slopes_by_state<T: Number>(
    declaration: &Declaration,
    expansion: &Expansion<T>,
    sample: &Sample,
) -> Vec<Vec<T>> {
    let stiffness = T::from_f64(sample.stiffness_and_damping(declaration).0);
    let rows = expansion.values.len();
    let entry = |i: usize, state: usize| {
        let term = |r: usize| {
            expansion.by_position[r][i].clone() * expansion.by_state[r][state].clone()
                + expansion.values[r].clone() * expansion.by_position_and_state[r][i][state].clone()
        };
        stiffness.clone() * sum(rows, term)
    };
    (0..declaration.increments()).map(|i| (0..state_size(declaration)).map(|state| entry(i, state)).collect()).collect()
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
    order: Order,
    /// Numbers of the increments, the velocities that vary, and the states.
    counts: [usize; 3],
}

impl<T: Number<Mask = bool>> JetInputs<T> {
    /// Creates inputs with all coordinates variable: first the increments of the unknowns, then velocities unless second
    /// derivatives are wanted, then the state. The numbers are those of the sample plus the offset.
    pub(crate) fn new(declaration: &Declaration, sample: &Sample, offset: Option<&Sample>, order: Order) -> Self {
        let n = declaration.increments();
        let m = if order == Order::First { sample.velocities.len() } else { 0 };
        let s = state_size(declaration);
        let count = n + m + s;
        let numbers = |pick: fn(&Sample) -> &[f64]| -> Vec<T> {
            let plain = pick(sample).iter().map(|&x| T::from_f64(x));
            match offset {
                Some(offset) => plain.zip(pick(offset)).map(|(x, &dx)| x + T::from_f64(dx)).collect(),
                None => plain.collect(),
            }
        };
        let constants = |numbers: Vec<T>| numbers.into_iter().map(Jet::constant).collect::<Vec<_>>();
        let moving = |numbers: Vec<T>, first: usize| -> Vec<Jet<T>> {
            let variable = |(i, x): (usize, T)| Jet::variable(x, first + i, count, order);
            numbers.into_iter().enumerate().map(variable).collect()
        };
        let mut positions = Vec::with_capacity(sample.positions.len());
        let given = numbers(|sample| &sample.positions);
        for chart::Unknown { field, number, increment } in chart::unknowns(declaration) {
            let own = given[number..number + field.size].to_vec();
            match field.kind {
                FieldKind::Rotation => positions.extend(turned(own, increment, count, order)),
                _ => positions.extend(moving(own, increment)),
            }
        }
        let velocities = numbers(|sample| &sample.velocities);
        let mut parameters = numbers(|sample| &sample.parameters);
        let state = parameters.split_off(parameters.len() - s);
        let mut parameters = constants(parameters);
        parameters.extend(moving(state, n + m));
        Self {
            parameters,
            rest: constants(numbers(|sample| &sample.rest)),
            positions,
            velocities: if m > 0 { moving(velocities, n) } else { constants(velocities) },
            order,
            counts: [n, m, s],
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

    /// Sorts the derivatives of some rows.
    fn expansion(&self, rows: Vec<Jet<T>>) -> Expansion<T> {
        let [n, m, s] = self.counts;
        let row = |row: &Jet<T>, range: std::ops::Range<usize>| range.map(|i| row.by(i)).collect::<Vec<T>>();
        let second = |rows: &[Jet<T>], columns: std::ops::Range<usize>| -> Vec<Vec<Vec<T>>> {
            if self.order == Order::First {
                return Vec::new();
            }
            let of_row = |row: &Jet<T>| (0..n).map(|i| columns.clone().map(|j| row.by_both(i, j)).collect()).collect();
            rows.iter().map(of_row).collect()
        };
        Expansion {
            by_position: rows.iter().map(|r| row(r, 0..n)).collect(),
            by_position_twice: second(&rows, 0..n),
            by_velocity: rows.iter().map(|r| row(r, n..n + m)).collect(),
            by_state: rows.iter().map(|r| row(r, n + m..n + m + s)).collect(),
            by_position_and_state: second(&rows, n + m..n + m + s),
            values: rows.into_iter().map(|r| r.value).collect(),
        }
    }
}

/// Returns exp(δ) q up to second order in δ = 0: (1 − |δ|²/8, δ/2) q.
fn turned<T: Number<Mask = bool>>(q: Vec<T>, increment: usize, count: usize, order: Order) -> [Jet<T>; 4] {
    let q: [T; 4] = q.try_into().unwrap_or_else(|_| unreachable!("a rotation has four numbers"));
    let constant = |x: f64| Jet::constant(T::from_f64(x));
    let turn: [Jet<T>; 3] = std::array::from_fn(|axis| Jet::variable(T::from_f64(0.0), increment + axis, count, order));
    let square = turn.iter().cloned().map(|d| d.clone() * d).reduce(|a, b| a + b).expect("three axes");
    let [x, y, z] = turn.map(|d| constant(0.5) * d);
    chart::product([constant(1.0) - constant(0.125) * square, x, y, z], q.map(Jet::constant))
}
