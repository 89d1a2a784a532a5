//! Contact of a scene with itself and with obstacles.

use energy_solve::index;

use crate::barrier::{
    BarrierContact, ContactError, Feature, FirstPush, GAP_PER_THICKNESS, LARGEST_REACH, ObstacleStart, PairFriction,
    Participants, Untangling, local_thinning,
};
use crate::collision::{CollisionMesh, EDGES_PER_HEIGHT};
use crate::contact::{AnySolid, Obstacle};
use crate::geometry::{norm, subtract};
use crate::model::Model;
use crate::scene::Scene;

use super::Island;

/// Returns the points, edges and triangles of a model.
pub(super) fn mesh_of(model: &Model) -> CollisionMesh {
    let segments: Vec<[usize; 2]> =
        model.strands().flat_map(|strand| strand.clone().zip(strand.skip(1)).map(|(a, b)| [a, b])).collect();
    CollisionMesh::new(model.x.len(), &model.triangles, &segments, &model.sewn)
}

/// Adds contact to an island: with obstacles, and with itself if it holds all vertices of the model. If crossings at
/// the start are to be repaired, vertices of the island and the model move.
pub(super) fn add_contact(
    island: &mut Island,
    model: &mut Model,
    with_itself: bool,
    scene: &Scene,
) -> Result<(), ContactError> {
    let participants = participants(island, model, with_itself);
    if scene.untangle {
        repair(island, model, &participants);
    }
    check_sides(island, model)?;
    let vertices = island.vertices();
    let x = &island.body().x;
    let mut contact = BarrierContact::among(participants, x).map_err(|error| error.on_vertices(vertices))?;
    let gravity = norm(scene.gravity);
    let is_fast = |push: &FirstPush| push.speed > (2.0 * gravity * push.reach).sqrt();
    let push = contact.first_push(x, scene.dt).filter(is_fast);
    push.into_iter().for_each(|push| note(model, note_on_push(&push)));
    let contact = contact.with_friction(vertices.iter().map(|&vertex| model.friction[vertex]).collect());
    let contact = contact.with_obstacle_friction(island.prescribed().friction(&model.obstacles, vertices.len()));
    let contact = contact.with_pair_friction(pair_friction(vertices, model));
    island.body_mut().system.set_contact(Box::new(contact));
    Ok(())
}

/// Returns the friction of the chosen pairs of parts, for the vertices of an island.
fn pair_friction(vertices: &[usize], model: &Model) -> PairFriction {
    let part = |&vertex: &usize| model.parts.iter().position(|part| part.vertices.contains(&vertex));
    let part_of = vertices.iter().map(|vertex| index(part(vertex).unwrap_or(model.parts.len()))).collect();
    PairFriction::new(part_of, index(model.parts.len()), &model.pair_friction)
}

/// Returns what collides in an island.
fn participants(island: &Island, model: &mut Model, with_itself: bool) -> Participants {
    let vertices = island.vertices();
    let mut local = vec![None; model.x.len()];
    vertices.iter().enumerate().for_each(|(place, &vertex)| local[vertex] = Some(place));
    let own = mesh_of(model).restricted(&local, vertices.len());
    let x = &island.body().x;
    let all: Vec<f64> = vertices.iter().map(|&vertex| model.thickness[vertex]).collect();
    let thickest = all.iter().copied().fold(0.0, f64::max);
    let kept = local_thinning(&own, x, thickest);
    if kept.iter().any(|&part| part < 1.0) {
        note(model, note_on_thickness(&kept, thickest, own.shortest_edge(x)));
    }
    let start = |(obstacle, radius): (&Obstacle, f64)| ObstacleStart {
        name: obstacle.name.clone(),
        radius,
        reach: obstacle.thickness,
    };
    let cores = island.prescribed().cores();
    Participants {
        is_free: (0..x.len()).map(|place| vertices.get(place).is_some_and(|&own| !model.pinned_forever[own])).collect(),
        radii: all.iter().zip(&kept).map(|(thickness, kept)| 0.5 * kept * thickness).collect(),
        gaps: kept.iter().map(|kept| GAP_PER_THICKNESS * kept * thickest).collect(),
        obstacles: model.obstacles.iter().zip(cores.iter().map(|core| core.radius)).map(start).collect(),
        exclusions: model.exclusions.restricted(&local, vertices.len()),
        with_itself,
        mesh: own.with_obstacles(&cores),
    }
}

/// Adds a note, unless another island has led to it.
fn note(model: &mut Model, note: String) {
    if !model.notes.contains(&note) {
        model.notes.push(note);
    }
}

/// Says where fabrics are thinner in contact than described.
fn note_on_thickness(kept: &[f64], thickest: f64, shortest: f64) -> String {
    let least = kept.iter().copied().fold(1.0, f64::min);
    let count = kept.iter().filter(|part| **part < 1.0).count();
    let [thickest, thinned, shortest] = [thickest, least * thickest, shortest].map(millimetres);
    format!(
        "contact gives {count} of {} vertices less than their thickness, down to {thinned} mm instead of {thickest} \
         mm: edges, the shortest of {shortest} mm, must be longer than {:.1} times the reach of contact around them, and \
         triangles higher than {:.1} times. Merge vertices of short edges with `weld`, or use a coarser mesh",
        kept.len(),
        1.0 / LARGEST_REACH,
        1.0 / LARGEST_REACH / EDGES_PER_HEIGHT
    )
}

/// Writes a length in m as millimetres, with at least two digits.
fn millimetres(length: f64) -> String {
    let length = 1e3 * length;
    if length < 0.01 { format!("{length:.1e}") } else { format!("{length:.3}") }
}

/// Says that contact pushes cloth away at the start.
fn note_on_push(FirstPush { by, distance, reach, speed }: &FirstPush) -> String {
    let [distance, reach] = [distance, reach].map(|length| 1e3 * length);
    let (parts, remedy) = match by {
        Some(obstacle) => (format!("cloth and {obstacle}"), format!("reduce the `thickness` of {obstacle}")),
        None => ("parts of the cloth".to_owned(), "reduce the `thickness` of the fabric".to_owned()),
    };
    format!(
        "{parts} start {distance:.3} mm apart, within the reach of contact, {reach:.3} mm. It pushes them apart at \
         about {speed:.2} m/s, and faster if dt is smaller. Start them farther apart, or {remedy}"
    )
}

/// Moves vertices of an island, and of the model, to where nothing crosses. Crossings that are too deep stay.
fn repair(island: &mut Island, model: &mut Model, participants: &Participants) {
    let solids: Vec<AnySolid> = model.obstacles.iter().map(|obstacle| obstacle.at(0.0)).collect();
    let is_pinned = |place: usize| island.vertices().get(place).is_none_or(|&vertex| model.pinned_at_start[vertex]);
    let is_movable = (0..island.body().x.len()).map(|place| !is_pinned(place)).collect();
    let untangling = Untangling { participants, solids: &solids, is_movable };
    let Some(x) = untangling.repair(&island.body().x) else { return };
    let moves = || x.iter().zip(&island.body().x).map(|(to, from)| norm(subtract(*to, *from)));
    let (count, longest) = (moves().filter(|way| *way > 0.0).count(), moves().fold(0.0, f64::max));
    if count > 0 {
        let longest = 1e3 * longest;
        model.notes.push(format!("{count} vertices moved by up to {longest:.3} mm, so that nothing crosses"));
    }
    for (&vertex, x) in island.vertices().iter().zip(&x) {
        model.x[vertex] = *x;
    }
    island.body_mut().x = x;
}

/// Returns an error if a free vertex starts inside an obstacle.
fn check_sides(island: &Island, model: &Model) -> Result<(), ContactError> {
    let body = island.body();
    for obstacle in &model.obstacles {
        let solid: AnySolid = obstacle.at(0.0);
        let depth = |&vertex: &usize| (vertex, -solid.signed_distance(body.x[vertex]));
        let free = body.system.dofs().free().iter().filter(|&&place| !model.pinned_at_start[island.vertices()[place]]);
        let inside: Vec<_> = free.map(depth).filter(|(_, depth)| *depth > 0.0).collect();
        if let Some(&(vertex, depth)) = inside.iter().max_by(|a, b| a.1.total_cmp(&b.1)) {
            let (obstacle, vertex) = (obstacle.name.clone(), Feature::from(&[island.vertices()[vertex]][..]));
            return Err(ContactError::Inside { obstacle, count: inside.len(), vertex, depth });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::fmt::Write as _;
    use std::io::Write as _;
    use std::path::Path;
    use std::process::{Command, Stdio};
    use std::sync::atomic::{AtomicUsize, Ordering};
    use std::sync::{Arc, Mutex};

    use energy_dsl::Vector3;
    use energy_solve::{
        Contact, ContactCounts, ContactForces, ContactModel, ContactStep, DofMap, Resistance, SlidingStiffness,
    };

    use super::*;
    use crate::Simulation;
    use crate::collision::crossings;
    use crate::scene::Scene;

    /// Contact whose states and moves are checked by the exact test.
    #[derive(Debug)]
    struct Watched {
        inner: Box<dyn ContactModel>,
        record: Record,
    }

    /// The contact of a step, checked by the exact test.
    struct WatchedStep<'a> {
        inner: Box<dyn ContactStep + 'a>,
        record: &'a mut Record,
    }

    #[derive(Debug)]
    struct Record {
        mesh: CollisionMesh,
        iterates: Arc<AtomicUsize>,
        /// Start and end of each accepted move, as text.
        moves: Arc<Mutex<String>>,
        last: Vec<Vector3<f64>>,
    }

    impl Record {
        fn check(&self, x: &[Vector3<f64>]) {
            let found = crossings(&self.mesh, x);
            assert!(found.is_empty(), "{found:?}");
            self.iterates.fetch_add(1, Ordering::Relaxed);
        }

        /// Writes down the move from the last accepted state to x.
        fn accept(&mut self, x: &[Vector3<f64>]) {
            let mut moves = self.moves.lock().unwrap();
            if !self.last.is_empty() && self.last != x {
                let numbers = self.last.as_flattened().iter().chain(x.as_flattened());
                numbers.for_each(|number| write!(moves, "{number:e} ").unwrap());
                moves.push('\n');
            }
            self.last = x.to_vec();
        }

        /// Returns the energy of a contact at x.
        fn energy(&self, contact: &(impl ContactForces + ?Sized), x: &[Vector3<f64>]) -> f64 {
            self.check(x);
            let energy = contact.energy(x);
            assert!(energy.is_finite(), "evaluated at a certified state");
            energy
        }
    }

    impl ContactForces for Watched {
        fn energy(&self, x: &[Vector3<f64>]) -> f64 {
            self.record.energy(&*self.inner, x)
        }

        fn add_force(&self, x: &[Vector3<f64>], force: &mut [Vector3<f64>]) {
            self.inner.add_force(x, force);
        }
    }

    impl ContactModel for Watched {
        fn begin_step(&mut self, x: &[Vector3<f64>]) -> Box<dyn ContactStep + '_> {
            self.record.accept(x);
            Box::new(WatchedStep { inner: self.inner.begin_step(x), record: &mut self.record })
        }
    }

    impl ContactForces for WatchedStep<'_> {
        fn energy(&self, x: &[Vector3<f64>]) -> f64 {
            self.record.energy(&*self.inner, x)
        }

        fn add_force(&self, x: &[Vector3<f64>], force: &mut [Vector3<f64>]) {
            self.inner.add_force(x, force);
        }
    }

    impl ContactStep for WatchedStep<'_> {
        fn filter_step(&mut self, from: &[Vector3<f64>], to: &[Vector3<f64>]) -> f64 {
            let part = self.inner.filter_step(from, to);
            for sample in 0..=4 {
                let time = 0.25 * part * f64::from(sample);
                let at = |(from, to): (&Vector3<f64>, &Vector3<f64>)| -> Vector3<f64> {
                    std::array::from_fn(|axis| from[axis] + time * (to[axis] - from[axis]))
                };
                self.record.check(&from.iter().zip(to).map(at).collect::<Vec<_>>());
            }
            part
        }

        fn lag_friction(&mut self, resistance: &Resistance) {
            self.inner.lag_friction(resistance);
        }

        fn update_active_set(&mut self, x: &[Vector3<f64>], resistance: &Resistance) -> f64 {
            self.record.check(x);
            self.record.accept(x);
            self.inner.update_active_set(x, resistance)
        }

        fn stiffness(&mut self, dofs: &DofMap, x: &[Vector3<f64>], sliding: SlidingStiffness) -> Vec<Vec<Contact>> {
            self.inner.stiffness(dofs, x, sliding)
        }

        fn restrict(&mut self, moving: &[bool]) {
            self.inner.restrict(moving);
        }

        fn release(&mut self) {
            self.inner.release();
        }

        fn counts(&self) -> ContactCounts {
            self.inner.counts()
        }
    }

    /// A creased sheet crumples between two pins that meet.
    const CRUMPLED: &str = r#"
        dt = 0.01
        duration = 1.0
        integrator = "newton"
        contact = "on"
        adaptive = true
        tolerances.velocity = 1e-3
        drag = 1.0
        [mesh.sheet]
        cells = [9, 7]
        size = [0.3, 0.2]
        plane = "vertical"
        [fabric]
        density = 0.2
        thickness = 1e-3
        material.stvk = { stretch_stiffness = 40.0, poisson_ratio = 0.3, bending.flat.stiffness = 1e-6 }
        [[pins]]
        nearest = [-0.15, 0.0, 0.1]
        motion.keys = [{ time = 0.0 }, { time = 0.3, translate = [0.14, 0.01, 0.0] }]
        [[pins]]
        nearest = [0.15, 0.0, 0.1]
        motion.keys = [{ time = 0.0 }, { time = 0.3, translate = [-0.14, -0.01, 0.0] }]
        [[pins]]
        nearest = [0.0, 0.0, -0.1]
        motion.keys = [{ time = 0.0 }, { time = 0.3, translate = [0.0, 0.02, 0.19] }]
        "#;

    /// Simulates some steps under watch. Returns the number of states that were tested, the mesh, and all moves.
    fn watched(steps: usize) -> (usize, CollisionMesh, String) {
        let scene = Scene::parse(CRUMPLED, "crumpled.toml".as_ref()).unwrap();
        let mut simulation = Simulation::new(&scene).unwrap();
        let (iterates, moves) = (Arc::new(AtomicUsize::new(0)), Arc::new(Mutex::new(String::new())));
        let mesh = simulation.collision_mesh.clone();
        let [island] = &mut simulation.islands[..] else { panic!("contact joins everything to one island") };
        assert!(island.vertices().iter().enumerate().all(|(place, &vertex)| place == vertex));
        let system = &mut island.body_mut().system;
        let inner = system.take_contact().unwrap();
        let (own, counted, written) = (mesh.clone(), Arc::clone(&iterates), Arc::clone(&moves));
        let record = Record { mesh: own, iterates: counted, moves: written, last: Vec::new() };
        system.set_contact(Box::new(Watched { inner, record }));
        for _ in 0..steps {
            simulation.step().unwrap_or_else(|error| panic!("{error}"));
        }
        let totals = simulation.summary().unwrap().totals;
        let work = totals.contact;
        assert!(work.shortened > 0 && work.active > 100, "the sheet meets itself: {work}");
        assert!(totals.local_solves > 0, "some moves are those of a few vertices");
        let moves = std::mem::take(&mut *moves.lock().unwrap());
        (iterates.load(Ordering::Relaxed), mesh, moves)
    }

    #[test]
    fn no_state_that_is_accepted_or_evaluated_has_a_crossing() {
        let (iterates, ..) = watched(40);
        assert!(iterates > 500, "{iterates}");
    }

    /// Skipped without the Python package ipctk.
    #[test]
    fn ipc_toolkit_finds_no_collision_in_any_move() {
        let (_, mesh, moves) = watched(40);
        let lines = |rows: &[&[u32]]| {
            let row = |row: &&[u32]| row.iter().map(u32::to_string).collect::<Vec<_>>().join(" ") + "\n";
            rows.iter().map(row).collect::<String>()
        };
        let triangles: Vec<&[u32]> = mesh.triangles().iter().map(|corners| &corners[..]).collect();
        let edges: Vec<&[u32]> = mesh.edges().iter().map(|ends| &ends[..]).collect();
        let counts = format!("{} {} {}\n", mesh.vertices(), triangles.len(), edges.len());
        let text = counts + &lines(&triangles) + &lines(&edges) + &moves;
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/simulation/check_with_ipctk.py");
        let python = Command::new("python3").arg(script).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn();
        let Ok(mut python) = python.map_err(|error| eprintln!("skipped: no python3 ({error})")) else { return };
        // Without the package the script ends before it reads.
        let _ = python.stdin.take().map(|mut input| input.write_all(text.as_bytes()));
        let told = python.wait_with_output().unwrap();
        let said = String::from_utf8_lossy(&told.stdout);
        if told.status.code() == Some(77) {
            eprintln!("skipped: {said}");
            return;
        }
        assert!(told.status.success(), "{said}");
        let count = moves.lines().count();
        assert!(count > 100 && said == format!("{count} moves\n"), "{said}");
    }
}
