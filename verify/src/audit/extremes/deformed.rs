//! Deformations with extreme singular values: needles, near mirror images, equal and nearly equal stretches.

use energy_dsl::{Declaration, FieldKind};

use super::rest::RestShape;
use super::{Extreme, dyadic};
use crate::sample::Sample;

/// Principal stretches of a solid, and their description. The third is negative near a mirror image.
const SOLID: &[(&str, [f64; 3])] = &[
    ("at a needle", [1.0, 1e-5, 1e-8]),
    ("near a mirror image", [1.0, 1e-3, -9.99e-4]),
    ("where two stretches are nearly equal", [1.5, 1.5 * (1.0 + 1e-9), 0.75]),
    ("near a mirror image", [1.0, 1.0, -0.999_999]),
    ("where two stretches are equal", [1.5, 1.5, 0.75]),
    ("at a needle", [1.0, 3e-7, 3e-7]),
    ("where three stretches are equal", [1.25, 1.25, 1.25]),
    ("at a nearly flat shape", [1.0, 0.75, 1e-8]),
    ("where three stretches are nearly equal", [1.25, 1.25 * (1.0 + 1e-8), 1.25 * (1.0 - 1e-8)]),
    ("at a shape just inverted", [1.0, 0.75, -1e-6]),
    ("near a mirror image", [1.0, 1e-4, -9.9e-5]),
    ("where two stretches are nearly equal", [1.5, 0.75, 0.75 * (1.0 + 1e-13)]),
];

/// Principal stretches of a surface.
const SURFACE: &[(&str, [f64; 2])] = &[
    ("where two stretches are nearly equal", [1.5, 1.5 * (1.0 + 1e-9)]),
    ("at a needle", [1.0, 1e-8]),
    ("where two stretches are equal", [1.5, 1.5]),
    ("at a needle", [1.0, 1e-4]),
    ("where two stretches are nearly equal", [1.5, 1.5 * (1.0 + 1e-13)]),
];

/// A rotation that no axis is invariant under.
const TURN: [[f64; 3]; 3] = [[-0.6, 0.0, 0.8], [0.64, -0.6, 0.48], [0.48, 0.8, 0.36]];

/// Returns deformations of a rest shape, along the axes and turned.
pub(super) fn of_rest(rest: &RestShape, ordinary: &Sample) -> Vec<Extreme> {
    let place = |stretches: [f64; 3], turned: bool| {
        rest.moved(ordinary, |point| {
            let principal = std::array::from_fn(|axis| stretches[axis] * point.get(axis).copied().unwrap_or(0.0));
            if turned { TURN.map(|row| (0..3).map(|axis| row[axis] * principal[axis]).sum()) } else { principal }
        })
    };
    each(rest.dimension, place)
}

/// Returns points whose edges from the first one are the columns of such a matrix, for elements of three or four points
/// without rest shape.
pub(super) fn of_edges(ordinary: &Sample) -> Vec<Extreme> {
    let dimension = match ordinary.positions.len() {
        9 => 2,
        12 => 3,
        _ => return Vec::new(),
    };
    let origin: Vec<f64> = ordinary.positions[..3].iter().map(|&x| dyadic(x)).collect();
    let place = |stretches: [f64; 3], turned: bool| {
        let edge = |number: usize, axis: usize| match turned {
            true => TURN[axis][number] * stretches[number],
            false => {
                if axis == number {
                    stretches[number]
                } else {
                    0.0
                }
            }
        };
        let edges = (0..dimension).flat_map(|number| (0..3).map(move |axis| (number, axis)));
        let points = edges.map(|(number, axis)| origin[axis] + edge(number, axis));
        let positions = origin.iter().copied().chain(points).collect();
        Sample { positions, ..ordinary.clone() }
    };
    each(dimension, place)
}

/// Whether an input may be a square matrix. A rotation has four numbers, too.
fn is_square(field: &energy_dsl::Field, dimension: usize) -> bool {
    field.size == dimension * dimension && field.kind == FieldKind::Numbers
}

/// Returns inputs whose matrices, 2×2 or 3×3, are such ones: unknowns, or else parameters.
pub(super) fn of_matrices(declaration: &Declaration, ordinary: &Sample) -> Vec<Extreme> {
    let place = |fields: &[energy_dsl::Field], numbers: &[f64], dimension: usize, stretches: [f64; 3], turned: bool| {
        let mut numbers = numbers.to_vec();
        let mut first = 0;
        for field in fields {
            if is_square(field, dimension) {
                for row in 0..dimension {
                    for column in 0..dimension {
                        let turn =
                            if dimension == 3 { TURN[row][column] } else { [[0.6, 0.8], [-0.8, 0.6]][row][column] };
                        let along = if row == column { 1.0 } else { 0.0 };
                        let entry = if turned { turn } else { along };
                        numbers[first + dimension * row + column] = entry * stretches[column];
                    }
                }
            }
            first += field.size;
        }
        numbers
    };
    let mut list = Vec::new();
    for dimension in [2, 3] {
        let has = |fields: &[energy_dsl::Field]| fields.iter().any(|field| is_square(field, dimension));
        if has(&declaration.points) {
            list.extend(each(dimension, |stretches, turned| {
                let positions = place(&declaration.points, &ordinary.positions, dimension, stretches, turned);
                Sample { positions, ..ordinary.clone() }
            }));
        } else if has(&declaration.parameters) {
            list.extend(each(dimension, |stretches, turned| {
                let parameters = place(&declaration.parameters, &ordinary.parameters, dimension, stretches, turned);
                Sample { parameters, ..ordinary.clone() }
            }));
        }
    }
    list
}

/// Places each triple or pair of stretches, alternately along the axes and turned; then the first ones the other way.
fn each(dimension: usize, place: impl Fn([f64; 3], bool) -> Sample) -> Vec<Extreme> {
    const BOTH_WAYS: usize = 4;
    let list: Vec<(&str, [f64; 3])> = match dimension {
        2 => SURFACE.iter().map(|&(name, [a, b])| (name, [a, b, 1.0])).collect(),
        _ => SOLID.to_vec(),
    };
    let describe = |stretches: &[f64]| stretches.iter().map(|s| format!("{s:?}")).collect::<Vec<_>>().join(", ");
    let placed = |(number, &(name, stretches)): (usize, &(&str, [f64; 3])), is_second: bool| {
        let is_turned = (number % 2 == 1) != is_second;
        let name = format!("{name}, of stretches {}", describe(&stretches[..dimension]));
        Extreme::new(name, place(stretches, is_turned))
    };
    let first = list.iter().enumerate().map(|item| placed(item, false));
    first.chain(list.iter().enumerate().take(BOTH_WAYS).map(|item| placed(item, true))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the edges from the first point.
    fn edges(sample: &Sample) -> Vec<[f64; 3]> {
        let x = &sample.positions;
        (1..x.len() / 3).map(|point| std::array::from_fn(|axis| x[3 * point + axis] - x[axis])).collect()
    }

    fn dot(a: &[f64; 3], b: &[f64; 3]) -> f64 {
        (0..3).map(|axis| a[axis] * b[axis]).sum()
    }

    /// Turned or not, the edges are orthogonal, and their lengths are the stretches.
    #[test]
    fn points_have_the_stretches_that_their_places_name() {
        for count in [3, 4] {
            let ordinary = Sample { positions: vec![0.5; 3 * count], ..Sample::default() };
            let list = of_edges(&ordinary);
            assert!(list.len() >= if count == 3 { 9 } else { 16 });
            for Extreme { place, sample } in &list {
                let stretches = place.split(", of stretches ").nth(1).unwrap().split(", ");
                let edges = edges(sample);
                for (edge, stretch) in edges.iter().zip(stretches) {
                    let stretch: f64 = stretch.parse().unwrap();
                    assert!((dot(edge, edge).sqrt() - stretch.abs()).abs() < 1e-15, "{place}: {edges:?}");
                }
                assert!(dot(&edges[0], &edges[1]).abs() < 1e-15, "{place}: {edges:?}");
            }
        }
    }

    #[test]
    fn every_kind_of_place_is_among_the_first() {
        let ordinary = Sample { positions: vec![0.5; 12], ..Sample::default() };
        let list = of_edges(&ordinary);
        let first: Vec<&str> = list[..8].iter().map(Extreme::kind).collect();
        for kind in [
            "at a needle",
            "near a mirror image",
            "where two stretches are nearly equal",
            "where two stretches are equal",
            "where three stretches are equal",
        ] {
            assert!(first.contains(&kind), "{kind} is not in {first:?}");
        }
    }
}
