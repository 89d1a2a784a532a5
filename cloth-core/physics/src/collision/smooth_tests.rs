//! Searches leave out parts of cloth that are smooth.

use energy_dsl::Vector3;
use proptest::prelude::*;

use super::tests::{all_pairs, at};
use super::*;
use crate::geometry::{add_scaled, norm, subtract};
use crate::mesh::{Diagonals, Plane, Sheet};

const CELLS: [usize; 2] = [12, 10];
/// The side of a cell, in m.
const SIDE: f64 = 0.01;
const REACH: f64 = 2e-3;

/// A flat sheet, and what else is near it.
struct Scene {
    triangles: Vec<[usize; 3]>,
    segments: Vec<[usize; 2]>,
    x: Vec<Vector3<f64>>,
}

impl Scene {
    fn sheet() -> Self {
        let size = [SIDE * CELLS[0] as f64, SIDE * CELLS[1] as f64];
        let plane = Plane::Horizontal;
        let sheet = Sheet { cells: CELLS, size, diagonals: Diagonals::Regular, plane, pleats: None }.mesh().unwrap();
        Self { triangles: sheet.triangles().to_vec(), segments: Vec::new(), x: sheet.vertices().to_vec() }
    }

    /// A tetrahedron 3 mm above the sheet, and a strand 3 mm below it.
    fn with_others() -> Self {
        let mut scene = Self::sheet();
        let first = scene.x.len();
        scene.x.extend([[0.0, 0.0, 0.003], [0.01, 0.0, 0.013], [0.0, 0.01, 0.013], [0.01, 0.01, 0.013]]);
        scene.triangles.extend([[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]].map(|corners| corners.map(|c| first + c)));
        let first = scene.x.len();
        scene.x.extend((0..8).map(|number| [0.012 * f64::from(number) - 0.05, 0.003, -0.003]));
        scene.segments.extend((first..first + 7).map(|number| [number, number + 1]));
        scene
    }

    fn mesh(&self) -> CollisionMesh {
        CollisionMesh::new(self.x.len(), &self.triangles, &self.segments, &[])
    }

    fn search(&self, mesh: &CollisionMesh, reach: f64) -> Search {
        let count = mesh.vertices();
        let rules = Rules { halves: vec![0.5 * reach; count], is_free: vec![true; count], ..Rules::default() };
        Search::new(mesh, &self.x, Rules { with_itself: true, ..rules })
    }

    /// The scene bent to a cylinder of some curvature, in 1/m, and stretched along the cylinder's axis.
    fn bent(&self, curvature: f64, stretch: f64) -> Vec<Vector3<f64>> {
        let bend = |&[a, b, c]: &Vector3<f64>| {
            let (angle, radius) = (curvature * a, 1.0 / curvature - c);
            [radius * angle.sin(), stretch * b, 1.0 / curvature - radius * angle.cos()]
        };
        self.x.iter().map(bend).collect()
    }
}

fn is_clear(scene: &Scene, x: &[Vector3<f64>], radius: f64) -> bool {
    let mesh = scene.mesh();
    scene.search(&mesh, REACH).is_clear(&mesh, &MovingBalls { ends: [x, x], radii: &vec![radius; x.len()] })
}

#[test]
fn a_smooth_sheet_is_clear_until_it_is_creased_or_squeezed_or_meets_itself() {
    let scene = Scene::sheet();
    assert!(is_clear(&scene, &scene.x, 0.0));
    assert!(is_clear(&scene, &scene.bent(10.0, 2.0), 0.0));
    // Neighbours are 7 mm apart, so balls of 2.5 mm leave a gap of 2 mm, and balls of 3.5 mm none.
    assert!(is_clear(&scene, &scene.x, 2.5e-3 - 1e-6));
    assert!(!is_clear(&scene, &scene.x, 2.6e-3));
    // At a quarter of its width, the sheet is 1.8 mm from its neighbours.
    assert!(!is_clear(&scene, &scene.bent(1e-3, 0.25), 0.0));
    // The circumference is 12 cm; the ends meet.
    assert!(!is_clear(&scene, &scene.bent(0.99 * std::f64::consts::TAU / 0.12, 1.0), 0.0));
    let creased = |angle: f64| -> Vec<_> {
        let turn = |&[a, b, c]: &Vector3<f64>| if a > 0.0 { [a * angle.cos(), b, a * angle.sin()] } else { [a, b, c] };
        scene.x.iter().map(turn).collect()
    };
    assert!(is_clear(&scene, &creased(0.5), 0.0) && !is_clear(&scene, &creased(3.1), 0.0));
}

#[test]
fn a_sheet_near_anything_is_not_clear() {
    let scene = Scene::sheet();
    let above = |height: f64| {
        let corners = [[-9.0, -9.0, -height], [9.0, -9.0, -height], [0.0, 9.0, -height]];
        // A plane is a single triangle.
        let plane = Core { vertices: corners.to_vec(), faces: vec![[0, 1, 2]], ..Core::default() };
        let mesh = scene.mesh().with_obstacles(std::slice::from_ref(&plane));
        let x = [&scene.x[..], &corners].concat();
        let all = Scene { x, ..Scene::sheet() };
        let balls = MovingBalls { ends: [&all.x, &all.x], radii: &vec![0.0; all.x.len()] };
        let mut search = all.search(&mesh, REACH);
        (search.is_clear(&mesh, &balls), search.pairs(&mesh, &balls).len())
    };
    assert_eq!(above(0.01), (true, 0));
    let (is_clear_above, pairs) = above(0.001);
    assert!(!is_clear_above && pairs >= scene.x.len(), "{pairs}");
    let others = Scene::with_others();
    assert!(!is_clear(&others, &others.x, 2e-3));
}

/// How a sheet meanders: the largest slope, the wavelength in m, the phase, and the stretch across.
type Meander = (f64, f64, f64, f64);

fn meander() -> impl Strategy<Value = Meander> {
    (0.0..3.0_f64, 0.03..0.5_f64, 0.0..std::f64::consts::TAU, 0.1..3.0_f64)
}

/// Gives the scene's sheet the shape of waves that hang over if the slope is large.
fn meandering(scene: &Scene, (slope, wavelength, phase, stretch): Meander) -> Vec<Vector3<f64>> {
    const STEP: f64 = 1e-3;
    let angle = |along: f64| slope * (std::f64::consts::TAU * along / wavelength + phase).sin();
    let bend = |&[a, b, c]: &Vector3<f64>| {
        let steps = (a.abs() / STEP).round() as i32;
        let tangents = (0..steps).map(|step| angle((f64::from(step) + 0.5) * STEP * a.signum()));
        let sum = tangents.fold([0.0; 2], |[x, z], angle| [x + angle.cos(), z + angle.sin()]);
        [STEP * a.signum() * sum[0], stretch * b, STEP * a.signum() * sum[1] + c]
    };
    scene.x.iter().map(bend).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// No pair within reach is missing, at any instant of a move from one shape to another, if each vertex stays in its
    /// ball.
    #[test]
    fn smooth_shapes_hide_no_pair(
        (from, to, is_still) in (meander(), meander(), prop::bool::ANY),
        noise in prop::collection::vec((prop::array::uniform3(-1.0..1.0_f64), prop::array::uniform3(-0.57..0.57)), 160),
        (size, instant) in (prop_oneof![Just(0.0), 1e-4..3e-3], 0.0..1.0_f64),
        (reach, radius) in (1e-4..2e-3_f64, prop_oneof![Just(0.0), 0.0..3e-3_f64]),
    ) {
        let scene = Scene::with_others();
        let (mesh, count) = (scene.mesh(), scene.x.len());
        let noisy = |shape: Meander| -> Vec<Vector3<f64>> {
            meandering(&scene, shape).iter().zip(&noise).map(|(x, (by, _))| add_scaled(*x, size, *by)).collect()
        };
        let (from, to) = (noisy(from), noisy(if is_still { from } else { to }));
        let mut search = scene.search(&mesh, reach);
        let balls = MovingBalls { ends: [&from, &to], radii: &vec![radius; count] };
        let (near, radii) = search.pairs_near(&mesh, &balls, [1e-4, 4e-3]);
        let all = search.pairs(&mesh, &balls);
        for (found, radii) in [(&near, &radii[..]), (&all, balls.radii)] {
            let x = at(&from, &to, instant);
            let moved = |vertex: usize| add_scaled(x[vertex], radii[vertex], noise[vertex].1);
            let x: Vec<_> = (0..count).map(moved).collect();
            for pair in all_pairs(&mesh) {
                let is_known = found.binary_search(&pair).is_ok();
                let apart = Closest::of(&pair, &pair.corners(&x)).distance;
                prop_assert!(is_known || apart > reach, "{:?} at {}", pair, apart);
            }
        }
    }

    /// A search around some vertices finds their pairs, those with obstacles of all kinds among them, and no others.
    #[test]
    fn a_search_around_vertices_finds_their_pairs(
        shapes in prop::array::uniform2(meander()),
        (middle, size, is_obstacle_changed) in (0..143_usize, 0.0..0.1_f64, prop::bool::ANY),
        (reach, radius, instant) in (1e-3..4e-3_f64, 0.0..3e-3_f64, 0.0..1.0_f64),
    ) {
        let (scene, obstacles) = (Scene::sheet(), obstacles());
        let (mesh, own) = (scene.mesh().with_obstacles(&obstacles), scene.x.len());
        let with_obstacles = |x: &[Vector3<f64>]| {
            x.iter().chain(obstacles.iter().flat_map(|core| &core.vertices)).copied().collect::<Vec<_>>()
        };
        let halves = vec![0.5 * reach; mesh.vertices()];
        let is_free = (0..mesh.vertices()).map(|vertex| vertex < own).collect();
        let rules = Rules { halves, is_free, with_itself: true, ..Rules::default() };
        let mut search = Search::new(&mesh, &with_obstacles(&scene.x), rules);

        let [from, to] = shapes.map(|shape| with_obstacles(&meandering(&scene, shape)));
        let balls = MovingBalls { ends: [&from, &to], radii: &vec![radius; mesh.vertices()] };
        let is_near = |vertex: usize| norm(subtract(scene.x[vertex], scene.x[middle])) < size;
        let is_changed: Vec<_> = (0..mesh.vertices())
            .map(|vertex| if vertex < own { is_near(vertex) } else { is_obstacle_changed })
            .collect();
        let around = search.pairs_around(&mesh, &balls, &is_changed);
        let mut all = search.pairs(&mesh, &balls);
        let x = at(&from, &to, instant);
        for pair in all_pairs(&mesh).iter().filter(|pair| pair.vertices.iter().any(|vertex| (*vertex as usize) < own)) {
            let [a, b, c, d] = pair.vertices;
            // Triangles meet the point of a ball; edges need not.
            if pair.kind == PairKind::EdgeEdge && (a == b || c == d) {
                continue;
            }
            let apart = Closest::of(pair, &pair.corners(&x)).distance;
            prop_assert!(all.binary_search(pair).is_ok() || apart > reach, "{:?} at {}", pair, apart);
        }
        all.retain(|pair| pair.has_any(&is_changed));
        prop_assert_eq!(around, all);
    }
}

/// A ball, a rail, a tetrahedron and a plane near the sheet.
fn obstacles() -> [Core; 4] {
    let tetrahedron = [[0.0, 0.02, 0.003], [0.01, 0.02, 0.013], [0.0, 0.03, 0.013], [0.01, 0.03, 0.013]];
    let plane = [[-9.0, -9.0, -0.01], [9.0, -9.0, -0.01], [0.0, 9.0, -0.01]];
    [
        Core { vertices: vec![[0.03, 0.0, 0.005]], segments: vec![[0, 0]], ..Core::default() },
        Core {
            vertices: vec![[-0.05, -0.02, 0.004], [0.0, -0.03, 0.004]],
            segments: vec![[0, 1]],
            faces: vec![[0, 1, 1]],
            ..Core::default()
        },
        Core {
            vertices: tetrahedron.to_vec(),
            triangles: vec![[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]],
            ..Core::default()
        },
        Core { vertices: plane.to_vec(), faces: vec![[0, 1, 2]], ..Core::default() },
    ]
}
