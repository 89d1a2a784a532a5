//! Places of the numbers of full matrices among the results of a routine.

use energy_runtime::{Declaration, Kind, triangle_index};

/// Indices among the results of a routine, in the order of the full matrices that callers want.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Layouts {
    /// The first result, the energy U.
    pub value: Vec<u16>,
    /// The first numbers, one per increment: a force.
    pub vectors: Vec<u16>,
    /// The numbers after the first, one per increment: ∂U/∂x.
    pub gradient: Vec<u16>,
    /// ∂²U/∂x², row by row.
    pub hessian: Vec<u16>,
    /// The triangle of ∂²U/∂x², block by block, or row by row for mixed unknowns.
    pub triangle: Vec<u16>,
    /// ∂f/∂x and ∂f/∂v, row by row.
    pub force_jacobians: [Vec<u16>; 2],
    /// The rows of C or r.
    pub rows: Vec<u16>,
    /// ∂C/∂x or ∂r/∂u, row by row.
    pub jacobian: Vec<u16>,
    /// The state after a step.
    pub state: Vec<u16>,
    /// Its derivatives by the unknowns and by the state before, row by row.
    pub next_jacobians: [Vec<u16>; 2],
    /// ∂U/∂u or r, and its derivative by the state, row by row.
    pub slopes: [Vec<u16>; 2],
}

impl Layouts {
    pub(super) fn of(declaration: &Declaration) -> Self {
        let own = if declaration.is_mixed() { Self::of_mixed(declaration) } else { Self::of_points(declaration) };
        let increments = declaration.increments();
        let states: usize = declaration.state.iter().map(|field| field.size).sum();
        let slopes = if declaration.kind == Kind::Residual { declaration.rows } else { increments };
        let (by_unknowns, by_state) = (states * increments, states * states);
        Self {
            state: indices(0..states),
            next_jacobians: [
                indices(states..states + by_unknowns),
                indices(states + by_unknowns..states + by_unknowns + by_state),
            ],
            slopes: [indices(0..slopes), indices(slopes..slopes + slopes * states)],
            ..own
        }
    }

    /// Returns the places of points in 3-vectors and 3×3 blocks.
    fn of_points(declaration: &Declaration) -> Self {
        let points = if declaration.kind == Kind::Residual { 0 } else { declaration.points.len() };
        let (n, rows) = (3 * points, declaration.rows);
        let entries = || (0..n).flat_map(move |row| (0..n).map(move |column| (row, column)));
        let hessian = entries().map(|(row, column)| {
            let (row, column) = if row / 3 <= column / 3 { (row, column) } else { (column, row) };
            1 + n + 9 * triangle_index(points, row / 3, column / 3) + row % 3 * 3 + column % 3
        });
        let square = |first: usize| {
            let entry = |(row, column)| first + 9 * (row / 3 * points + column / 3) + row % 3 * 3 + column % 3;
            indices(entries().map(entry))
        };
        Self {
            value: indices(0..1),
            vectors: indices(0..n),
            gradient: indices(1..1 + n),
            hessian: indices(hessian),
            triangle: indices(1 + n..1 + n + 9 * points * (points + 1) / 2),
            force_jacobians: [square(n), square(n + n * n)],
            rows: indices(0..rows),
            jacobian: indices(rows..rows + rows * declaration.increments()),
            ..Self::default()
        }
    }

    /// Returns the places of the flat results of mixed unknowns.
    fn of_mixed(declaration: &Declaration) -> Self {
        let (n, rows) = (declaration.increments(), declaration.rows);
        let entries = (0..n).flat_map(move |row| (0..n).map(move |column| (row, column)));
        let hessian = entries.map(|(i, j)| 1 + n + triangle_index(n, i.min(j), i.max(j)));
        Self {
            value: indices(0..1),
            vectors: indices(0..n),
            gradient: indices(1..1 + n),
            hessian: indices(hessian),
            triangle: indices(1 + n..1 + n + n * (n + 1) / 2),
            force_jacobians: [n, n + n * n].map(|first| indices(first..first + n * n)),
            rows: indices(0..rows),
            jacobian: indices(rows..rows + rows * n),
            ..Self::default()
        }
    }
}

/// Converts indices. A routine has fewer than 2¹⁶ results; layouts of routines that an element does not have may be cut
/// short, and nothing reads them.
fn indices(list: impl Iterator<Item = usize>) -> Vec<u16> {
    list.map_while(|index| u16::try_from(index).ok()).collect()
}
