use energy_dsl::{Potential, Vector3};
use energy_elements::{Distance, EdgeEdgeDistance, PointEdgeDistance, PointTriangleDistance};
use energy_solve::{Contact, DofMap, Pressed, Presser, Resistance, SlidingStiffness};
use proptest::prelude::*;

use super::law::Law;
use super::*;
use crate::Coulomb;
use crate::collision::PairKind;
use crate::geometry::{add_scaled, cross, dot, norm, subtract};

const THICKNESS: f64 = 1e-3;
const GAP: f64 = 2e-3;

/// Two triangles, the second above the first.
fn contact(x: &[Vector3<f64>]) -> BarrierContact {
    let mesh = CollisionMesh::new(6, &[[0, 1, 2], [3, 4, 5]], &[], &[]);
    let mut contact = BarrierContact::new(mesh, x, vec![true; 6], vec![0.5 * THICKNESS; 6], GAP).unwrap();
    contact.begin_step(x);
    contact
}

/// The step that has begun.
fn step(contact: &mut BarrierContact) -> BarrierStep<'_> {
    BarrierStep { contact }
}

/// The resistance of free vertices.
fn resistance(vertices: usize) -> Resistance {
    let block = [[50.0, 0.0, 0.0], [0.0, 50.0, 0.0], [0.0, 0.0, 50.0]];
    Resistance::new(&DofMap::new(&vec![false; vertices]), vec![block; vertices], vec![1.0; vertices])
}

/// Updates the active set of a step.
fn update(contact: &mut BarrierContact, x: &[Vector3<f64>]) -> f64 {
    step(contact).update_active_set(x, &resistance(x.len()))
}

/// The pairs with an energy at x.
fn active(contact: &BarrierContact, x: &[Vector3<f64>]) -> Vec<(Pair, Law, Closest)> {
    let active = contact.active.pairs.iter().zip(&contact.active.laws);
    let all = active.map(|(pair, law)| (*pair, *law, Closest::of(pair, &pair.corners(x))));
    all.filter(|(_, law, closest)| law.is_active(closest.distance)).collect()
}

/// The second triangle touches the first with a vertex, with an edge across an edge, or beyond a corner.
fn states() -> Vec<Vec<Vector3<f64>>> {
    let first = [[0.0, 0.0, 0.0], [0.1, 0.0, 0.003], [0.0, 0.1, -0.002]];
    let with = |second: [Vector3<f64>; 3]| [first, second].concat();
    vec![
        with([[0.03, 0.03, 0.0018], [0.05, 0.02, 0.08], [0.01, 0.05, 0.07]]),
        with([[0.05, -0.0018, -0.05], [0.052, -0.0018, 0.05], [0.05, -0.09, 0.0]]),
        with([[-0.0012, -0.0009, 0.0004], [-0.05, -0.03, 0.04], [-0.04, -0.06, -0.02]]),
        with([[0.05, -0.0015, 0.002], [0.04, -0.05, 0.06], [0.06, -0.06, 0.05]]),
    ]
}

#[test]
fn forces_are_minus_the_gradient_and_neither_push_nor_turn_the_whole() {
    for x in states() {
        let mut contact = contact(&x);
        let added = update(&mut contact, &x);
        let energy = contact.energy(&x);
        assert!(energy > 0.0 && energy.is_finite() && (energy - added).abs() < 1e-15 * energy, "{energy} {added}");
        let mut force = vec![[0.0; 3]; 6];
        contact.add_force(&x, &mut force);
        let largest = force.iter().map(|f| norm(*f)).fold(0.0, f64::max);
        for vertex in 0..6 {
            for axis in 0..3 {
                let at = |offset: f64| {
                    let mut moved = x.clone();
                    moved[vertex][axis] += offset;
                    contact.energy(&moved)
                };
                const H: f64 = 1e-6;
                let slope = (8.0 * (at(H) - at(-H)) - (at(2.0 * H) - at(-2.0 * H))) / (12.0 * H);
                assert!((slope + force[vertex][axis]).abs() < 1e-6 * largest, "{slope} {:?}", force[vertex]);
            }
        }
        let total = force.iter().fold([0.0; 3], |sum, f| add_scaled(sum, 1.0, *f));
        let torque = x.iter().zip(&force).fold([0.0; 3], |sum, (x, f)| add_scaled(sum, 1.0, cross(*x, *f)));
        assert!(norm(total) < 1e-14 * largest && norm(torque) < 1e-14 * largest, "{total:?} {torque:?}");
    }
}

/// Friction opposes the sliding since the start of the step, with at most μ times the normal force.
#[test]
fn friction_opposes_sliding() {
    const FRICTION: f64 = 0.4;
    for x in states() {
        let force_at = |coefficient: f64, to: &[Vector3<f64>]| {
            let mut contact = contact(&x).with_friction(vec![Coulomb::uniform(coefficient); 6]);
            contact.begin_step(&x).lag_friction(&resistance(6));
            update(&mut contact, &x);
            let mut force = vec![[0.0; 3]; 6];
            contact.add_force(to, &mut force);
            (force, contact)
        };
        let (normal, _) = force_at(0.0, &x);
        let (still, contact) = force_at(FRICTION, &x);
        assert_eq!(normal, still, "nothing slides yet");
        // The upper triangle moves by ten times the sliding of a sticking pair.
        let mut moved = x.clone();
        moved[3..].iter_mut().for_each(|corner| *corner = add_scaled(*corner, 1e-4, [0.6, 0.8, 0.0]));
        let ((without, _), (with, _)) = (force_at(0.0, &moved), force_at(FRICTION, &moved));
        let friction: Vec<_> = with.iter().zip(&without).map(|(a, b)| subtract(*a, *b)).collect();
        let sum = |of: &[Vector3<f64>]| of.iter().fold([0.0; 3], |sum, f| add_scaled(sum, 1.0, *f));
        let (drag, push) = (sum(&friction[3..]), sum(&normal[3..]));
        assert!(norm(sum(&friction)) < 1e-14 * norm(push));
        assert!(dot(drag, [0.6, 0.8, 0.0]) < 0.0, "{drag:?}");
        let largest: f64 =
            active(&contact, &x).iter().map(|(_, law, closest)| FRICTION * law.force(law.apart(closest))).sum();
        assert!(norm(drag) <= largest && norm(drag) > 0.5 * largest, "{} {largest}", norm(drag));
        // The force is minus the gradient of the energy, and the stiffness its derivative.
        let stiffness = {
            let (_, mut contact) = force_at(FRICTION, &moved);
            step(&mut contact).stiffness(&DofMap::new(&[false; 6]), &moved, SlidingStiffness::Exact).concat()
        };
        for (vertex, axis) in (3..6).flat_map(|vertex| (0..3).map(move |axis| (vertex, axis))) {
            let at = |offset: f64| {
                let mut moved = moved.clone();
                moved[vertex][axis] += offset;
                contact.friction.energy(&moved, 1)
            };
            const H: f64 = 1e-7;
            let slope = (8.0 * (at(H) - at(-H)) - (at(2.0 * H) - at(-2.0 * H))) / (12.0 * H);
            assert!((slope + friction[vertex][axis]).abs() < 1e-5 * largest, "{slope} {:?}", friction[vertex]);
        }
        assert!(stiffness.len() > active(&contact, &moved).len(), "friction has a stiffness");
    }
}

#[test]
fn distances_and_their_gradients_are_those_of_the_declared_elements() {
    let mut kinds = [0; 4];
    for x in states() {
        let mut contact = contact(&x);
        update(&mut contact, &x);
        for (pair, _, closest) in active(&contact, &x) {
            let touched: Vec<usize> = (0..4).filter(|&corner| closest.weights[corner] != 0.0).collect();
            let points: Vec<Vector3<f64>> = touched.iter().map(|&corner| pair.corners(&x)[corner]).collect();
            let (kind, distance, gradient) = match (pair.kind, &points[..]) {
                (PairKind::PointTriangle, &[p, a]) => {
                    let found = Distance::<f64>::new().gradient(&[p, a]);
                    (0, found.value, found.gradient.to_vec())
                }
                (PairKind::PointTriangle, &[p, a, b]) => {
                    let found = PointEdgeDistance::<f64>::new().gradient(&[p, a, b]);
                    (1, found.value, found.gradient.to_vec())
                }
                (PairKind::PointTriangle, &[p, a, b, c]) => {
                    let found = PointTriangleDistance::<f64>::new().gradient(&[p, a, b, c]);
                    (2, found.value, found.gradient.to_vec())
                }
                (PairKind::EdgeEdge, &[a, b, c, d]) => {
                    let found = EdgeEdgeDistance::<f64>::new().gradient(&[a, b, c, d]);
                    (3, found.value, found.gradient.to_vec())
                }
                other => panic!("{other:?} should not be active"),
            };
            kinds[kind] += 1;
            assert!((distance - closest.distance).abs() < 1e-14, "{distance} {}", closest.distance);
            for (gradient, corner) in gradient.iter().zip(touched) {
                let expected = closest.normal.map(|component| closest.weights[corner] * component);
                assert!(norm(subtract(*gradient, expected)) < 1e-11, "{gradient:?} {expected:?}");
            }
        }
    }
    assert!(kinds.iter().all(|count| *count > 0), "{kinds:?}");
}

#[test]
fn the_stiffness_is_the_curvature_along_the_normal() {
    for x in states() {
        let mut contact = contact(&x);
        update(&mut contact, &x);
        let found = step(&mut contact).stiffness(&DofMap::new(&[false; 6]), &x, SlidingStiffness::Exact).concat();
        assert!(!found.is_empty());
        for ((pair, law, closest), one) in active(&contact, &x).into_iter().zip(&found) {
            assert_eq!((one.weights, one.rows), (closest.weights, pair.vertices));
            let (energy, gap) = (|gap: f64| law.energy(gap), law.apart(&closest));
            let h = 1e-3 * gap;
            let curvature = (energy(gap + h) - 2.0 * energy(gap) + energy(gap - h)) / (h * h);
            let along = dot(closest.normal, one.block.map(|row| dot(row, closest.normal)));
            assert!((along / curvature - 1.0).abs() < 1e-4, "{along} {curvature}");
        }
    }
}

/// At half the gap the barrier is as stiff as documented, whatever the resistance.
#[test]
fn stiffness_follows_the_resistance() {
    let x = states()[0].clone();
    let mut contact = contact(&x);
    update(&mut contact, &x);
    let (_, law, _) = active(&contact, &x)[0];
    const H: f64 = 1e-4 * GAP;
    let curvature = (law.force(0.5 * GAP - H) - law.force(0.5 * GAP + H)) / (2.0 * H);
    assert!((curvature / 500.0 - 1.0).abs() < 1e-6, "{curvature}");
}

#[test]
fn starts_that_cross_or_are_too_close_are_refused_by_name() {
    let mesh = || CollisionMesh::new(6, &[[0, 1, 2], [3, 4, 5]], &[], &[]);
    let new = |x: &[Vector3<f64>]| BarrierContact::new(mesh(), x, vec![true; 6], vec![0.5 * THICKNESS; 6], GAP);
    let mut x = states()[0].clone();
    x[3][2] = -0.01;
    let message = new(&x).unwrap_err().to_string();
    assert!(message.starts_with("the cloth crosses itself in 2 places at the start: the edge 3–4"), "{message}");
    let mut x = states()[0].clone();
    x[3][2] = 0.0008;
    let message = new(&x).unwrap_err().to_string();
    assert!(message.starts_with("1 pairs of features are closer than the thickness"), "{message}");
    assert!(message.contains("vertex 3 and the triangle 0–1–2"), "{message}");
}

#[test]
fn moves_are_certified_and_pairs_that_block_become_active() {
    let x = states()[0].clone();
    let mut contact = contact(&x);
    let mut through = x.clone();
    through[3..].iter_mut().for_each(|corner| corner[2] -= 0.2);
    let part = step(&mut contact).filter_step(&x, &through);
    assert!(part > 0.0 && part < 0.01, "{part}");
    let mut away = x.clone();
    away[3..].iter_mut().for_each(|corner| corner[2] += 0.2);
    assert_eq!(step(&mut contact).filter_step(&x, &away), 1.0);
    assert_eq!(step(&mut contact).filter_step(&x, &[[f64::NAN; 3]; 6]), 0.0);
    update(&mut contact, &x);
    let blocked = Pair { kind: PairKind::PointTriangle, features: [3, 0], vertices: [3, 0, 1, 2] };
    assert!(contact.active.contains(&blocked));
    let counts = contact.counts;
    assert_eq!((counts.moves, counts.shortened), (2, 1));
    assert!((counts.left - part).abs() < 1e-15);
}

/// Only the beginning of a move that is far longer than the first move of the step is looked at.
#[test]
fn a_part_of_a_long_move_is_certified() {
    let x = states()[0].clone();
    let mut contact = contact(&x);
    let lifted = |height: f64| {
        let mut to = x.clone();
        to[3..].iter_mut().for_each(|corner| corner[2] += height);
        to
    };
    // Half of the vertices move, so each moves by half the height relative to the mean.
    assert_eq!(step(&mut contact).filter_step(&x, &lifted(2.0)), 1.0);
    let part = step(&mut contact).filter_step(&x, &lifted(100.0));
    assert!((part - 0.02).abs() < 1e-12, "{part}");
    contact.begin_step(&x);
    assert_eq!(step(&mut contact).filter_step(&x, &lifted(100.0)), 1.0);
    assert_eq!(contact.counts.shortened, 1);
}

/// Two layers of 4 × 4 squares of 1 cm, above each other.
fn layers() -> (CollisionMesh, Vec<Vector3<f64>>) {
    let corner = |layer: usize, i: usize, j: usize| 25 * layer + 5 * i + j;
    let squares = (0..32).map(|number| (number / 16, number / 4 % 4, number % 4));
    let halves = |(layer, i, j)| {
        let [a, b, c, d] = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(di, dj)| corner(layer, i + di, j + dj));
        [[a, b, c], [a, c, d]]
    };
    let triangles: Vec<_> = squares.flat_map(halves).collect();
    let position = |number: usize| {
        let (layer, i, j) = (number / 25, number % 25 / 5, number % 5);
        [0.01 * i as f64 + 0.002 * layer as f64, 0.01 * j as f64, 0.002 * layer as f64]
    };
    (CollisionMesh::new(50, &triangles, &[], &[]), (0..50).map(position).collect())
}

/// The contact of the layers.
fn contact_of_layers() -> BarrierContact {
    let (mesh, x) = layers();
    let mut contact = BarrierContact::new(mesh, &x, vec![true; 50], vec![0.5 * THICKNESS; 50], GAP).unwrap();
    begin_step_of_layers(&mut contact, &x);
    contact
}

fn begin_step_of_layers(contact: &mut BarrierContact, x: &[Vector3<f64>]) {
    contact.begin_step(x);
}

/// Pairs of one step serve in the next, until vertices leave their balls.
#[test]
fn a_step_at_rest_needs_no_search() {
    let (mut contact, x) = (contact_of_layers(), layers().1);
    let moved = |x: &[Vector3<f64>], way: f64| -> Vec<Vector3<f64>> {
        (0..50).map(|vertex| add_scaled(x[vertex], way, [if vertex % 2 == 0 { 1.0 } else { -1.0 }, 0.0, 0.0])).collect()
    };
    let mut searches = Vec::new();
    for way in [1e-5, -1e-5, 1e-5, 4e-3] {
        begin_step_of_layers(&mut contact, &x);
        step(&mut contact).filter_step(&x, &moved(&x, way));
        update(&mut contact, &x);
        searches.push(contact.counts.searches);
    }
    assert_eq!(searches, [searches[0], searches[0], searches[0], searches[0] + 1]);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Moves, pairs and stiffnesses do not depend on the neighbourhood: they are bit-identical if it is forgotten
    /// before each of them.
    #[test]
    fn the_neighbourhood_changes_no_result(
        moves in prop::collection::vec((prop::collection::vec(prop::array::uniform3(-1.0..1.0_f64), 50), 0..4_i32), 8),
    ) {
        let [mut known, mut forgetful] = [contact_of_layers(), contact_of_layers()];
        let mut x = layers().1;
        for (number, (directions, decade)) in moves.into_iter().enumerate() {
            if number % 3 == 2 {
                [&mut known, &mut forgetful].into_iter().for_each(|contact| begin_step_of_layers(contact, &x));
            }
            let size = 0.005 * 10.0_f64.powi(-decade);
            let moved = |part: f64| -> Vec<Vector3<f64>> {
                x.iter().zip(&directions).map(|(x, direction)| add_scaled(*x, part * size, *direction)).collect()
            };
            forgetful.neighbourhood.clear();
            let part = step(&mut known).filter_step(&x, &moved(1.0));
            prop_assert_eq!(part.to_bits(), step(&mut forgetful).filter_step(&x, &moved(1.0)).to_bits());
            // The line search halves.
            x = moved(0.5 * part);
            forgetful.neighbourhood.clear();
            prop_assert_eq!(update(&mut known, &x).to_bits(), update(&mut forgetful, &x).to_bits());
            prop_assert_eq!(active_laws(&known), active_laws(&forgetful));
        }
        prop_assert!(known.counts.searches < forgetful.counts.searches);
        prop_assert!(!known.active.pairs.is_empty());
    }

    /// While only some vertices move, certificates, changes of energy, and the pairs of these vertices and forces on
    /// them are those of the whole contact. Afterwards, so are all certificates, and no pair is lost.
    #[test]
    fn a_restriction_changes_no_result(
        moves in prop::collection::vec((prop::collection::vec(prop::array::uniform3(-1.0..1.0_f64), 50), 0..4_i32), 6),
        moving in prop::collection::vec(prop::bool::weighted(0.2), 50),
    ) {
        let [mut whole, mut restricted] = [contact_of_layers(), contact_of_layers()];
        let mut x = layers().1;
        let (first, last) = (0, moves.len() - 1);
        let mut before = Vec::new();
        for (number, (directions, decade)) in moves.into_iter().enumerate() {
            let is_local = number != first && number != last;
            let size = 0.005 * 10.0_f64.powi(-decade);
            let moved = |part: f64| -> Vec<Vector3<f64>> {
                let part = |vertex: usize| if moving[vertex] || !is_local { part * size } else { 0.0 };
                let all = x.iter().zip(&directions).enumerate();
                all.map(|(vertex, (x, direction))| add_scaled(*x, part(vertex), *direction)).collect()
            };
            let part = step(&mut whole).filter_step(&x, &moved(1.0));
            prop_assert_eq!(part.to_bits(), step(&mut restricted).filter_step(&x, &moved(1.0)).to_bits());
            let next = moved(0.5 * part);
            for contact in [&mut whole, &mut restricted] {
                update(contact, &next);
            }
            if is_local {
                let change = |contact: &BarrierContact| contact.energy(&next) - contact.energy(&x);
                let (expected, found) = (change(&whole), change(&restricted));
                prop_assert!((found - expected).abs() <= 1e-13 * whole.energy(&x).max(whole.energy(&next)));
                let forces = [&whole, &restricted].map(|contact| {
                    let mut force = vec![[0.0; 3]; 50];
                    contact.add_force(&next, &mut force);
                    force
                });
                let largest = forces[0].iter().map(|force| norm(*force)).fold(0.0, f64::max);
                for vertex in (0..50).filter(|&vertex| moving[vertex]) {
                    prop_assert!(norm(subtract(forces[1][vertex], forces[0][vertex])) <= 1e-14 * largest);
                }
                let mut expected = active_laws(&whole);
                expected.retain(|(pair, _)| pair.has_any(&moving));
                prop_assert_eq!(expected, active_laws(&restricted));
            }
            x = next;
            if number == first {
                before = active_laws(&restricted);
                step(&mut restricted).restrict(&moving);
            } else if number + 1 == last {
                step(&mut restricted).release();
                let after = active_laws(&restricted);
                prop_assert!(before.iter().all(|pair| after.contains(pair)));
            }
        }
    }
}

/// The active pairs and their stiffness.
fn active_laws(contact: &BarrierContact) -> Vec<(Pair, u64)> {
    let ActiveSet { pairs, laws, .. } = &contact.active;
    pairs.iter().zip(laws).map(|(pair, law)| (*pair, law.stiffness.to_bits())).collect()
}

/// The layers of a large mesh have pairs for several parts, so that threads share them.
#[test]
fn threads_change_no_bit_of_many_pairs() {
    const SIDE: usize = 30;
    const VERTICES: usize = 2 * SIDE * SIDE;
    // The upper layer is shifted by a third of a cell, so that edges cross.
    let position = |vertex: usize| -> Vector3<f64> {
        let (layer, row, column) = (vertex / (SIDE * SIDE), vertex / SIDE % SIDE, vertex % SIDE);
        let shift = layer as f64 / 3.0;
        let wave = 1e-4 * ((7 * row + 3 * column) as f64).sin();
        [0.01 * (column as f64 + shift), 0.01 * (row as f64 + shift), 0.002 * layer as f64 + wave]
    };
    let cells = |layer: usize| {
        (0..(SIDE - 1) * (SIDE - 1)).flat_map(move |cell| {
            let first = layer * SIDE * SIDE + cell / (SIDE - 1) * SIDE + cell % (SIDE - 1);
            let above = first + SIDE;
            [[first, first + 1, above + 1], [first, above + 1, above]]
        })
    };
    let triangles: Vec<_> = cells(0).chain(cells(1)).collect();
    let x: Vec<_> = (0..VERTICES).map(position).collect();
    // The upper layer falls and slides, a corner of it so far that its pairs alone are searched for.
    let to = |part: f64, corner: usize| -> Vec<Vector3<f64>> {
        let falls = |vertex: usize| vertex >= SIDE * SIDE && vertex % SIDE < corner && vertex / SIDE % SIDE < corner;
        let moved = |vertex: usize| if falls(vertex) { [5e-5, 3e-5, -4e-3 * part] } else { [0.0; 3] };
        x.iter().enumerate().map(|(vertex, x)| add_scaled(*x, 1.0, moved(vertex))).collect()
    };
    let run = |threads: usize| {
        let mesh = CollisionMesh::new(VERTICES, &triangles, &[], &[]);
        let (free, radii) = (vec![true; VERTICES], vec![0.5 * THICKNESS; VERTICES]);
        let mut contact =
            BarrierContact::new(mesh, &x, free, radii, GAP)
                .unwrap()
                .with_friction(vec![Coulomb::uniform(0.3); VERTICES]);
        contact.set_threads(threads);
        contact.begin_step(&x);
        let dofs = DofMap::new(&[false; VERTICES]);
        let mut results = Vec::new();
        let parts = [to(1.0, SIDE), to(0.6, 8)].map(|to| step(&mut contact).filter_step(&x, &to));
        results.extend(parts);
        step(&mut contact).lag_friction(&resistance(VERTICES));
        for corner in [SIDE, 8] {
            let state = to(0.2 * parts[0], corner);
            results.push(update(&mut contact, &state));
            results.push(contact.energy(&state));
            let mut force = vec![[0.0; 3]; VERTICES];
            contact.add_force(&state, &mut force);
            results.extend(force.as_flattened());
            let contacts = step(&mut contact).stiffness(&dofs, &state, SlidingStiffness::Exact).concat();
            let sticking = contact.friction.stiffness(&state, SlidingStiffness::Exact, 1).between(None, None).count();
            assert!(sticking > PART, "{sticking} pairs");
            assert_eq!(contacts.len(), active(&contact, &state).len() + sticking);
            for Contact { weights, block, .. } in contacts {
                results.extend(weights.iter().chain(block.as_flattened()));
            }
        }
        assert!(contact.active.pairs.len() > 2 * PART, "{} pairs", contact.active.pairs.len());
        assert!(contact.counts.shortened > 0);
        results.into_iter().map(f64::to_bits).collect::<Vec<_>>()
    };
    let one = run(1);
    assert!(one.len() > 100_000, "{}", one.len());
    assert!(one == run(2) && one == run(3));
}

#[test]
fn the_most_pressed_feature_is_named_with_both_sides() {
    // A vertex of the second triangle is close to the first.
    let x = states().remove(0);
    let mut contact = contact(&x);
    assert_eq!(contact.find_most_pressed(&x), None);
    update(&mut contact, &x);
    let pressed = |vertices: &[usize], by: &[&[usize]]| {
        let by = by.iter().map(|vertices| Presser::Vertices(vertices.to_vec())).collect();
        Some(Pressed { vertices: vertices.to_vec(), by })
    };
    let found = contact.find_most_pressed(&x);
    assert!(found == pressed(&[3], &[&[0, 1, 2]]) || found == pressed(&[0, 1, 2], &[&[3]]), "{found:?}");
    // A third triangle presses the vertex from above.
    let mesh = CollisionMesh::new(9, &[[0, 1, 2], [3, 4, 5], [6, 7, 8]], &[], &[]);
    let corners = |heights: [f64; 3]| [[0.0, 0.0, heights[0]], [0.1, 0.0, heights[1]], [0.0, 0.1, heights[2]]];
    let (below, above) = (corners([0.0; 3]), corners([0.0046, 0.0024, 0.0024]));
    let between = [[0.05, 0.045, 0.00125], [-0.2, -0.1, 0.0025], [-0.1, -0.2, 0.0025]];
    let x = [below, between, above].concat();
    let mut contact = BarrierContact::new(mesh, &x, vec![true; 9], vec![0.5 * THICKNESS; 9], GAP).unwrap();
    contact.begin_step(&x);
    update(&mut contact, &x);
    let found = contact.find_most_pressed(&x).unwrap();
    assert_eq!((found.vertices.as_slice(), found.by.len()), (&[3][..], 2), "{found:?}");
}

/// Vertices that move on their own shift the mean of all, with which the balls of the others move afterwards. A pair
/// that was too far apart to be known must still be found.
#[test]
fn a_restriction_hides_no_pair_from_the_next_moves() {
    const LAYERS: usize = 20;
    const VERTICES: usize = 3 * LAYERS + 6;
    // A stack of triangles, and two more aside, 1 cm above each other.
    let triangle = |x: f64, z: f64| [[x, 0.0, z], [x + 0.01, 0.0, z], [x, 0.01, z]];
    let stack = (0..LAYERS).map(|layer| triangle(0.0, 0.002 * layer as f64));
    let x: Vec<_> = stack.chain([triangle(0.1, 0.0), triangle(0.1, 0.01)]).flatten().collect();
    let triangles: Vec<_> = (0..VERTICES / 3).map(|number| [0, 1, 2].map(|corner| 3 * number + corner)).collect();
    let mesh = CollisionMesh::new(VERTICES, &triangles, &[], &[]);
    let (free, radii) = (vec![true; VERTICES], vec![0.5 * THICKNESS; VERTICES]);
    let mut contact = BarrierContact::new(mesh, &x, free, radii, GAP).unwrap();
    let moved = |x: &[Vector3<f64>], vertices: std::ops::Range<usize>, by: Vector3<f64>| {
        let mut moved = x.to_vec();
        moved[vertices].iter_mut().for_each(|x| *x = add_scaled(*x, 1.0, by));
        moved
    };
    contact.begin_step(&x);
    // The next search would replace the balls of an earlier step.
    contact.neighbourhood.clear();
    assert_eq!(step(&mut contact).filter_step(&x, &x), 1.0);
    update(&mut contact, &x);
    // The first layer is pulled out, so far that all others seem to move by several centimetres.
    step(&mut contact).restrict(&(0..VERTICES).map(|vertex| vertex < 3).collect::<Vec<_>>());
    let mut here = x;
    for _ in 0..30 {
        let to = moved(&here, 0..3, [-0.03, 0.0, 0.0]);
        let part = step(&mut contact).filter_step(&here, &to);
        here = moved(&here, 0..3, [-0.03 * part, 0.0, 0.0]);
        update(&mut contact, &here);
    }
    assert!(here[0][0] < -0.5, "{}", here[0][0]);
    step(&mut contact).release();
    let searches = contact.counts.searches;
    let fallen = moved(&here, VERTICES - 3..VERTICES - 2, [0.002, 0.002, -0.02]);
    let part = step(&mut contact).filter_step(&here, &fallen);
    assert!(part < 0.5, "{part}");
    // Few vertices leave their balls, so that the hierarchies of the searches before are used again.
    assert!(contact.counts.searches == searches + 1 && !contact.search.is_unfitted());
    assert!(contact.neighbourhood.escaped().pairs().len() < 20);
}
