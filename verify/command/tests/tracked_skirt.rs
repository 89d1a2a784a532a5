//! A skirt that swings, simulated by `cloth-core` and tracked by `fusion-core`: the truth is not the tracker's own
//! skinning. One bone, the hips, moves as the waistband does; everything else must come from the depth images.

use std::fmt::Write as _;

use cloth_core::{Simulation, scene::Scene};
use fusion_core::body::{Bone, Mesh, SkinnedBody};
use fusion_core::depth::{Camera, SensorNoise, render, visible_vertices};
use fusion_core::evaluation::{ErrorSummary, SurfaceDistance};
use fusion_core::model::{DeformationModel, ModelOptions};
use fusion_core::tracker::{Tracker, TrackerOptions};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

const AROUND: usize = 72;
const DOWN: usize = 24;
/// Steps of 10 ms between two images.
const STEPS: u64 = 3;
const FRAMES: u64 = 20;

/// Returns an A-line with its waist at a height of 0.5 m, as OBJ text. Wider skirts fall into deep folds, because no
/// legs are below.
fn skirt() -> String {
    let mut text = String::new();
    for ring in 0..=DOWN {
        let down = ring as f64 / DOWN as f64;
        for at in 0..AROUND {
            let (sin, cos) = (std::f64::consts::TAU * at as f64 / AROUND as f64).sin_cos();
            let radius = 0.14 + 0.06 * down;
            writeln!(text, "v {} {} {}", radius * cos, radius * sin, 0.5 - 0.5 * down).unwrap();
        }
    }
    for ring in 0..DOWN {
        for at in 0..AROUND {
            let next = (at + 1) % AROUND;
            let [a, b] = [at, next].map(|at| ring * AROUND + at + 1);
            let [c, d] = [a + AROUND, b + AROUND];
            writeln!(text, "f {a} {c} {d}\nf {a} {d} {b}").unwrap();
        }
    }
    text
}

/// The waist turns to and fro, and moves to the side.
const SCENE: &str = r#"
    dt = 0.01
    duration = 0.9
    integrator = "newton"
    contact = "off"
    drag = 0.3
    [[garment]]
    name = "skirt"
    fabric = "denim"
    mesh.obj = { path = "skirt.obj" }
    [[pins]]
    box = { min = [-1.0, -1.0, 0.499], max = [1.0, 1.0, 0.501] }
    [pins.motion]
    interpolation = "cubic"
    keys = [
        { time = 0.0 },
        { time = 0.3, angle = 10.0, translate = [0.06, 0.0, 0.0] },
        { time = 0.9, angle = -10.0, translate = [-0.06, 0.0, 0.03] },
    ]
"#;

/// Returns the motion from the world, z up, to a camera 1.5 m in front of the skirt.
fn to_camera() -> Isometry3<f64> {
    let turn = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::FRAC_PI_2);
    Isometry3::from_parts(Translation3::new(0.0, 0.25, 1.5), turn)
}

/// Positions of the skirt in the camera's coordinates, and the motion of its waist from the start.
struct Frame {
    vertices: Vec<Vector3<f64>>,
    waist: Isometry3<f64>,
}

fn frame(simulation: &Simulation) -> Frame {
    let to_camera = to_camera();
    let places: Vec<Vector3<f64>> = simulation.positions().iter().map(|&place| place.into()).collect();
    let centre = places[..AROUND].iter().sum::<Vector3<f64>>() / AROUND as f64;
    let forwards = places[0] - centre;
    let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), forwards.y.atan2(forwards.x));
    let waist = Isometry3::from_parts((centre - turn * Vector3::new(0.0, 0.0, 0.5)).into(), turn);
    let vertices = places.iter().map(|&place| to_camera.transform_point(&place.into()).coords).collect();
    Frame { vertices, waist: to_camera * waist * to_camera.inverse() }
}

#[test]
fn a_swinging_skirt_is_followed() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("skirt.obj"), skirt()).unwrap();
    let scene = Scene::parse(SCENE, &folder.path().join("scene.toml")).unwrap();
    let mut simulation = Simulation::new(&scene).unwrap();
    let triangles: Vec<[u32; 3]> = simulation.triangles().iter().map(|corners| corners.map(|at| at as u32)).collect();
    let mesh = Mesh::new(frame(&simulation).vertices, triangles.clone());
    let [head, tail] = [0.5, 0.6].map(|z| (to_camera() * nalgebra::Point3::new(0.0, 0.0, z)).coords.into());
    let hips = Bone { name: "Hips".to_owned(), parent: None, head, tail };
    let weights = vec![vec![(0, 1.0)]; mesh.vertices.len()];
    let body = SkinnedBody { mesh, bones: vec![hips], weights };
    let model = DeformationModel::new(&body, ModelOptions::default()).unwrap();
    let mut tracker = Tracker::new(model, Camera::VGA, TrackerOptions::default()).unwrap();

    let (mut tracked, mut skinned) = (Vec::new(), Vec::new());
    for at in 0..FRAMES {
        for _ in 0..STEPS {
            simulation.step().unwrap();
        }
        let Frame { vertices, waist } = frame(&simulation);
        let truth = Mesh::new(vertices, triangles.clone());
        let mut image = render(&truth, &Camera::VGA);
        SensorNoise::default().add(&mut image, &mut fastrand::Rng::with_seed(at));
        tracker.track(&image, Some(&[waist])).unwrap();
        let seen = visible_vertices(&truth, &Camera::VGA);
        let distance = SurfaceDistance::new(&truth);
        let visible: Vec<usize> = (0..seen.len()).filter(|&at| seen[at]).collect();
        let errors =
            |found: &[Vector3<f64>]| visible.iter().map(|&at| 1e3 * distance.of(&found[at])).collect::<Vec<_>>();
        tracked.extend(errors(&tracker.vertices()));
        skinned.extend(errors(&body.posed(&[waist]).vertices));
    }
    let (tracked, skinned) = (ErrorSummary::of(tracked), ErrorSummary::of(skinned));
    println!("a swinging skirt: mean {:.1} mm; the hips alone {:.1} mm", tracked.mean, skinned.mean);
    // The skirt moves against the hips, and most of that is tracked.
    assert!(tracked.mean <= 10.0 && skinned.mean > 2.0 * tracked.mean, "{tracked:?}; the hips alone: {skinned:?}");
}
