//! Sums, equilibria and motions of bodies with unknowns that are not only points.

use energy_solve::{
    BandOrder, BorderedError, BorderedMatrix, Curvature, ElementList, Extremum, Inertia, KindSolver,
    LinearisationOptions, MixedBody, MixedError, MixedIntegrator, MixedNewton, MixedNewtonError, MixedNewtonOptions,
    MixedScheme, MixedState, MixedStop, MixedSystem, MixedTerm, PotentialTerm, SolveOptions, State, System,
    UnknownKind, Weights,
};
use nalgebra::{DMatrix, DVector};

use super::elements::Spring;
use super::elements::mixed::{CommonLength, Face, Filling, Joint, LengthCost, Plane, Relaxing, Rod};

const SCALAR: UnknownKind = UnknownKind::Scalar;
const VECTOR: UnknownKind = UnknownKind::Vector3;
const BAND: KindSolver = KindSolver::Band(BandOrder::Narrowest);

fn gradients() -> KindSolver {
    KindSolver::ConjugateGradients(SolveOptions::new(1e-13))
}

/// Returns the matrix over the free unknowns.
fn dense(matrix: &BorderedMatrix) -> DMatrix<f64> {
    let rows = matrix.rows();
    let mut dense = DMatrix::zeros(rows, rows);
    for column in 0..rows {
        let (mut x, mut y) = (vec![0.0; rows], vec![0.0; rows]);
        x[column] = 1.0;
        matrix.multiply(&x, &mut y);
        dense.set_column(column, &DVector::from_vec(y));
    }
    dense
}

/// A rod along x with `nodes` points, a twist on each edge, and a first node and twist that are fixed.
fn rod(nodes: usize, fixed: &[usize]) -> MixedSystem {
    let kinds: Vec<UnknownKind> = (0..2 * nodes - 1).map(|i| if i % 2 == 0 { VECTOR } else { SCALAR }).collect();
    let body = MixedBody::new(&kinds, 0.1).with_fixed(fixed).unwrap();
    let elements: Vec<Rod> = (1..nodes - 1)
        .map(|node| Rod { stretch: 50.0, length: 1.0, bend: 2.0, twist: 3.0, rest: 0.01 * (node % 7) as f64 })
        .collect();
    let stencils: Vec<[usize; 5]> = (0..nodes - 2).map(|i| 2 * i).map(|i| [i, i + 2, i + 4, i + 1, i + 3]).collect();
    MixedSystem::new(body, vec![MixedTerm::new("rod", elements, &stencils).unwrap()]).unwrap()
}

/// Returns a configuration of the rod, bent by pseudo-random numbers.
fn bent(system: &MixedSystem, size: f64) -> Vec<f64> {
    let body = system.body();
    let mut random = fastrand::Rng::with_seed(7);
    let mut u: Vec<f64> = (0..body.numbers()).map(|_| size * (random.f64() - 0.5)).collect();
    (0..body.len()).filter(|i| body.kind(*i) == VECTOR).for_each(|i| u[body.first_number(i)] += 0.5 * i as f64);
    u
}

/// A body with unknowns of every kind, shared and fixed ones, and elements of five types.
fn everything() -> (MixedSystem, Vec<f64>) {
    let kinds = [VECTOR, SCALAR, UnknownKind::Rotation, VECTOR, UnknownKind::Vector2, VECTOR, SCALAR, VECTOR];
    let body = MixedBody::new(&kinds, 0.5)
        .with_shared(SCALAR, Extremum::Maximum, 0.0)
        .with_shared(SCALAR, Extremum::Minimum, 1.0)
        .with_fixed(&[7])
        .unwrap();
    let terms = vec![
        MixedTerm::new("plane", vec![Plane { stiffness: 3.0 }; 2], &[[4, 1, 0], [4, 6, 3]]).unwrap(),
        MixedTerm::new("joint", vec![Joint { stiffness: 7.0, lever: 0.8 }; 2], &[[2, 3], [2, 5]]).unwrap(),
        MixedTerm::new("faces", vec![Face { sign: 1.0 }; 2], &[[0, 3, 5, 0], [5, 7, 0, 0]]).unwrap(),
        MixedTerm::new("filling", vec![Filling { volume: 0.3, compliance: 0.7 }], &[[0]]).unwrap(),
        MixedTerm::new("lengths", vec![CommonLength { stiffness: 4.0 }; 2], &[[0, 3, 1], [3, 7, 1]]).unwrap(),
        MixedTerm::new("cost", vec![LengthCost { stiffness: 5.0, length: 1.1 }], &[[1]]).unwrap(),
        MixedTerm::of_points("springs", vec![Spring { stiffness: 2.0, length: 0.9 }; 2], &[[0, 5], [7, 3]]).unwrap(),
    ];
    let system = MixedSystem::new(body, terms).unwrap();
    let mut random = fastrand::Rng::with_seed(3);
    let mut u: Vec<f64> = (0..system.body().numbers()).map(|_| 2.0 * random.f64() - 1.0).collect();
    let first = system.body().first_number(2);
    let norm = u[first..first + 4].iter().map(|c| c * c).sum::<f64>().sqrt();
    u[first..first + 4].iter_mut().for_each(|c| *c /= norm);
    (system, u)
}

/// Increments that move, and how far.
type Moves = [(usize, f64)];

/// Returns a difference of values by one increment.
fn slope(at: &mut impl FnMut(&Moves) -> f64, i: usize, h: f64) -> f64 {
    (at(&[(i, h)]) - at(&[(i, -h)])) / (2.0 * h)
}

/// Returns a second difference of values by two increments.
fn second(at: &mut impl FnMut(&Moves) -> f64, i: usize, j: usize, h: f64) -> f64 {
    let mut corner = |by_i: f64, by_j: f64| at(&[(i, by_i), (j, by_j)]);
    (corner(h, h) - corner(h, -h) - corner(-h, h) + corner(-h, -h)) / (4.0 * h * h)
}

#[test]
fn derivatives_are_those_of_the_energy() {
    let (mut system, u) = everything();
    let increments = system.body().increments();
    let (_, gradient) = system.gradient(&u).unwrap();
    let mut matrix = system.matrix();
    let (_, again) = system.linearise(&u, Curvature::Exact, &mut matrix).unwrap();
    let apart = gradient.iter().zip(&again).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(apart < 1e-13, "gradients of both routines differ by {apart:e}");
    let mut at = |moves: &Moves| {
        let mut delta = vec![0.0; increments];
        moves.iter().for_each(|&(i, by)| delta[i] += by);
        let moved = system.body().moved(&u, 1.0, &delta);
        system.energy(&moved).unwrap().value
    };
    for i in 0..increments {
        let (near, far) = (1e-3, 2e-3);
        let difference = (4.0 * slope(&mut at, i, near) - slope(&mut at, i, far)) / 3.0;
        assert!((difference - gradient[i]).abs() < 1e-8, "increment {i}: {difference} against {}", gradient[i]);
    }
    // Differences of gradients along exp are not symmetric: Hessians are second differences of values.
    let mut differences = DMatrix::zeros(increments, increments);
    for i in 0..increments {
        for j in 0..increments {
            differences[(i, j)] = (4.0 * second(&mut at, i, j, 2e-3) - second(&mut at, i, j, 4e-3)) / 3.0;
        }
    }
    let free: Vec<usize> =
        system.free_part(&(0..increments).map(|i| i as f64).collect::<Vec<_>>()).iter().map(|i| *i as usize).collect();
    let exact = dense(&matrix);
    assert_eq!(exact, exact.transpose());
    for (row, &i) in free.iter().enumerate() {
        for (column, &j) in free.iter().enumerate() {
            let (found, expected) = (exact[(row, column)], differences[(i, j)]);
            assert!((found - expected).abs() < 1e-7, "({i}, {j}): {found} against {expected}");
        }
    }
}

#[test]
fn points_have_the_sums_of_a_system() {
    let springs = || vec![Spring { stiffness: 2.0, length: 0.9 }, Spring { stiffness: 3.0, length: 0.4 }];
    let stencils = [[0, 1], [1, 2]];
    let x = [[0.0, 0.1, 0.2], [1.0, -0.3, 0.0], [0.5, 1.0, 0.7]];
    let list = ElementList::new("springs", springs(), &stencils).unwrap();
    let mut of_points = System::new(vec![Box::new(PotentialTerm::new(list))], &[false; 3]).unwrap();
    // The points are the unknowns 1, 2 and 4 of a body with others.
    let body = MixedBody::new(&[SCALAR, VECTOR, VECTOR, SCALAR, VECTOR], 1.0);
    let elsewhere = stencils.map(|stencil| stencil.map(|point| [1, 2, 4][point]));
    let terms = vec![MixedTerm::of_points("springs", springs(), &elsewhere).unwrap()];
    let mut mixed = MixedSystem::new(body, terms).unwrap();
    let mut u = vec![5.0; mixed.body().numbers()];
    [1, 2, 4].iter().zip(x).for_each(|(&i, x)| u[mixed.body().first_number(i)..][..3].copy_from_slice(&x));
    let v = [[0.0; 3]; 3];
    let mut block_matrix = of_points.matrix();
    let options = LinearisationOptions::new(Weights { position: -1.0, velocity: 0.0 }, Curvature::Exact);
    let linear = of_points.linearise(State { x: &x, v: &v }, options, &mut block_matrix).unwrap();
    let mut matrix = mixed.matrix();
    let (energy, gradient) = mixed.linearise(&u, Curvature::Exact, &mut matrix).unwrap();
    assert_eq!(energy.value, of_points.energies(&x).unwrap()[0].energy.unwrap());
    for (point, i) in [1, 2, 4].into_iter().enumerate() {
        let own = &gradient[mixed.body().first_increment(i)..][..3];
        assert_eq!(own, linear.force[point].map(|f| -f));
    }
    assert_eq!(matrix.kinds().threes().values(), block_matrix.values());
}

/// Returns the relative distance to the solution of a dense solver, in the largest entry.
fn solver_error(system: &mut MixedSystem, u: &[f64], shift: f64, solver: &KindSolver) -> f64 {
    let mut matrix = system.matrix();
    system.linearise(u, Curvature::Exact, &mut matrix).unwrap();
    for unknown in 0..matrix.kinds().pattern().unknowns() {
        matrix.kinds_mut().add(unknown, unknown, |i, j| if i == j { shift } else { 0.0 });
    }
    let rows = matrix.rows();
    let right: Vec<f64> = (0..rows).map(|row| (row as f64 + 0.3).sin()).collect();
    let expected = dense(&matrix).lu().solve(&DVector::from_vec(right.clone())).unwrap();
    let mut found = vec![0.0; rows];
    energy_solve::BorderedSolver::new(system.pattern(), solver).solve(&matrix, &right, &mut found).unwrap();
    let apart = found.iter().zip(&expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    apart / expected.amax()
}

#[test]
fn solutions_agree_with_a_dense_solver() {
    for solver in [BAND, KindSolver::Band(BandOrder::AsGiven), gradients()] {
        let (mut system, u) = everything();
        let error = solver_error(&mut system, &u, 25.0, &solver);
        assert!(error < 1e-10, "{solver:?}: {error:e}");
        let mut system = rod(40, &[0, 1]);
        let u = bent(&system, 0.3);
        let error = solver_error(&mut system, &u, 60.0, &solver);
        assert!(error < 1e-10, "{solver:?}, rod: {error:e}");
    }
}

#[test]
fn a_maximised_unknown_may_make_an_indefinite_matrix_definite() {
    // −p (x² − 1)/2 … as a matrix: A = −1, and a border of 2 with the corner −1: −1 + 4 is positive.
    let pattern = energy_solve::KindPattern::from_stencils(&[1], [&[0][..]]).into();
    for (border, maximised, solved) in [(2.0, true, true), (0.5, true, false), (2.0, false, false)] {
        let mut matrix = BorderedMatrix::zeros(&pattern, &[maximised]);
        matrix.kinds_mut().add(0, 0, |_, _| -1.0);
        matrix.border_mut(0)[0] = border;
        matrix.corner_mut()[0] = -1.0;
        for solver in [BAND, gradients()] {
            let mut x = [0.0; 2];
            let outcome = energy_solve::BorderedSolver::new(&pattern, &solver).solve(&matrix, &[1.0, 0.0], &mut x);
            assert_eq!(outcome.is_ok(), solved, "{border} {maximised} {solver:?}: {outcome:?}");
            if solved {
                assert!((x[0] - 1.0 / 3.0).abs() < 1e-14 && (x[1] - 2.0 / 3.0).abs() < 1e-14, "{x:?}");
            }
        }
    }
    let mut matrix = BorderedMatrix::zeros(&pattern, &[true]);
    matrix.kinds_mut().add(0, 0, |_, _| 1.0);
    matrix.corner_mut()[0] = 1.0;
    for solver in [BAND, gradients()] {
        let outcome = energy_solve::BorderedSolver::new(&pattern, &solver).solve(&matrix, &[1.0; 2], &mut [0.0; 2]);
        assert_eq!(outcome, Err(BorderedError::NotConcave));
    }
}

#[test]
fn a_rod_has_ten_diagonals_in_any_order() {
    let width = |system: &MixedSystem, order: BandOrder| {
        energy_solve::BandFactor::new(system.pattern(), &order).half_bandwidth()
    };
    let in_order = rod(50, &[]);
    assert_eq!(width(&in_order, BandOrder::AsGiven), 10);
    assert!(width(&in_order, BandOrder::ReverseCuthillMckee) <= 12);
    // The same rod with shuffled unknowns.
    let mut places: Vec<usize> = (0..99).collect();
    fastrand::Rng::with_seed(1).shuffle(&mut places);
    let mut kinds = [SCALAR; 99];
    (0..99).step_by(2).for_each(|i| kinds[places[i]] = VECTOR);
    let element = Rod { stretch: 50.0, length: 1.0, bend: 2.0, twist: 3.0, rest: 0.0 };
    let stencils: Vec<[usize; 5]> =
        (0..48).map(|i| 2 * i).map(|i| [i, i + 2, i + 4, i + 1, i + 3].map(|unknown| places[unknown])).collect();
    let term = MixedTerm::new("rod", vec![element; 48], &stencils).unwrap();
    let shuffled = MixedSystem::new(MixedBody::new(&kinds, 1.0), vec![term]).unwrap();
    assert!(width(&shuffled, BandOrder::AsGiven) > 100);
    assert!(width(&shuffled, BandOrder::Narrowest) <= 12);
}

#[test]
fn projected_hessians_are_semi_definite_and_leave_multipliers_alone() {
    let (mut system, u) = everything();
    let (mut exact, mut projected) = (system.matrix(), system.matrix());
    system.linearise(&u, Curvature::Exact, &mut exact).unwrap();
    system.linearise(&u, Curvature::Clamped, &mut projected).unwrap();
    let projections: u64 = system.counts().map(|(_, counts)| counts.hessian.projected).sum();
    assert!(projections > 0);
    let (before, after) = (dense(&exact), dense(&projected));
    // The maximised unknown is the last row but one.
    let multiplier = before.nrows() - 2;
    assert_eq!(before.row(multiplier), after.row(multiplier));
    let least = |matrix: &DMatrix<f64>| -> f64 {
        matrix.clone().remove_row(multiplier).remove_column(multiplier).symmetric_eigenvalues().min()
    };
    assert!(least(&before) < -0.1, "{}", least(&before));
    assert!(least(&after) > -1e-12, "{}", least(&after));
}

#[test]
fn blocks_of_metres_and_radians_are_projected_by_their_length() {
    for length in [0.1, 3.0] {
        let body = MixedBody::new(&[UnknownKind::Rotation, VECTOR], length);
        let term = MixedTerm::new("joint", vec![Joint { stiffness: 2.0, lever: 0.7 }], &[[0, 1]]).unwrap();
        let mut system = MixedSystem::new(body, vec![term]).unwrap();
        let u = [0.6, 0.0, 0.8, 0.0, -0.9, 0.3, -0.4];
        let (mut exact, mut projected) = (system.matrix(), system.matrix());
        system.linearise(&u, Curvature::Exact, &mut exact).unwrap();
        system.linearise(&u, Curvature::Clamped, &mut projected).unwrap();
        // Increments in m: those of the rotation times the length.
        let scale = DVector::from_fn(6, |i, _| if i < 3 { 1.0 / length } else { 1.0 });
        let by_metres = DMatrix::from_diagonal(&scale) * dense(&exact) * DMatrix::from_diagonal(&scale);
        let mut eigen = by_metres.symmetric_eigen();
        assert!(eigen.eigenvalues.min() < -0.01, "the Hessian is indefinite");
        eigen.eigenvalues.iter_mut().for_each(|value| *value = value.max(0.0));
        let unscale = DMatrix::from_diagonal(&scale.map(|s| 1.0 / s));
        let expected = &unscale * eigen.recompose() * &unscale;
        assert!((dense(&projected) - expected).amax() < 1e-12);
    }
}

#[test]
fn a_rod_finds_its_equilibrium() {
    for solver in [BAND, gradients()] {
        let mut system = rod(20, &[0, 1, 2]);
        let u = bent(&system, 0.4);
        let mut newton = MixedNewton::new(&system, &solver, MixedNewtonOptions::new(1e-10));
        let (found, report) = newton.minimise(&mut system, &u).unwrap();
        assert!(report.converged(), "{report:?}");
        let (energy, gradient) = system.gradient(&found).unwrap();
        let largest = system.free_part(&gradient).iter().fold(0.0_f64, |largest, g| largest.max(g.abs()));
        assert!(largest < 1e-9, "{largest:e}");
        assert_eq!(energy.value, report.energy.value);
        assert!(energy.value < system.energy(&u).unwrap().value);
        // Fixed unknowns keep their bits.
        assert_eq!(found[..7], u[..7]);
        let [(_, counts)] = system.counts().collect::<Vec<_>>()[..] else { panic!("one term") };
        assert!(counts.value.evaluated > 0 && counts.hessian.evaluated >= 18 * report.iterations as u64);
        assert_eq!(counts.hessian.skipped, 0);
    }
}

#[test]
fn elements_of_fixed_unknowns_are_skipped() {
    let mut system = rod(5, &[0, 1, 2, 3, 4]);
    let u = bent(&system, 0.1);
    system.energy(&u).unwrap();
    let [(name, counts)] = system.counts().collect::<Vec<_>>()[..] else { panic!("one term") };
    assert_eq!((name, counts.value.evaluated, counts.value.skipped), ("rod", 2, 1));
}

/// Two springs of a common length between fixed ends and a free point, which a third one pulls.
fn common_length(fixed: bool) -> MixedSystem {
    let body = MixedBody::new(&[VECTOR; 4], 1.0).with_shared(SCALAR, Extremum::Minimum, 1.0);
    let mut body = body.with_fixed(&[0, 2, 3]).unwrap();
    if fixed {
        body = body.with_fixed_shared(&[0]).unwrap();
    }
    let terms = vec![
        MixedTerm::new("springs", vec![CommonLength { stiffness: 4.0 }; 2], &[[0, 1, 0], [1, 2, 0]]).unwrap(),
        MixedTerm::new("cost", vec![LengthCost { stiffness: 1.0, length: 2.0 }], &[[0]]).unwrap(),
        MixedTerm::of_points("pull", vec![Spring { stiffness: 0.5, length: 0.1 }], &[[3, 1]]).unwrap(),
    ];
    MixedSystem::new(body, terms).unwrap()
}

#[test]
fn a_shared_unknown_is_the_best_parameter() {
    let start = [0.0, 0.0, 0.0, 0.5, 0.9, 0.1, 1.2, 0.0, 0.0, 0.3, 1.4, 0.5, 1.0];
    let options = MixedNewtonOptions::new(1e-12);
    let solve = |mut system: MixedSystem, start: &[f64], solver: &KindSolver| {
        let (u, report) = MixedNewton::new(&system, solver, options).minimise(&mut system, start).unwrap();
        (u, report)
    };
    for solver in [BAND, gradients()] {
        let (best, report) = solve(common_length(false), &start, &solver);
        assert!(report.converged(), "{report:?}");
        let length = best[12];
        assert!((length - 1.0).abs() > 0.1, "the length moves: {length}");
        // The same problem with the length as a parameter.
        let energy = |length: f64| {
            let mut start = start;
            start[12] = length;
            let (u, report) = solve(common_length(true), &start, &BAND);
            assert!(report.converged() && u[12] == length);
            // The cost is not evaluated: its only unknown is fixed.
            (report.energy.value + 0.5 * (length - 2.0).powi(2), u)
        };
        let (least, with_parameter) = energy(length);
        assert!((least - report.energy.value).abs() < 1e-12);
        assert!(best.iter().zip(&with_parameter).all(|(a, b)| (a - b).abs() < 1e-9), "{best:?} {with_parameter:?}");
        assert!(energy(length + 1e-3).0 > least && energy(length - 1e-3).0 > least);
    }
}

/// An octahedron of springs, whose corners are held by springs to fixed points. Without compliance, its pressure is a
/// multiplier.
fn balloon(compliance: f64, prescribed: bool) -> (MixedSystem, Vec<f64>) {
    let corners: [[f64; 3]; 6] =
        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]];
    let extremum = if compliance == 0.0 { Extremum::Multiplier } else { Extremum::Maximum };
    let mut body = MixedBody::new(&[VECTOR; 12], 1.0).with_shared(SCALAR, extremum, 0.0);
    body = body.with_fixed(&[6, 7, 8, 9, 10, 11]).unwrap();
    if prescribed {
        body = body.with_fixed_shared(&[0]).unwrap();
    }
    let edges: Vec<[usize; 2]> =
        (0..6).flat_map(|i| (i + 1..6).filter(move |j| *j != i + 3).map(move |j| [i, j])).collect();
    let springs = vec![Spring { stiffness: 10.0, length: 1.2 }; edges.len()];
    let mut faces = Vec::new();
    for x in [0, 3] {
        for y in [1, 4] {
            for z in [2, 5] {
                let outward = (x == 3) ^ (y == 4) ^ (z == 5);
                faces.push(if outward { [x, z, y, 0] } else { [x, y, z, 0] });
            }
        }
    }
    let anchors: Vec<[usize; 2]> = (0..6).map(|i| [i, i + 6]).collect();
    let terms = vec![
        MixedTerm::of_points("edges", springs, &edges).unwrap(),
        MixedTerm::of_points("anchors", vec![Spring { stiffness: 0.1, length: 0.5 }; 6], &anchors).unwrap(),
        MixedTerm::new("faces", vec![Face { sign: 1.0 }; 8], &faces).unwrap(),
        MixedTerm::new("filling", vec![Filling { volume: 3.0, compliance }], &[[0]]).unwrap(),
    ];
    let system = MixedSystem::new(body, terms).unwrap();
    let near = corners.iter().enumerate().flat_map(|(i, corner)| corner.map(|c| 0.9 * c + 0.01 * i as f64));
    let far = corners.iter().flat_map(|corner| corner.map(|c| 2.0 * c));
    let u = near.chain(far).chain([0.0]).collect();
    (system, u)
}

/// Returns the volume of the octahedron.
fn volume(u: &[f64]) -> f64 {
    let (mut filled, _) = balloon(1.0, true);
    let mut at = u.to_vec();
    let mut energy = |p: f64| {
        at[36] = p;
        filled.energy(&at).unwrap().value
    };
    // The filling is not evaluated: its only unknown is fixed.
    (energy(-1.0) - energy(1.0)) / 2.0
}

#[test]
fn a_pressure_enforces_a_volume() {
    for compliance in [1.0, 1e-2, 1e-6] {
        for solver in [BAND, gradients()] {
            let (mut system, start) = balloon(compliance, false);
            let options = MixedNewtonOptions::new(1e-10);
            let (u, report) = MixedNewton::new(&system, &solver, options).minimise(&mut system, &start).unwrap();
            assert!(report.converged(), "{compliance} {solver:?}: {report:?}");
            // ∂U/∂p = 0 is 3 − V = κ p.
            let pressure = u[36];
            assert!((3.0 - volume(&u) - compliance * pressure).abs() < 1e-9, "V {}, p {pressure}", volume(&u));
            assert!(pressure > 0.5, "the balloon is inflated: {pressure}");
            // The same shape with the pressure as a parameter.
            let (mut with_parameter, _) = balloon(compliance, true);
            let (_, gradient) = with_parameter.gradient(&u).unwrap();
            let largest = with_parameter.free_part(&gradient).iter().fold(0.0_f64, |most, g| most.max(g.abs()));
            assert!(largest < 1e-7, "{largest:e}");
        }
    }
}

#[test]
fn a_multiplier_enforces_a_volume_without_compliance() {
    let find = |compliance: f64, size: f64, solver: &KindSolver| {
        let (mut system, mut start) = balloon(compliance, false);
        start[..18].iter_mut().for_each(|x| *x *= size);
        MixedNewton::new(&system, solver, MixedNewtonOptions::new(1e-10)).minimise(&mut system, &start)
    };
    let (expected, report) = find(1e-6, 1.0, &BAND).unwrap();
    assert!(report.converged(), "{report:?}");
    // Also from far away, at an eighth and at eight times the volume.
    for size in [1.0, 0.5, 2.0] {
        let (u, report) = find(0.0, size, &BAND).unwrap();
        assert!(report.converged(), "{size}: {report:?}");
        assert!((volume(&u) - 3.0).abs() < 1e-12, "{size}: {}", volume(&u));
        // The compliance κ = 10⁻⁶ moves the volume by κ p.
        let furthest = u.iter().zip(&expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(furthest < 1e-4, "{size}: {furthest:e}");
    }
    let refused = find(0.0, 1.0, &gradients());
    assert!(matches!(refused, Err(MixedNewtonError::Linear(BorderedError::Multiplier))), "{refused:?}");
}

#[test]
fn an_equilibrium_that_is_not_stable_is_called_a_saddle() {
    // A spring under compression in a straight line, with its middle point free to buckle.
    let body = MixedBody::new(&[VECTOR; 3], 1.0).with_fixed(&[0, 2]).unwrap();
    let springs = vec![Spring { stiffness: 1.0, length: 1.0 }; 2];
    let mut system =
        MixedSystem::new(body, vec![MixedTerm::of_points("springs", springs, &[[0, 1], [1, 2]]).unwrap()]).unwrap();
    let u = [0.0, 0.0, 0.0, 0.8, 0.0, 0.0, 1.6, 0.0, 0.0];
    let mut newton = MixedNewton::new(&system, &BAND, MixedNewtonOptions::new(1e-10));
    let (found, report) = newton.minimise(&mut system, &u).unwrap();
    assert_eq!(report.stopped, MixedStop::Saddle);
    assert_eq!(found, u);
}

#[test]
fn a_singular_projected_hessian_is_damped() {
    // A single compressed spring: clamped, its Hessian has rank 1.
    let body = MixedBody::new(&[VECTOR; 2], 1.0).with_fixed(&[0]).unwrap();
    let spring = MixedTerm::of_points("spring", vec![Spring { stiffness: 100.0, length: 1.0 }], &[[0, 1]]);
    let weight = MixedTerm::of_points("weight", vec![energy_elements::Gravity::new(2.0, [0.0, 0.0, -9.81])], &[[1]]);
    let mut system = MixedSystem::new(body, vec![spring.unwrap(), weight.unwrap()]).unwrap();
    for solver in [BAND, gradients()] {
        let mut newton = MixedNewton::new(&system, &solver, MixedNewtonOptions::new(1e-12));
        let (u, report) = newton.minimise(&mut system, &[0.0, 0.0, 0.0, 0.3, 0.0, -0.9]).unwrap();
        assert!(report.converged() && report.projected > 0, "{report:?}");
        assert!((u[5] + 1.0 + 2.0 * 9.81 / 100.0).abs() < 1e-12);
    }
}

/// A rigid body of 1 kg whose hinge at (0, 0, l) in its frame is tied to the origin by a stiff spring. It hangs below.
fn pendulum(lever: f64, scheme: MixedScheme, tensor: [f64; 3]) -> MixedIntegrator {
    let body = MixedBody::new(&[UnknownKind::Rotation, VECTOR], lever);
    let terms = vec![
        MixedTerm::new("hinge", vec![Joint { stiffness: 1e7, lever }], &[[0, 1]]).unwrap(),
        MixedTerm::of_points("weight", vec![energy_elements::Gravity::new(1.0, [0.0, 0.0, -9.81])], &[[1]]).unwrap(),
    ];
    let system = MixedSystem::new(body, terms).unwrap();
    let inertia = vec![Inertia::Tensor(diagonal(tensor)), Inertia::Mass(1.0)];
    MixedIntegrator::new(system, inertia, scheme, &BAND, MixedNewtonOptions::new(1e-11)).unwrap()
}

fn diagonal([a, b, c]: [f64; 3]) -> [[f64; 3]; 3] {
    [[a, 0.0, 0.0], [0.0, b, 0.0], [0.0, 0.0, c]]
}

/// Returns the complete elliptic integral K of a modulus, by the arithmetic-geometric mean.
fn complete_elliptic(modulus: f64) -> f64 {
    let (mut a, mut b) = (1.0, (1.0 - modulus * modulus).sqrt());
    while (a - b).abs() > 1e-15 {
        (a, b) = (0.5 * (a + b), (a * b).sqrt());
    }
    std::f64::consts::FRAC_PI_2 / a
}

/// Returns the period of a pendulum that is released at an angle from below.
fn period(angle: f64, step: f64) -> (f64, f64) {
    let (lever, tensor) = (0.5, [0.02, 0.03, 0.01]);
    let mut integrator = pendulum(lever, MixedScheme::ImplicitMidpoint, tensor);
    let (sine, cosine) = (0.5 * angle).sin_cos();
    // Turned about x: the centre is at −R (0, 0, l).
    let u = vec![cosine, sine, 0.0, 0.0, 0.0, lever * angle.sin(), -lever * angle.cos()];
    let mut state = MixedState::at_rest(integrator.system(), u);
    let total = tensor[0] + lever * lever;
    let exact = 4.0 * (total / (9.81 * lever)).sqrt() * complete_elliptic((0.5 * angle).sin());
    // Passes below at a quarter and at three quarters of the period.
    let (mut time, mut passes) = (0.0, Vec::new());
    while passes.len() < 2 {
        let before = state.u[5];
        integrator.step(&mut state, step).unwrap();
        if before * state.u[5] <= 0.0 {
            passes.push(time + step * before / (before - state.u[5]));
        }
        time += step;
    }
    (2.0 * (passes[1] - passes[0]), exact)
}

#[test]
fn a_pendulum_swings_with_its_period() {
    let angle = 1.2;
    let [coarse, fine] = [4e-3, 2e-3].map(|step| {
        let (found, exact) = period(angle, step);
        (found / exact - 1.0).abs()
    });
    assert!(fine < 2e-5, "{fine:e}");
    assert!((3.0..5.5).contains(&(coarse / fine)), "second order: {coarse:e}, {fine:e}");
}

/// Returns the angular momentum of a free body and its energy.
fn spin(state: &MixedState, tensor: [f64; 3]) -> ([f64; 3], f64) {
    let q = nalgebra::UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(
        state.u[0], state.u[1], state.u[2], state.u[3],
    ));
    let r = q.to_rotation_matrix();
    let rate = nalgebra::Vector3::new(state.rates[0], state.rates[1], state.rates[2]);
    let own = r.inverse() * rate;
    let momentum = r * own.component_mul(&nalgebra::Vector3::from(tensor));
    (momentum.into(), 0.5 * rate.dot(&momentum))
}

/// A free rigid body that spins about an axis close to its middle one, after one second.
fn tumbled(scheme: MixedScheme, step: f64) -> (MixedState, f64) {
    let tensor = [1.0, 2.0, 3.0];
    let body = MixedBody::new(&[UnknownKind::Rotation], 1.0);
    let system = MixedSystem::new(body, Vec::new()).unwrap();
    let inertia = vec![Inertia::Tensor(diagonal(tensor))];
    let options = MixedNewtonOptions::new(1e-13);
    let mut integrator = MixedIntegrator::new(system, inertia, scheme, &BAND, options).unwrap();
    let mut state = MixedState { u: vec![1.0, 0.0, 0.0, 0.0], rates: vec![0.3, 4.0, 0.1] };
    let (momentum, _) = spin(&state, tensor);
    let mut worst = 0.0_f64;
    for _ in 0..(1.0 / step).round() as usize {
        integrator.step(&mut state, step).unwrap();
        let (now, _) = spin(&state, tensor);
        worst = (0..3).map(|i| (now[i] - momentum[i]).abs()).fold(worst, f64::max);
    }
    (state, worst)
}

#[test]
fn a_free_body_keeps_its_angular_momentum() {
    for scheme in [MixedScheme::ImplicitEuler, MixedScheme::ImplicitMidpoint] {
        let fine = tumbled(scheme, 1.0 / 3200.0).0;
        let error = |step: f64| {
            let (state, drift) = tumbled(scheme, step);
            assert!(drift < 1e-11, "{scheme:?}: {drift:e}");
            let near = |sign: f64| (0..4).map(|i| (state.u[i] - sign * fine.u[i]).abs()).fold(0.0, f64::max);
            near(1.0).min(near(-1.0))
        };
        let (coarse, middle) = (error(0.02), error(0.01));
        assert!(coarse < 0.05, "{scheme:?}: {coarse}");
        assert!((3.5..4.5).contains(&(coarse / middle)), "{scheme:?}: second order, {coarse:e}, {middle:e}");
    }
}

/// A point on a string that relaxes, with a fixed end.
fn relaxing() -> MixedIntegrator {
    let body = MixedBody::new(&[VECTOR, SCALAR, VECTOR], 0.1).with_fixed(&[0, 1]).unwrap();
    let string = MixedTerm::with_state("string", vec![Relaxing { stiffness: 30.0, relaxed: 1.0 }], &[[0, 1, 2]]);
    let weight = MixedTerm::of_points("weight", vec![energy_elements::Gravity::new(1.0, [0.0, 0.0, -9.81])], &[[2]]);
    let system = MixedSystem::new(body, vec![string.unwrap(), weight.unwrap()]).unwrap();
    let inertia = vec![Inertia::None, Inertia::None, Inertia::Mass(1.0)];
    let options = MixedNewtonOptions::new(1e-10);
    MixedIntegrator::new(system, inertia, MixedScheme::ImplicitEuler, &BAND, options).unwrap()
}

#[test]
fn states_advance_with_accepted_steps_alone() {
    let mut integrator = relaxing();
    let start = vec![0.0, 0.0, 0.0, 0.0, 0.1, 0.0, -1.0];
    let mut state = MixedState::at_rest(integrator.system(), start);
    assert_eq!(integrator.system().states().by_term, [vec![1.0], vec![]]);
    integrator.step(&mut state, 0.01).unwrap();
    let length = (4..7).map(|i| state.u[i] * state.u[i]).sum::<f64>().sqrt();
    let relaxed = integrator.system().states().by_term[0][0];
    assert_eq!(relaxed, 0.5 * (1.0 + length));
    // The next step is that of the new state.
    let saved = (integrator.system().states(), state.clone());
    integrator.step(&mut state, 0.01).unwrap();
    let first = (integrator.system().states(), state.clone());
    assert_ne!(first.0, saved.0);
    integrator.system_mut().restore(&saved.0).unwrap();
    state = saved.1.clone();
    integrator.step(&mut state, 0.01).unwrap();
    assert_eq!((integrator.system().states(), state.clone()), first, "a restored state gives the same bits");
    // Steps that fail change nothing.
    let before = (integrator.system().states(), state.clone());
    assert_eq!(integrator.step(&mut state, -1.0), Err(MixedNewtonError::WrongTimeStep(-1.0)));
    state.rates[4] = f64::NAN;
    assert!(matches!(integrator.step(&mut state, 0.01), Err(MixedNewtonError::Evaluation(_))));
    state.rates[4] = before.1.rates[4];
    assert_eq!((integrator.system().states(), state), before);
    let found = energy_solve::ElementStates { by_term: vec![vec![1.0, 2.0], vec![]] };
    let refused = integrator.system_mut().restore(&found);
    assert_eq!(refused, Err(MixedError::WrongStates { term: "string".into(), expected: 1, found: 2 }));
}

#[test]
fn a_step_that_does_not_converge_changes_nothing() {
    let system = rod(6, &[0, 1, 2]);
    let start = bent(&system, 0.4);
    let inertia = (0..11).map(|i| Inertia::Mass(if i % 2 == 0 { 1.0 } else { 0.01 })).collect();
    let options = MixedNewtonOptions::new(1e-12).with_iteration_limit(1);
    let mut integrator = MixedIntegrator::new(system, inertia, MixedScheme::ImplicitEuler, &BAND, options).unwrap();
    let mut state = MixedState::at_rest(integrator.system(), start);
    let before = state.clone();
    let outcome = integrator.step(&mut state, 1.0);
    assert!(matches!(outcome, Err(MixedNewtonError::NotConverged(_))), "{outcome:?}");
    assert_eq!(state, before);
}

#[test]
fn stencils_that_do_not_fit_are_errors() {
    let body = || {
        MixedBody::new(&[VECTOR, SCALAR, UnknownKind::Rotation, VECTOR, SCALAR, VECTOR], 1.0).with_shared(
            SCALAR,
            Extremum::Minimum,
            1.0,
        )
    };
    let place = |term: Result<MixedTerm, MixedError>| {
        MixedSystem::new(body(), vec![term.unwrap()]).map(|_| ()).expect_err("the stencil is wrong").to_string()
    };
    let rod = || vec![Rod { stretch: 1.0, length: 1.0, bend: 1.0, twist: 1.0, rest: 0.0 }];
    let joint = || vec![Joint { stiffness: 1.0, lever: 1.0 }];
    let too_few = place(MixedTerm::new("rod", rod(), &[[0, 3, 5, 1]]));
    assert_eq!(
        too_few,
        "rod: element 0 has 11 numbers in 5 declared unknowns, and its stencil lists 4 unknowns that do not have as many"
    );
    assert!(place(MixedTerm::new("rod", rod(), &[[0, 3, 5, 1, 4, 2]])).contains("lists 6 unknowns that"));
    let wrong = place(MixedTerm::new("rod", rod(), &[[0, 3, 2, 1, 4]]));
    assert_eq!(wrong, "rod: element 0 declares x2 as 3 numbers, but unknown 2 is a rotation");
    assert!(place(MixedTerm::new("joint", joint(), &[[0, 3]])).contains("declares q as a rotation"));
    assert!(place(MixedTerm::new("rod", rod(), &[[0, 3, 5, 1, 6]])).contains("names unknown 6, but there are only 6"));
    assert!(place(MixedTerm::new("rod", rod(), &[[0, 3, 5, 1, 1]])).contains("names unknown 1 twice"));
    let shared = place(MixedTerm::new("lengths", vec![CommonLength { stiffness: 1.0 }], &[[0, 3, 1]]));
    assert_eq!(shared, "lengths: element 0 names shared unknown 1, but there are only 1");
    let spring = Spring { stiffness: 1.0, length: 1.0 };
    assert!(place(MixedTerm::of_points("springs", vec![spring], &[[0, 2]])).contains("is a rotation"));
    assert!(place(MixedTerm::new("joint", joint(), &[[]])).contains("lists 0 unknowns that"));
    let uneven = MixedTerm::new("rod", rod(), &[[0, 3, 5, 1, 4]; 2]).unwrap_err();
    assert_eq!(uneven.to_string(), "rod: expected one stencil per element, got 2 stencils for 1 elements");
    assert!(body().with_fixed(&[6]).is_err() && body().with_fixed_shared(&[1]).is_err());
}

#[test]
fn configurations_that_do_not_fit_are_errors() {
    let (mut system, u) = everything();
    let error = system.energy(&u[1..]).unwrap_err();
    assert!(matches!(error, MixedError::WrongLength { .. }), "{error}");
    let mut wrong = u.clone();
    wrong[3] = f64::NAN;
    assert!(matches!(system.gradient(&wrong), Err(MixedError::NonFinite { index: 3, .. })));
    let mut wrong = u.clone();
    let first = system.body().first_number(2);
    wrong[first..first + 4].iter_mut().for_each(|c| *c *= 1.001);
    assert!(matches!(system.energy(&wrong), Err(MixedError::NotUnit { unknown: 2, .. })));
    for length in [0.0, -1.0, f64::NAN] {
        let outcome = MixedSystem::new(MixedBody::new(&[VECTOR, SCALAR], length), Vec::new());
        assert!(matches!(outcome, Err(MixedError::WrongScale { unknown: 1, .. })));
    }
    let system = MixedSystem::new(MixedBody::new(&[VECTOR, UnknownKind::Rotation], 1.0), Vec::new()).unwrap();
    let options = MixedNewtonOptions::new(1e-9);
    let flat = diagonal([1.0, 1.0, 0.0]);
    let outcome = MixedIntegrator::new(
        system,
        vec![Inertia::Mass(1.0), Inertia::Tensor(flat)],
        MixedScheme::ImplicitEuler,
        &BAND,
        options,
    );
    assert!(matches!(outcome, Err(MixedError::WrongInertia { unknown: 1, .. })));
}
