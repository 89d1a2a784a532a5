//! Evaluation of all blocks on flattened inputs, for tools that treat all elements in the same way.

use crate::array::Array;
use crate::element::{
    Block, Constraint, ForceLaw, Inputs, MixedConstraint, MixedForce, MixedPotential, Outputs, Potential, Residual,
    StateSensitivity, Stateful, Vector3, triangle_index,
};
use crate::numbers::Flags;
use crate::numbers::Real;

fn points<T: Real, P: Array<Vector3<T>>>(numbers: &[T]) -> P {
    P::from_fn(|i| std::array::from_fn(|axis| numbers.get(3 * i + axis).copied().unwrap_or_else(|| T::from_f64(0.0))))
}

fn flat<T: Real>(vectors: &[Vector3<T>]) -> Vec<T> {
    vectors.iter().flatten().copied().collect()
}

/// Expands a triangle to a full matrix, row by row.
fn full_triangle<T: Real>(points: usize, triangle: &[Block<T>]) -> Vec<T> {
    let mut full = Vec::with_capacity(9 * points * points);
    for row in 0..3 * points {
        for column in 0..3 * points {
            let ((i, r), (j, c)) = ((row / 3, row % 3), (column / 3, column % 3));
            full.push(if i <= j {
                triangle[triangle_index(points, i, j)][r][c]
            } else {
                triangle[triangle_index(points, j, i)][c][r]
            });
        }
    }
    full
}

/// Expands a square to a full matrix, row by row.
fn full_square<T: Real>(points: usize, square: &[Block<T>]) -> Vec<T> {
    let entries = (0..3 * points).flat_map(|row| (0..3 * points).map(move |column| (row, column)));
    entries.map(|(row, column)| square[row / 3 * points + column / 3][row % 3][column % 3]).collect()
}

/// Evaluates the blocks `energy`, `grad` and `hess`.
#[doc(hidden)]
pub fn evaluate_potential<T: Real, E: Potential<T>>(element: &E, inputs: &Inputs<'_, T>) -> Outputs<T> {
    let x: E::Points = points(inputs.positions);
    let (value, gradient, hessian) = (element.value(&x), element.gradient(&x), element.hessian(&x));
    Outputs {
        blocks: vec![
            ("energy", vec![value.value]),
            ("grad", flat(gradient.gradient.as_ref())),
            ("hess", full_triangle(E::Points::LEN, hessian.hessian.as_ref())),
        ],
        repeats: vec![
            ("gradient", "energy", vec![gradient.value]),
            ("hessian", "energy", vec![hessian.value]),
            ("hessian", "grad", flat(hessian.gradient.as_ref())),
        ],
        flags: [value.flags, gradient.flags, hessian.flags],
    }
}

/// Evaluates the blocks `force`, `dfdx` and `dfdv`.
#[doc(hidden)]
pub fn evaluate_force_law<T: Real, E: ForceLaw<T>>(element: &E, inputs: &Inputs<'_, T>) -> Outputs<T> {
    let (x, v): (E::Points, E::Points) = (points(inputs.positions), points(inputs.velocities));
    let (force, jacobians) = (element.force(&x, &v), element.jacobians(&x, &v));
    let n = E::Points::LEN;
    Outputs {
        blocks: vec![
            ("force", flat(force.force.as_ref())),
            ("dfdx", full_square(n, jacobians.by_position.as_ref())),
            ("dfdv", full_square(n, jacobians.by_velocity.as_ref())),
        ],
        repeats: vec![("jacobians", "force", flat(jacobians.force.as_ref()))],
        flags: [force.flags, jacobians.flags, jacobians.flags],
    }
}

/// Evaluates the blocks of the potential and the force, `constraint` and `jacobian`.
#[doc(hidden)]
pub fn evaluate_constraint<T: Real, E: Constraint<T>>(element: &E, inputs: &Inputs<'_, T>) -> Outputs<T> {
    let mut outputs = evaluate_potential(element, inputs);
    let force = evaluate_force_law(element, inputs);
    let x: <E as Potential<T>>::Points = points(inputs.positions);
    let jacobian = element.constraint_jacobian(&x);
    outputs.blocks.extend(force.blocks);
    outputs.repeats.extend(force.repeats);
    outputs.blocks.push(("constraint", jacobian.value.as_ref().to_vec()));
    outputs.blocks.push(("jacobian", flat(jacobian.jacobian.as_ref())));
    outputs
}

/// Evaluates the blocks `residual` and `jacobian`.
#[doc(hidden)]
pub fn evaluate_residual<T: Real, E: Residual<T>>(element: &E, inputs: &Inputs<'_, T>) -> Outputs<T> {
    let u = E::Unknowns::from_fn(|i| inputs.positions[i]);
    let (residual, jacobian) = (element.residual(&u), element.jacobian(&u));
    Outputs {
        blocks: vec![("residual", residual.value.as_ref().to_vec()), ("jacobian", jacobian.jacobian.as_ref().to_vec())],
        repeats: vec![("jacobian", "residual", jacobian.value.as_ref().to_vec())],
        flags: [residual.flags, jacobian.flags, Flags::clear()],
    }
}

fn unknowns<T: Real, U: Array<T>>(numbers: &[T]) -> U {
    U::from_fn(|i| numbers.get(i).copied().unwrap_or_else(|| T::from_f64(0.0)))
}

/// Expands an upper triangle to a full matrix, row by row.
fn full_upper<T: Real>(increments: usize, upper: &[T]) -> Vec<T> {
    let entries = (0..increments).flat_map(|row| (0..increments).map(move |column| (row, column)));
    entries.map(|(row, column)| upper[triangle_index(increments, row.min(column), row.max(column))]).collect()
}

/// Evaluates the blocks `energy`, `grad` and `hess` of mixed unknowns.
#[doc(hidden)]
pub fn evaluate_mixed_potential<T: Real, E: MixedPotential<T>>(element: &E, inputs: &Inputs<'_, T>) -> Outputs<T> {
    let u: E::Unknowns = unknowns(inputs.positions);
    let (value, gradient, hessian) = (element.value(&u), element.gradient(&u), element.hessian(&u));
    Outputs {
        blocks: vec![
            ("energy", vec![value.value]),
            ("grad", gradient.gradient.as_ref().to_vec()),
            ("hess", full_upper(E::Increments::LEN, hessian.hessian.as_ref())),
        ],
        repeats: vec![
            ("gradient", "energy", vec![gradient.value]),
            ("hessian", "energy", vec![hessian.value]),
            ("hessian", "grad", hessian.gradient.as_ref().to_vec()),
        ],
        flags: [value.flags, gradient.flags, hessian.flags],
    }
}

/// Evaluates the blocks `force`, `dfdx` and `dfdv` of mixed unknowns.
#[doc(hidden)]
pub fn evaluate_mixed_force<T: Real, E: MixedForce<T>>(element: &E, inputs: &Inputs<'_, T>) -> Outputs<T> {
    let (u, v): (E::Unknowns, E::Increments) = (unknowns(inputs.positions), unknowns(inputs.velocities));
    let (force, jacobians) = (element.force(&u, &v), element.jacobians(&u, &v));
    Outputs {
        blocks: vec![
            ("force", force.force.as_ref().to_vec()),
            ("dfdx", jacobians.by_position.as_ref().to_vec()),
            ("dfdv", jacobians.by_velocity.as_ref().to_vec()),
        ],
        repeats: vec![("jacobians", "force", jacobians.force.as_ref().to_vec())],
        flags: [force.flags, jacobians.flags, jacobians.flags],
    }
}

/// Evaluates the blocks of the potential and the force, `constraint` and `jacobian`, of mixed unknowns.
#[doc(hidden)]
pub fn evaluate_mixed_constraint<T: Real, E: MixedConstraint<T>>(element: &E, inputs: &Inputs<'_, T>) -> Outputs<T> {
    let mut outputs = evaluate_mixed_potential(element, inputs);
    let force = evaluate_mixed_force(element, inputs);
    let jacobian = element.constraint_jacobian(&unknowns(inputs.positions));
    outputs.blocks.extend(force.blocks);
    outputs.repeats.extend(force.repeats);
    outputs.blocks.push(("constraint", jacobian.value.as_ref().to_vec()));
    outputs.blocks.push(("jacobian", jacobian.jacobian.as_ref().to_vec()));
    outputs
}

/// Adds the blocks `next`, `next_by_unknowns` and `next_by_state`.
#[doc(hidden)]
pub fn evaluate_next<T: Real, E: Stateful<T>>(
    element: &E,
    inputs: &Inputs<'_, T>,
    mut outputs: Outputs<T>,
) -> Outputs<T> {
    let u: E::Unknowns = unknowns(inputs.positions);
    let (next, jacobians) = (element.next(&u), element.next_jacobians(&u));
    outputs.blocks.push(("next", next.state.as_ref().to_vec()));
    outputs.blocks.push(("next_by_unknowns", jacobians.by_unknowns.as_ref().to_vec()));
    outputs.blocks.push(("next_by_state", jacobians.by_state.as_ref().to_vec()));
    outputs.repeats.push(("next_jacobians", "next", jacobians.state.as_ref().to_vec()));
    outputs
}

/// Adds the blocks of [`evaluate_next`], and `slopes_by_state`.
#[doc(hidden)]
pub fn evaluate_state<T: Real, E: StateSensitivity<T>>(
    element: &E,
    inputs: &Inputs<'_, T>,
    outputs: Outputs<T>,
) -> Outputs<T> {
    let mut outputs = evaluate_next(element, inputs, outputs);
    let slopes = element.state_jacobian(&unknowns(inputs.positions));
    outputs.blocks.push(("slopes_by_state", slopes.by_state.as_ref().to_vec()));
    outputs
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_become_points() {
        assert_eq!(points::<f64, [Vector3<f64>; 2]>(&[1.0, 2.0, 3.0, 4.0, 5.0]), [[1.0, 2.0, 3.0], [4.0, 5.0, 0.0]]);
        assert_eq!(flat(&[[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]), [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
    }
}
