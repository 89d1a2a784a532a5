use energy_dsl::Vector3;
use proptest::prelude::*;
use proptest::strategy::ValueTree;
use proptest::test_runner::TestRunner;

use super::*;
use crate::geometry::{add_scaled, subtract};

/// Two triangles without a common vertex.
fn two_triangles() -> CollisionMesh {
    CollisionMesh::new(6, &[[0, 1, 2], [3, 4, 5]], &[], &[])
}

/// All pairs of the two triangles.
fn pairs() -> Vec<Pair> {
    all_pairs(&two_triangles())
}

fn distance(x: &[Vector3<f64>]) -> f64 {
    pairs().iter().map(|pair| Closest::of(pair, &pair.corners(x)).distance).fold(f64::INFINITY, f64::min)
}

pub(super) fn at(from: &[Vector3<f64>], to: &[Vector3<f64>], time: f64) -> Vec<Vector3<f64>> {
    from.iter().zip(to).map(|(from, to)| add_scaled(*from, time, subtract(*to, *from))).collect()
}

/// The part of a move that is safe for all pairs.
fn safe_part(from: &[Vector3<f64>], to: &[Vector3<f64>], thickness: f64) -> f64 {
    let step = Move::new(from, to);
    let pairs = pairs();
    (0..pairs.len()).fold(1.0, |part, number| safe_part_of(&step, &pairs, number, thickness, part).min(part))
}

/// The part of a move that is safe for one of some pairs.
fn safe_part_of(step: &Move<'_>, pairs: &[Pair], number: usize, thickness: f64, wanted: f64) -> f64 {
    let clearance = Clearance { thickness, reach: f64::INFINITY, is_plane: false };
    let doubtful = step.doubtful(pairs, &[(number, clearance)]);
    if doubtful.is_empty() { 1.0 } else { step.safe_part(&pairs[number], clearance, wanted) }
}

fn vector(size: f64) -> impl Strategy<Value = Vector3<f64>> {
    prop::array::uniform3(-size..size)
}

/// A corner on a coarse grid: aligned edges, coplanar triangles and coincident coordinates are common.
fn on_grid() -> impl Strategy<Value = Vector3<f64>> {
    prop::array::uniform3((-4_i32..=4).prop_map(|number| 0.01 * f64::from(number)))
}

/// The position of a corner, and its displacement relative to the triangle.
type Corner = (Vector3<f64>, Vector3<f64>);

/// Positions of the six corners before and after an impact. The triangles fly at each other with up to 100 m/s during
/// 10 ms, and their corners spread with up to 10 m/s.
fn impact() -> impl Strategy<Value = [Vec<Vector3<f64>>; 2]> {
    let corner = prop_oneof![vector(0.04), on_grid()];
    let spread = prop_oneof![Just([0.0; 3]), vector(0.1)];
    let start = prop::collection::vec((corner, spread), 6);
    (start, vector(1.0), prop_oneof![Just(0.0), Just(1e-3 + 1e-6), 0.0..0.5], 0.0..1.0_f64).prop_map(
        |(corners, velocity, gap, speed)| {
            // Start on the way back, so that the triangles meet.
            let length = subtract(velocity, [0.0; 3]).iter().map(|c| c * c).sum::<f64>().sqrt().max(1e-3);
            let direction = velocity.map(|component| component / length);
            let velocity = direction.map(|component| -speed * component);
            let position = |(number, &(corner, _)): (usize, &Corner)| {
                if number < 3 { corner } else { add_scaled(corner, gap, direction) }
            };
            let from: Vec<_> = corners.iter().enumerate().map(position).collect();
            let moved = |(number, (from, (_, spread))): (usize, (&Vector3<f64>, &Corner))| {
                add_scaled(add_scaled(*from, 1.0, *spread), if number < 3 { 0.0 } else { 1.0 }, velocity)
            };
            let to = from.iter().zip(&corners).enumerate().map(moved).collect();
            [from, to]
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 10_000, max_global_rejects: 100_000, ..ProptestConfig::default() })]

    /// Pairs that stay beyond a distance do so.
    #[test]
    fn pairs_beyond_reach_stay_there([from, to] in impact(), reach in 0.0..0.05) {
        let step = Move::new(&from, &to);
        for pair in pairs() {
            let distance = |time: f64| Closest::of(&pair, &pair.corners(&at(&from, &to, time))).distance;
            if step.stays_beyond(reach, &pair, Closest::of(&pair, &pair.corners(&from)).separation) {
                for sample in 0..=10 {
                    prop_assert!(distance(0.1 * f64::from(sample)) > reach, "{:?} {}", pair, sample);
                }
            }
        }
    }

    /// Lanes give the bits of single pairs.
    #[test]
    fn lanes_measure_what_single_pairs_are([x, _] in impact(), half in 0.0..0.02) {
        let (pairs, mut measured, mut separations) = (pairs(), Measured::default(), Separations::default());
        let measured = measured.at(&pairs, &x, pairs.len()).next().expect("one part").measured();
        separations.measure(&pairs, &x, &[half; 6], 2);
        let mut near = separations.near.iter().peekable();
        for (number, pair) in pairs.iter().enumerate() {
            let closest = Closest::of(pair, &pair.corners(&x));
            prop_assert_eq!(measured.closest(number), closest);
            prop_assert_eq!(separations.all[number], closest.separation);
            let is_near = near.next_if(|near| near.number == number);
            prop_assert_eq!(is_near.map(|near| near.closest), (closest.separation <= 2.0 * half).then_some(closest));
        }
    }

    /// Pairs that are not measured again keep a lower bound of their distance, and are out of reach.
    #[test]
    fn separations_stay_lower_bounds(
        [x, y] in impact(),
        half in 0.0..0.02,
        ends in prop::collection::vec(0.0..1.0, 6),
    ) {
        let (pairs, mut separations) = (pairs(), Separations::default());
        for time in ends {
            let state = at(&x, &y, 0.02 * time);
            separations.measure(&pairs, &state, &[half; 6], 1);
            let mut fresh = Separations::default();
            fresh.measure(&pairs, &state, &[half; 6], 1);
            for (bound, separation) in separations.all.iter().zip(&fresh.all) {
                prop_assert!(bound <= separation, "{} {}", bound, separation);
                prop_assert!(bound == separation || *bound > 2.0 * half, "{} {}", bound, separation);
            }
            let near = |all: &Separations| -> Vec<_> {
                all.near.iter().map(|near| (near.number, near.closest)).collect()
            };
            prop_assert_eq!(near(&separations), near(&fresh));
        }
    }

    /// No impact passes, by the exact test along the accepted move.
    #[test]
    fn no_impact_passes([from, to] in impact()) {
        const THICKNESS: f64 = 1e-3;
        let mesh = two_triangles();
        let start = distance(&from);
        prop_assume!(start > THICKNESS && crossings(&mesh, &from).is_empty());
        let part = safe_part(&from, &to, THICKNESS);
        prop_assert!(part > 0.0 && part <= 1.0, "{part}");
        for sample in 0..=100 {
            let x = at(&from, &to, part * f64::from(sample) / 100.0);
            prop_assert!(crossings(&mesh, &x).is_empty(), "sample {sample} of {part}");
            prop_assert!(distance(&x) > THICKNESS, "sample {sample} of {part}: {}", distance(&x));
        }
    }
}

/// The certificate gives up little: nearly all cut moves end where most of the pair's gap is used up. Others slide past
/// each other, where normals turn fast.
#[test]
fn moves_are_cut_only_near_a_contact() {
    const THICKNESS: f64 = 1e-3;
    let mut runner = TestRunner::deterministic();
    let (mut cut, mut early) = (0, 0);
    for _ in 0..10_000 {
        let [from, to] = impact().new_tree(&mut runner).unwrap().current();
        let (step, pairs) = (Move::new(&from, &to), pairs());
        for (number, pair) in pairs.iter().enumerate() {
            let part = safe_part_of(&step, &pairs, number, THICKNESS, 1.0);
            let gap = |time| Closest::of(pair, &pair.corners(&at(&from, &to, time))).distance - THICKNESS;
            if part < 1.0 && gap(0.0) > 0.0 {
                cut += 1;
                early += u32::from(gap(part) > 0.2 * gap(0.0));
            }
        }
    }
    assert!(cut > 10_000 && f64::from(early) < 0.01 * f64::from(cut), "{early} of {cut}");
}

/// A sheet of cells × cells squares of 1 cm, whose corners are displaced by random vectors.
fn sheet(cells: usize) -> (CollisionMesh, Vec<Vector3<f64>>) {
    let corner = |i: usize, j: usize| i * (cells + 1) + j;
    let squares = (0..cells).flat_map(|i| (0..cells).map(move |j| (i, j)));
    let halves = |(i, j): (usize, usize)| {
        let [a, b, c, d] = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
        [[a, b, c], [a, c, d]]
    };
    let triangles: Vec<_> = squares.flat_map(halves).collect();
    let position = |number: usize| [0.01 * (number / (cells + 1)) as f64, 0.01 * (number % (cells + 1)) as f64, 0.0];
    let vertices = (cells + 1) * (cells + 1);
    (CollisionMesh::new(vertices, &triangles, &[], &[]), (0..vertices).map(position).collect())
}

#[test]
fn a_flat_sheet_has_no_crossings_and_a_folded_one_has() {
    let (mesh, flat) = sheet(6);
    assert_eq!(crossings(&mesh, &flat), []);
    // The outer column is turned over onto its neighbours, first next to them and then into their plane.
    let folded = |height: f64| {
        let turned = |(number, x): (usize, &Vector3<f64>)| {
            if number / 7 == 6 { [0.043, x[1] + 0.001, height] } else { *x }
        };
        flat.iter().enumerate().map(turned).collect::<Vec<_>>()
    };
    assert_eq!(crossings(&mesh, &folded(1e-9)), []);
    assert!(crossings(&mesh, &folded(-1e-9)).is_empty(), "the other side is as good");
    assert!(!crossings(&mesh, &folded(0.0)).is_empty(), "touching counts");
    let mut pierced = flat.clone();
    pierced[0] = [0.035, 0.034, 0.01];
    pierced[1] = [0.035, 0.033, -0.01];
    assert!(!crossings(&mesh, &pierced).is_empty());
}

#[test]
fn edges_may_start_at_a_corner_but_not_run_into_the_triangle() {
    let mesh = CollisionMesh::new(4, &[[0, 1, 2]], &[[0, 3]], &[]);
    let count = |end: Vector3<f64>| crossings(&mesh, &[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], end]).len();
    assert_eq!(count([0.2, 0.2, 1e-200]), 0);
    assert_eq!(count([0.2, 0.2, 0.0]), 1);
    assert_eq!(count([2.0, 2.0, 0.0]), 1);
    assert_eq!(count([0.5, 0.0, 0.0]), 1, "along a side");
    assert_eq!(count([-0.2, -0.2, 0.0]), 0);
    assert_eq!(count([-0.2, 0.9, 0.0]), 0);
    let on_line = |end: f64| {
        let x = [0.0, 1.0, 2.0, end].map(|x| [x, 0.0, 0.0]);
        crossings(&mesh, &x).len()
    };
    assert_eq!([on_line(-1.0), on_line(0.5), on_line(3.0)], [0, 1, 1], "a triangle without area");
}

#[test]
fn sewn_vertices_count_as_one() {
    let x = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.1, 0.1, -1.0], [0.1, 0.1, 1.0]];
    let with = |sewn: &[[usize; 2]]| crossings(&CollisionMesh::new(5, &[[0, 1, 2]], &[[3, 4]], sewn), &x).len();
    assert_eq!((with(&[]), with(&[[4, 2]])), (1, 0));
}

const REACH: f64 = 3e-3;

/// Returns a pair within reach at x that a neighbourhood misses, and its distance.
fn missing(mesh: &CollisionMesh, neighbourhood: &Neighbourhood, x: &[Vector3<f64>]) -> Option<(Pair, f64)> {
    let is_candidate = |pair: &Pair| {
        neighbourhood.candidates().pairs().contains(pair) || neighbourhood.escaped().pairs().contains(pair)
    };
    let distances = all_pairs(mesh).into_iter().map(|pair| (pair, Closest::of(&pair, &pair.corners(x)).distance));
    distances.filter(|(_, distance)| *distance <= REACH).find(|(pair, _)| !is_candidate(pair))
}

/// All features of a sheet collide within a reach.
fn rules(reach: f64) -> Rules {
    Rules { halves: vec![0.5 * reach; 25], is_free: vec![true; 25], with_itself: true, ..Rules::default() }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// No pair within reach is missing on a move that all vertices follow, or in the balls where it ends.
    #[test]
    fn a_move_of_all_vertices_misses_no_pair(
        offsets in prop::collection::vec((vector(0.012), vector(0.01), vector(0.57)), 25),
        drift in vector(1.0),
        (instant, end) in (0.0..1.0_f64, 0.0..1.0_f64),
    ) {
        let (mesh, flat) = sheet(4);
        let from: Vec<_> = flat.iter().zip(&offsets).map(|(x, (offset, ..))| add_scaled(*x, 1.0, *offset)).collect();
        let to: Vec<_> = from.iter().zip(&offsets).map(|(x, (_, move_by, _))| {
            add_scaled(add_scaled(*x, 1.0, *move_by), 1.0, drift)
        }).collect();
        let mut search = Search::new(&mesh, &flat, rules(REACH));
        let mut neighbourhood = Neighbourhood::default();
        prop_assert!(!neighbourhood.covers(&from));
        prop_assert!(neighbourhood.search_along(&mut search, &mesh, &Move::new(&from, &to), |_| 1e-3, [2e-4, 4e-3]));
        let found = neighbourhood.escaped().pairs();
        prop_assert!(found.is_sorted() && found.windows(2).all(|two| two[0] != two[1]));
        prop_assert_eq!(missing(&mesh, &neighbourhood, &at(&from, &to, instant)), None);

        let x = at(&from, &to, end);
        prop_assert!(neighbourhood.covers(&x));
        neighbourhood.refit(&search, &x);
        prop_assert!(neighbourhood.escaped().pairs().is_empty());
        // Anywhere in the balls.
        let moved: Vec<_> = x.iter().zip(&offsets).map(|(x, (.., offset))| add_scaled(*x, 5e-4, *offset)).collect();
        prop_assert_eq!(missing(&mesh, &neighbourhood, &x), None);
        prop_assert_eq!(missing(&mesh, &neighbourhood, &moved), None);
    }

    /// Moves on which a few vertices escape from their balls miss no pair, one after the other, whether they are made
    /// or not.
    #[test]
    fn moves_of_a_few_vertices_miss_no_pair(
        offsets in prop::collection::vec((vector(0.012), vector(0.02)), 25),
        moves in prop::collection::vec((prop::collection::vec((0..25_usize, vector(0.02)), 1..4), 0.0..1.0_f64), 1..4),
    ) {
        let (mesh, flat) = sheet(4);
        let from: Vec<_> = flat.iter().zip(&offsets).map(|(x, (offset, _))| add_scaled(*x, 1.0, *offset)).collect();
        let to: Vec<_> = from.iter().zip(&offsets).map(|(x, (_, move_by))| add_scaled(*x, 1.0, *move_by)).collect();
        let mut search = Search::new(&mesh, &flat, rules(REACH));
        let mut neighbourhood = Neighbourhood::default();
        // All vertices move and stop half the way.
        neighbourhood.search_along(&mut search, &mesh, &Move::new(&from, &to), |_| 5e-3, [1e-3, 8e-3]);
        let mut x = at(&from, &to, 0.5);
        neighbourhood.refit(&search, &x);
        for (escapes, part) in &moves {
            let mut to = x.clone();
            for &(vertex, by) in escapes {
                to[vertex] = add_scaled(x[vertex], 1.0, by);
            }
            neighbourhood.search_along(&mut search, &mesh, &Move::new(&x, &to), |_| 1e-3, [2e-4, 4e-3]);
            for instant in [0.0, 0.3, 0.7, 1.0] {
                prop_assert_eq!(missing(&mesh, &neighbourhood, &at(&x, &to, instant)), None);
            }
            // Short parts stand for moves that are not made.
            if *part > 0.3 {
                x = at(&x, &to, *part);
                prop_assert!(neighbourhood.covers(&x));
                neighbourhood.refit(&search, &x);
                prop_assert_eq!(missing(&mesh, &neighbourhood, &x), None);
            }
        }
    }

    /// States off the path of an escaped vertex are not covered.
    #[test]
    fn only_states_on_the_path_are_covered(move_by in vector(0.02), aside in vector(1e-3), part in 0.0..1.0_f64) {
        let (mesh, x) = sheet(4);
        let mut search = Search::new(&mesh, &x, rules(REACH));
        let mut neighbourhood = Neighbourhood::default();
        neighbourhood.search_along(&mut search, &mesh, &Move::new(&x, &x), |_| 1e-4, [1e-4; 2]);
        neighbourhood.refit(&search, &x);
        let moved = |by: Vector3<f64>| {
            let mut moved = x.clone();
            moved[7] = add_scaled(x[7], 1.0, by);
            moved
        };
        let to = moved(move_by);
        neighbourhood.search_along(&mut search, &mesh, &Move::new(&x, &to), |_| 1e-4, [1e-4; 2]);
        prop_assert!(neighbourhood.covers(&at(&x, &to, part)));
        let beside = moved(add_scaled(aside, part, move_by));
        let along = crate::geometry::dot(aside, move_by).powi(2);
        let square = |v: Vector3<f64>| crate::geometry::dot(v, v);
        let is_beside = square(aside) > 1e-7 && along < 0.5 * square(aside) * square(move_by);
        prop_assert!(!is_beside || part < 0.1 || square(move_by) < 1e-5 || !neighbourhood.covers(&beside));
    }

    /// The closest points are those of a dense search, and the weights reproduce the distance.
    #[test]
    fn closest_points_are_closest(corners in prop::array::uniform4(prop_oneof![vector(1.0), on_grid()])) {
        for kind in [PairKind::PointTriangle, PairKind::EdgeEdge] {
            let pair = Pair { kind, features: [0, 1], vertices: [0, 1, 2, 3] };
            let closest = Closest::of(&pair, &corners);
            prop_assert!(closest.weights.iter().sum::<f64>().abs() < 1e-14);
            let below = closest.distance - closest.separation;
            prop_assert!(below > -1e-12 && (below < 1e-7 || closest.distance < 1e-6), "{:?}", closest);
            const STEPS: i32 = 12;
            for i in 0..=STEPS {
                for j in 0..=STEPS {
                    let [s, t] = [i, j].map(|number| f64::from(number) / f64::from(STEPS));
                    let weights = match kind {
                        PairKind::EdgeEdge => [1.0 - s, s, t - 1.0, -t],
                        PairKind::PointTriangle if i + j <= STEPS => [1.0, s + t - 1.0, -s, -t],
                        PairKind::PointTriangle => continue,
                    };
                    let apart = (0..4).fold([0.0; 3], |sum, k| add_scaled(sum, weights[k], corners[k]));
                    let distance = crate::geometry::norm(apart);
                    prop_assert!(closest.distance <= distance + 1e-9, "{:?}: {} {}", kind, closest.distance, distance);
                }
            }
        }
    }
}

/// All pairs of a mesh that share no vertex.
pub(super) fn all_pairs(mesh: &CollisionMesh) -> Vec<Pair> {
    let mut all = Vec::new();
    for (point, &p) in mesh.points().iter().enumerate() {
        for (number, corners) in mesh.triangles().iter().enumerate().filter(|(_, corners)| !corners.contains(&p)) {
            let ([a, b, c], features) = (*corners, [point, number].map(energy_solve::index));
            all.push(Pair { kind: PairKind::PointTriangle, features, vertices: [p, a, b, c] });
        }
    }
    for (number, &[a, b]) in mesh.edges().iter().enumerate() {
        for (other, &[c, d]) in mesh.edges().iter().enumerate().skip(number + 1) {
            if ![c, d].iter().any(|end| [a, b].contains(end)) {
                let features = [number, other].map(energy_solve::index);
                all.push(Pair { kind: PairKind::EdgeEdge, features, vertices: [a, b, c, d] });
            }
        }
    }
    all
}
