//! Random impacts at up to 100 m/s with a thickness of 1 mm, on obstacles and on cloth: none passes.
//! `IMPACTS=10000 cargo test --release -p cloth-core --test all random_impacts::` shoots ten thousand times.

use cloth_core::Simulation;
use cloth_core::scene::Scene;
use proptest::prelude::*;
use proptest::test_runner::{Config, TestRunner};

/// Impacts in CI.
const IMPACTS: u32 = 300;
/// The size of a step, in s: the fastest shot travels a metre in each.
const DT: f64 = 0.01;
/// The height from which shots come, in m.
const HEIGHT: f64 = 0.9;

const FABRIC: &str = "fabric = { density = 0.2, thickness = 1e-3, material.stvk = { stretch_stiffness = 40.0, \
                      poisson_ratio = 0.3, bending.flat.stiffness = 1e-5 } }\n";

/// A random impact.
#[derive(Clone, Debug)]
struct Impact {
    text: String,
    target: Target,
    steps: usize,
}

/// The obstacle that is hit.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Target {
    /// A solid, from outside.
    Solid,
    /// The upper side of a sheet in the plane z = 0, held at its boundary.
    Net,
}

/// The half width of the net, in m.
const NET: f64 = 0.4;

fn solid() -> impl Strategy<Value = String> {
    let turn = (prop::array::uniform3(0.1..1.0_f64), -180.0..180.0_f64)
        .prop_map(|(axis, angle)| format!("rotate = {{ axis = {axis:?}, angle = {angle:?} }}"));
    prop_oneof![
        (1e-3..0.1_f64).prop_map(|radius| format!("sphere = {{ radius = {radius:?} }}")),
        (prop::array::uniform3(0.01..0.3_f64), 1e-3..0.05_f64).prop_map(|(to, radius)| {
            let from = to.map(|component| -component);
            format!("capsule = {{ from = {from:?}, to = {to:?}, radius = {radius:?} }}")
        }),
        (0.2..0.6_f64, 1e-3..0.02_f64, turn)
            .prop_map(|(width, thin, turn)| { format!("box = {{ size = [{width:?}, {width:?}, {thin:?}], {turn} }}") }),
        Just("box = { size = [0.5, 0.5, 0.001] }".to_owned()),
        prop::array::uniform2(-0.5..0.5_f64).prop_map(|[x, y]| format!("plane = {{ normal = [{x:?}, {y:?}, 1.0] }}")),
    ]
}

/// A patch of cloth of 2 × 2 cells, with a random size, place, turn and motion. It starts above, and flies towards the
/// origin.
fn patch(speed: f64, [x, y]: [f64; 2], turn: [f64; 3], spin: [f64; 3], size: f64) -> String {
    let velocity = [-speed * x / HEIGHT, -speed * y / HEIGHT, -speed];
    format!(
        "[[garment]]\nname = \"patch\"\nmesh.sheet = {{ cells = [2, 2], size = [{size:?}, {size:?}] }}\n\
         placement = {{ translate = [{x:?}, {y:?}, {HEIGHT:?}], rotate = {{ axis = {turn:?}, angle = 77.0 }} }}\n\
         velocity = {velocity:?}\nspin = {spin:?}\n{FABRIC}"
    )
}

fn impact() -> impl Strategy<Value = Impact> {
    let aside = prop::array::uniform2(-0.3..0.3_f64);
    let shot = (5.0..100.0_f64, aside, prop::array::uniform3(0.1..1.0_f64), prop::array::uniform3(-30.0..30.0_f64));
    let shot = (shot, 0.01..0.12_f64)
        .prop_map(|((speed, aside, turn, spin), size)| (speed, patch(speed, aside, turn, spin, size)));
    let head = "duration = 1.0\nintegrator = \"newton\"\nadaptive = true\ntolerances.velocity = 1e-2\n\
                gravity = [0.0, 0.0, 0.0]\n";
    let target = prop_oneof![
        solid().prop_map(|solid| (format!("[[obstacles]]\n{solid}\nthickness = 0.001\n"), Target::Solid)),
        (2..7_usize).prop_map(|cells| {
            let size = 2.0 * NET;
            let net = format!(
                "[[garment]]\nname = \"net\"\nmesh.sheet = {{ cells = [{cells}, {cells}], size = [{size}, {size}] }}\n\
                 {FABRIC}[[pins]]\nof = \"net\"\nboundary = true\n"
            );
            (net, Target::Net)
        }),
    ];
    (shot, target, any::<bool>()).prop_map(move |((speed, patch), (hit, target), moves)| {
        // The solid flies and the patch waits, or the other way round. They meet, and then one step more.
        let steps = (HEIGHT / (speed * DT)).ceil() as usize + 1;
        let motion = format!("motion.keys = [{{ time = 0.0 }}, {{ time = 1.0, translate = [0.0, 0.0, {speed:?}] }}]\n");
        let text = if moves && target == Target::Solid {
            let still = patch.lines().filter(|line| !line.starts_with("velocity")).collect::<Vec<_>>().join("\n");
            format!("dt = {DT:?}\n{head}{still}\n{hit}{motion}")
        } else {
            format!("dt = {DT:?}\n{head}{patch}{hit}")
        };
        Impact { text, target, steps }
    })
}

/// The solid angle of some triangles seen from a point, over 4π (van Oosterom and Strackee 1983).
fn solid_angle(p: [f64; 3], triangles: &[[[f64; 3]; 3]]) -> f64 {
    let one = |corners: &[[f64; 3]; 3]| {
        let [a, b, c] = corners.map(|corner| [0, 1, 2].map(|axis| corner[axis] - p[axis]));
        let dot = |u: [f64; 3], v: [f64; 3]| u[0] * v[0] + u[1] * v[1] + u[2] * v[2];
        let cross = [b[1] * c[2] - b[2] * c[1], b[2] * c[0] - b[0] * c[2], b[0] * c[1] - b[1] * c[0]];
        let [x, y, z] = [a, b, c].map(|side| dot(side, side).sqrt());
        2.0 * dot(a, cross).atan2(x * y * z + dot(a, b) * z + dot(a, c) * y + dot(b, c) * x)
    };
    triangles.iter().map(one).sum::<f64>() / (4.0 * std::f64::consts::PI)
}

/// Whether a point is above the net: net and flat sheet enclose what lies between them.
fn is_above_net(simulation: &Simulation, p: [f64; 3]) -> bool {
    let range = simulation.parts()[1].vertices.clone();
    let net = simulation.triangles().iter().filter(|corners| range.contains(&corners[0]));
    let x = simulation.positions();
    let net: Vec<_> = net.map(|corners| corners.map(|corner| x[corner])).collect();
    let corner = |x: f64, y: f64| [NET * x, NET * y, 0.0];
    let flat = [
        [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0)],
        [corner(-1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)],
    ];
    // Far above, both are seen from the same side.
    let above = [0.0, 0.0, 50.0];
    let turn = (solid_angle(above, &net) * solid_angle(above, &flat)).signum();
    let is_between = (turn * solid_angle(p, &net) - solid_angle(p, &flat)).abs() > 0.5;
    (p[2] > 0.0) != is_between
}

/// Runs an impact. Returns whether the patch met anything, or an error if it passed.
fn check_impact(Impact { text, target, steps }: &Impact) -> Result<bool, TestCaseError> {
    let scene = Scene::parse(text, "impact.toml".as_ref()).unwrap_or_else(|error| panic!("{error}"));
    let mut simulation = Simulation::new(&scene).unwrap_or_else(|error| panic!("{error}"));
    let patch = simulation.parts()[0].vertices.clone();
    for step in 0..*steps {
        if let Err(error) = simulation.step() {
            return Err(TestCaseError::fail(format!("step {step}: {error}")));
        }
        prop_assert_eq!(simulation.crossings(), []);
        prop_assert_eq!(simulation.obstacle_crossings(), 0, "step {}", step);
        for &x in &simulation.positions()[patch.clone()] {
            prop_assert!(x.iter().all(|coordinate| coordinate.is_finite()));
            let is_within = x[0].hypot(x[1]) < 0.8 * NET;
            match target {
                Target::Solid => {
                    let solid = simulation.obstacles()[0].at(simulation.time());
                    prop_assert!(solid.signed_distance(x) > 0.0, "step {}: {:?}", step, x);
                }
                Target::Net => prop_assert!(!is_within || is_above_net(&simulation, x), "step {}: {:?}", step, x),
            }
        }
    }
    let work = simulation.summary().unwrap().totals.contact;
    Ok(work.shortened > 0 || work.active > 0)
}

#[test]
fn no_random_impact_passes() {
    let impacts = std::env::var("IMPACTS").ok().and_then(|count| count.parse().ok()).unwrap_or(IMPACTS);
    let hits = std::cell::Cell::new(0_u32);
    let config = Config { cases: impacts, failure_persistence: None, ..Config::default() };
    TestRunner::new(config)
        .run(&impact(), |impact| {
            hits.set(hits.get() + u32::from(check_impact(&impact)?));
            Ok(())
        })
        .unwrap_or_else(|error| panic!("{error}"));
    assert!(2 * hits.get() > impacts, "only {} of {impacts} met anything", hits.get());
}
