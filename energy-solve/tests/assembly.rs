//! The assembled matrix is the derivative of the assembled force; pinning removes rows and columns.

use crate::elements::{AnySpring, Damper, Spring};
use energy_dsl::Vector3;
use energy_elements::{BridsonForce, StVK};
use energy_solve::{
    BlockMatrix, Curvature, ElementList, EvaluationError, ForceTerm, LinearisationOptions, ListError, PotentialTerm,
    Quantity, State, StepStart, System, SystemError, Term, Weights,
};

const EDGES: [[usize; 2]; 6] = [[0, 1], [1, 2], [2, 3], [3, 0], [0, 2], [4, 1]];

fn positions() -> Vec<Vector3<f64>> {
    vec![[0.0, 0.1, 0.0], [1.0, -0.1, 0.2], [1.2, 1.0, -0.3], [0.1, 1.1, 0.4], [2.0, 0.3, 0.5]]
}

fn velocities() -> Vec<Vector3<f64>> {
    vec![[0.3, -0.2, 0.1], [-0.5, 0.4, 0.2], [0.1, 0.7, -0.6], [0.2, -0.3, 0.8], [0.0, 0.5, -0.4]]
}

fn springs() -> Box<dyn Term> {
    let elements = (0..EDGES.len()).map(|i| Spring { stiffness: 10.0 + i as f64, length: 0.8 }).collect();
    Box::new(PotentialTerm::new(ElementList::new("springs", elements, &EDGES).unwrap()))
}

fn dampers() -> Box<dyn Term> {
    let elements = (0..EDGES.len()).map(|i| Damper { c: 0.5 + 0.1 * i as f64, e: [0.3, -0.2, 0.7] }).collect();
    Box::new(ForceTerm::new(ElementList::new("dampers", elements, &EDGES).unwrap()))
}

/// Springs without rest length, whose Jacobians are constant. Two of them connect vertices that nothing else couples.
fn slack_springs() -> Box<dyn Term> {
    let edges = [[0, 1], [0, 4], [2, 4]];
    let elements = (0..3).map(|i| AnySpring::<f64, true> { stiffness: 3.0 + i as f64, length: 0.0 }).collect();
    Box::new(PotentialTerm::new(ElementList::new("slack springs", elements, &edges).unwrap()))
}

fn system(pinned: &[usize]) -> System {
    let pinned: Vec<bool> = (0..5).map(|vertex| pinned.contains(&vertex)).collect();
    System::new(vec![springs(), dampers()], &pinned).unwrap()
}

fn options(weights: Weights, curvature: Curvature) -> LinearisationOptions {
    LinearisationOptions::new(weights, curvature).with_stiffness_times_velocity(true)
}

fn assembled(system: &mut System, weights: Weights) -> BlockMatrix {
    let (x, v) = (positions(), velocities());
    let mut matrix = system.matrix();
    system.linearise(State { x: &x, v: &v }, options(weights, Curvature::Exact), &mut matrix).unwrap();
    matrix
}

#[test]
fn matrix_is_the_derivative_of_the_force() {
    let mut system = system(&[3]);
    let free = system.dofs().free().to_vec();
    for by_velocity in [false, true] {
        let weights = Weights { position: f64::from(!by_velocity), velocity: f64::from(by_velocity) };
        let matrix = assembled(&mut system, weights);
        for (column, &vertex) in free.iter().enumerate() {
            for axis in 0..3 {
                let mut force_at = |step: f64| {
                    let (mut x, mut v) = (positions(), velocities());
                    if by_velocity {
                        v[vertex][axis] += step
                    } else {
                        x[vertex][axis] += step
                    }
                    system.forces(State { x: &x, v: &v }).unwrap()
                };
                let (after, before) = (force_at(1e-5), force_at(-1e-5));
                for (row, &touched) in free.iter().enumerate() {
                    for component in 0..3 {
                        let expected = (after[touched][component] - before[touched][component]) / 2e-5;
                        let got = matrix.block(row, column)[component][axis];
                        assert!(
                            (got - expected).abs() < 1e-7,
                            "by velocity: {by_velocity}, block ({row}, {column}), entry ({component}, {axis}): \
                             {got} {expected}"
                        );
                    }
                }
            }
        }
    }
}

/// A force law whose Jacobian is not symmetric makes the matrix store both triangles. Blocks of potentials below the
/// diagonal are then transposes of those above.
#[test]
fn potentials_fill_both_triangles_beside_an_unsymmetric_force() {
    let triangles = [[2, 0, 3], [1, 3, 2]];
    let rest = [[[0.0, 0.0], [1.0, 0.1], [0.2, 1.1]], [[0.0, 0.0], [0.9, 0.0], [0.3, 1.0]]];
    let membranes = rest.map(|[a, b, c]| StVK::new(a, b, c, 3.0, 5.0).unwrap()).to_vec();
    let membrane = PotentialTerm::new(ElementList::new("membrane", membranes, &triangles).unwrap());
    let bending = ElementList::new("bending", vec![BridsonForce::new(2.0, 0.3)], &[[0, 1, 2, 3]]).unwrap();
    let mut system = System::new(vec![Box::new(membrane), Box::new(ForceTerm::new(bending))], &[false; 4]).unwrap();
    let x = [[1.1, 0.2, 0.3], [-0.2, 0.9, -0.1], [0.1, 0.0, 0.2], [0.3, 1.2, -0.2]];
    let still = [[0.0; 3]; 4];
    let mut matrix = system.matrix();
    let weights = Weights { position: 1.0, velocity: 0.0 };
    system.linearise(State { x: &x, v: &still }, options(weights, Curvature::Exact), &mut matrix).unwrap();
    let mut asymmetry = 0.0_f64;
    for (column, axis) in (0..4).flat_map(|column| (0..3).map(move |axis| (column, axis))) {
        let mut forces = |step: f64| {
            let mut moved = x;
            moved[column][axis] += step;
            system.forces(State { x: &moved, v: &still }).unwrap()
        };
        let (after, before) = (forces(1e-5), forces(-1e-5));
        for (row, component) in (0..4).flat_map(|row| (0..3).map(move |component| (row, component))) {
            let expected = (after[row][component] - before[row][component]) / 2e-5;
            let (got, mirrored) =
                (matrix.block(row, column)[component][axis], matrix.block(column, row)[axis][component]);
            assert!((got - expected).abs() < 1e-6, "block ({row}, {column}), entry ({component}, {axis}): {got}");
            asymmetry = asymmetry.max((got - mirrored).abs());
        }
    }
    assert!(asymmetry > 0.1, "the Jacobian is symmetric to {asymmetry:e}");
}

#[test]
fn masses_are_added_on_the_diagonal() {
    let (x, v) = (positions(), velocities());
    let state = State { x: &x, v: &v };
    let masses: Vec<f64> = (0..5).map(|vertex| 0.5 + f64::from(vertex)).collect();
    let heavier: Vec<f64> = masses.iter().map(|mass| 2.0 * mass).collect();
    let weights = Weights { position: -1e-2, velocity: -0.1 };
    let options = LinearisationOptions::new(weights, Curvature::Exact);
    // Only slack springs have constant Jacobians.
    let ropes = |terms| System::new(terms, &[false, false, false, true, false]).unwrap();
    for mut system in [system(&[3]), ropes(vec![springs()]), ropes(vec![springs(), slack_springs()])] {
        let mut bare = system.matrix();
        let expected = system.linearise(state, options, &mut bare).unwrap();
        let mut massive = system.matrix();
        for masses in [&masses, &heavier, &masses] {
            let found = system.linearise_with_masses(state, options, masses, &mut massive).unwrap();
            assert_eq!(found, expected);
            for row in 0..4 {
                for column in 0..4 {
                    let (with, without) = (massive.block(row, column), bare.block(row, column));
                    for i in 0..3 {
                        for j in 0..3 {
                            let mass = if (row, i) == (column, j) { masses[system.dofs().free()[row]] } else { 0.0 };
                            assert!((with[i][j] - without[i][j] - mass).abs() < 1e-12, "block ({row}, {column})");
                        }
                    }
                }
            }
        }
    }
}

#[test]
fn single_precision_rounds_the_matrix_and_nothing_else() {
    let terms = vec![springs(), slack_springs(), dampers()];
    let mut system = System::new(terms, &[false, false, false, true, false]).unwrap();
    let (x, v) = (positions(), velocities());
    let weights = Weights { position: -1e-2, velocity: -0.1 };
    let state = State { x: &x, v: &v };
    for wanted in [true, false] {
        let options = options(weights, Curvature::Exact).with_stiffness_times_velocity(wanted);
        let (mut double, mut single) = (system.matrix(), system.matrix_in::<f32>());
        let expected = system.linearise_with_masses(state, options, &[0.5; 5], &mut double).unwrap();
        // The constant part is kept the first time, and evaluated again after the matrix was changed.
        for time in 0..3 {
            if time == 2 {
                single.values_mut().fill([[7.0; 3]; 3]);
                *single.diagonal_mut(0) = [[5.0; 3]; 3];
            }
            let found = system.linearise_with_masses(state, options, &[0.5; 5], &mut single).unwrap();
            assert_eq!(found, expected);
            for (row, column) in (0..4).flat_map(|row| (0..4).map(move |column| (row, column))) {
                let (double, single) = (double.block(row, column), single.block(row, column));
                for (double, single) in double.as_flattened().iter().zip(single.as_flattened()) {
                    assert!((double - single).abs() <= 2e-7 * double.abs().max(0.1), "{double} {single}");
                }
            }
        }
    }
}

#[test]
fn force_is_minus_the_derivative_of_the_energy() {
    let mut system = System::new(vec![springs()], &[false; 5]).unwrap();
    let v = vec![[0.0; 3]; 5];
    let x = positions();
    let force = system.forces(State { x: &x, v: &v }).unwrap();
    for vertex in 0..5 {
        for axis in 0..3 {
            let mut energy_at = |step: f64| {
                let mut x = positions();
                x[vertex][axis] += step;
                system.energies(&x).unwrap()[0].energy.unwrap()
            };
            let slope = (energy_at(1e-5) - energy_at(-1e-5)) / 2e-5;
            assert!((force[vertex][axis] + slope).abs() < 1e-7);
        }
    }
}

#[test]
fn stiffness_times_velocity_is_the_directional_derivative() {
    let mut system = system(&[3]);
    let (x, v) = (positions(), velocities());
    let mut matrix = system.matrix();
    let weights = Weights { position: 1.0, velocity: 0.0 };
    let got = system.linearise(State { x: &x, v: &v }, options(weights, Curvature::Exact), &mut matrix).unwrap();
    let mut force_at = |step: f64| {
        let moved: Vec<Vector3<f64>> =
            x.iter().zip(&v).map(|(x, v)| std::array::from_fn(|axis| x[axis] + step * v[axis])).collect();
        system.forces(State { x: &moved, v: &v }).unwrap()
    };
    let (after, before) = (force_at(1e-5), force_at(-1e-5));
    for vertex in 0..5 {
        for axis in 0..3 {
            let expected = (after[vertex][axis] - before[vertex][axis]) / 2e-5;
            assert!((got.stiffness_times_velocity[vertex][axis] - expected).abs() < 1e-6);
        }
    }
}

#[test]
fn pinning_removes_rows_and_columns() {
    let weights = Weights { position: 1.0, velocity: 0.5 };
    let whole = assembled(&mut system(&[]), weights);
    let mut pinned = system(&[0, 3]);
    let part = assembled(&mut pinned, weights);
    let free = [1, 2, 4];
    assert_eq!(pinned.dofs().free(), free);
    assert_eq!(part.pattern().rows(), 3);
    for (row, &i) in free.iter().enumerate() {
        for (column, &j) in free.iter().enumerate() {
            assert_eq!(part.block(row, column), whole.block(i, j), "block ({i}, {j})");
        }
    }
}

#[test]
fn evaluated_and_skipped_elements_are_counted() {
    let mut system = system(&[0, 3]);
    assembled(&mut system, Weights { position: 1.0, velocity: 0.0 });
    system.energies(&velocities()).unwrap();
    let counts: Vec<_> = system.terms().map(|(_, counts)| counts).collect();
    // Only edge 3–0 has both ends pinned.
    assert_eq!((counts[0].hessian.evaluated, counts[0].hessian.skipped), (5, 1));
    assert_eq!((counts[0].value.evaluated, counts[0].gradient.evaluated), (5, 0));
    assert_eq!((counts[1].hessian.evaluated, counts[1].value.evaluated), (5, 0), "a force law has no energy");
}

#[test]
fn energies_that_came_with_forces_are_not_evaluated_again() {
    let mut system = System::new(vec![springs(), slack_springs(), dampers()], &[false; 5]).unwrap();
    let (x, v) = (positions(), velocities());
    let state = State { x: &x, v: &v };
    let energies = |system: &mut System| -> Vec<Option<f64>> {
        system.energies(&x).unwrap().into_iter().map(|term| term.energy).collect()
    };
    let evaluated = |system: &System| system.terms().map(|(_, counts)| counts.value.evaluated).sum::<u64>();
    let expected = energies(&mut system);
    let before = evaluated(&system);
    assert!(expected[0].is_some() && expected[1].is_some() && expected[2].is_none());
    let agree = |found: Vec<Option<f64>>| {
        for (found, expected) in found.into_iter().zip(&expected) {
            let difference = found.unwrap_or(0.0) - expected.unwrap_or(0.0);
            assert!(difference.abs() <= 1e-15 * expected.unwrap_or(0.0), "{found:?}, not {expected:?}");
        }
    };

    system.forces(state).unwrap();
    agree(energies(&mut system));
    let mut matrix = system.matrix();
    let weights = Weights { position: 1.0, velocity: 0.0 };
    system.linearise(state, options(weights, Curvature::Exact), &mut matrix).unwrap();
    agree(energies(&mut system));
    agree(energies(&mut system));
    assert_eq!(evaluated(&system), before);

    // Energies are evaluated at other positions, and after the start of a step, which may change what terms hold fixed.
    let elsewhere = velocities();
    assert!(system.energies(&elsewhere).unwrap()[0].energy != expected[0]);
    agree(energies(&mut system));
    assert_eq!(evaluated(&system), 3 * before);
    system.forces(state).unwrap();
    system.begin_step(StepStart { time: 0.0, dt: 0.01, state }).unwrap();
    agree(energies(&mut system));
    assert_eq!(evaluated(&system), 4 * before);
}

#[test]
fn constant_jacobians_are_evaluated_once_for_each_matrix() {
    let mut system = System::new(vec![springs(), slack_springs()], &[false; 5]).unwrap();
    let (x, v) = (positions(), velocities());
    let state = State { x: &x, v: &v };
    let weights = Weights { position: -1e-2, velocity: 0.0 };
    let options = LinearisationOptions::new(weights, Curvature::Exact);
    let other = LinearisationOptions::new(Weights { position: -2e-2, velocity: 0.0 }, options.curvature);
    let mut evaluated = 0;
    let mut added = |system: &mut System, options: LinearisationOptions, matrix: &mut BlockMatrix| {
        system.linearise(state, options, matrix).unwrap();
        let counts = system.terms().nth(1).unwrap().1;
        let before = std::mem::replace(&mut evaluated, counts.hessian.evaluated);
        evaluated - before
    };
    let (mut one, mut two) = (system.matrix(), system.matrix());
    assert_eq!(added(&mut system, options, &mut one), 3);
    assert_eq!(added(&mut system, other, &mut two), 3);
    // In turns, each matrix keeps its own constant part. Clones share it.
    let mut copy = one.clone();
    for _ in 0..2 {
        assert_eq!(added(&mut system, options, &mut one), 0);
        assert_eq!(added(&mut system, other, &mut two), 0);
        assert_eq!(added(&mut system, options, &mut copy), 0);
    }
    assert_eq!(one.values(), copy.values());
    // Other weights and changed entries need another evaluation, and both give what a new matrix gets.
    two.values_mut()[0] = [[7.0; 3]; 3];
    for matrix in [&mut one, &mut two] {
        let weights = Weights { position: -3e-2, velocity: 0.0 };
        assert_eq!(added(&mut system, LinearisationOptions::new(weights, options.curvature), matrix), 3);
    }
    assert_eq!(one.values(), two.values());
    let mut new = system.matrix();
    assert_eq!(added(&mut system, options, &mut new), 3);
    assert_eq!(added(&mut system, options, &mut copy), 0);
    assert_eq!(new.values(), copy.values());
}

#[test]
fn elements_with_pinned_vertices_only_are_counted_as_skipped() {
    let mut pinned = system(&[0, 1, 2, 3, 4]);
    assert_eq!(pinned.energies(&positions()).unwrap()[0].energy, Some(0.0));
    let (_, counts) = pinned.terms().next().unwrap();
    assert_eq!((counts.value.evaluated, counts.value.skipped), (0, EDGES.len() as u64));
}

#[test]
fn projection_leaves_no_negative_curvature() {
    let list = ElementList::new("strut", vec![Spring { stiffness: 1.0, length: 2.0 }], &[[0, 1]]).unwrap();
    let mut system = System::new(vec![Box::new(PotentialTerm::new(list))], &[false, true]).unwrap();
    let state = State { x: &[[1.0, 0.0, 0.0], [0.0; 3]], v: &[[0.0; 3]; 2] };
    let mut matrix = system.matrix();
    let weights = Weights { position: -1.0, velocity: 0.0 };
    system.linearise(state, options(weights, Curvature::Exact), &mut matrix).unwrap();
    assert_eq!(*matrix.diagonal(0), [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]]);
    system.linearise(state, options(weights, Curvature::Clamped), &mut matrix).unwrap();
    for row in 0..3 {
        for column in 0..3 {
            let expected = if (row, column) == (0, 0) { 1.0 } else { 0.0 };
            assert!((matrix.diagonal(0)[row][column] - expected).abs() < 1e-14);
        }
    }
}

#[test]
fn stencils_that_do_not_fit_are_named() {
    let spring = Spring { stiffness: 1.0, length: 1.0 };
    let arity = ElementList::new("hinges", vec![spring], &[[0, 1, 2]]).unwrap_err();
    assert_eq!(arity.to_string(), "hinges: Spring acts on 2 points, but its stencils have 3 vertices");
    let repeated = ElementList::new("springs", vec![spring; 2], &[[0, 1], [4, 4]]).unwrap_err();
    assert_eq!(repeated, ListError::RepeatedVertex { list: "springs".into(), index: 1, vertex: 4 });
    let count = ElementList::new("springs", vec![spring], &[[0, 1], [1, 2]]).unwrap_err();
    assert_eq!(count.to_string(), "springs: expected one stencil per element, got 2 stencils for 1 elements");
    let list = ElementList::new("springs", vec![spring; 2], &[[0, 1], [1, 7]]).unwrap();
    let range = System::new(vec![Box::new(PotentialTerm::new(list))], &[false; 3]).unwrap_err();
    assert!(matches!(range, SystemError::VertexOutOfRange { element: 1, vertex: 7, .. }), "{range:?}");
    assert_eq!(range.to_string(), "springs: element 1 names vertex 7, but there are only 3 vertices (0 to 2)");
}

#[test]
fn non_finite_numbers_are_traced_to_their_source() {
    let mut system = system(&[]);
    let (mut x, v) = (positions(), velocities());
    x[2][1] = f64::NAN;
    let state = system.forces(State { x: &x, v: &v }).unwrap_err();
    assert!(matches!(state, EvaluationError::NonFiniteState { what: "position", vertex: 2, .. }), "{state}");

    // This spring, unlike the robust ones, divides by zero at coincident ends.
    x[2] = x[1];
    let element = system.forces(State { x: &x, v: &v }).unwrap_err();
    assert_eq!(
        element,
        EvaluationError::NonFiniteElement {
            term: "springs".into(),
            element: 1,
            vertices: vec![1, 2],
            what: Quantity::Force
        }
    );
    let short = system.forces(State { x: &x[..4], v: &v }).unwrap_err();
    assert_eq!(short.to_string(), "the system has 5 vertices, but 4 positions were given");
}
