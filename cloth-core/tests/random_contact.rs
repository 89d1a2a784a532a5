//! Random drops, pulls and folds of small sheets, also onto obstacles: no state has a crossing or a NaN, and no step
//! stalls without saying so.
//!
//! `PROPTEST_CASES=4000 cargo test --release -p cloth-core --test all random_contact::` runs a hundred thousand steps.

use std::path::Path;

use cloth_core::Simulation;
use cloth_core::scene::Scene;
use proptest::prelude::*;
use proptest::test_runner::TestCaseError;

const STEPS: usize = 25;
/// Scenes in CI: a thousand steps.
const SCENES: u32 = 40;

/// A fabric, from soft and thick to stiff and thin.
pub(super) fn fabric() -> impl Strategy<Value = String> {
    let material = prop::sample::select(vec!["stvk", "neo-hookean", "stable-neo-hookean"]);
    (material, 0.7..2.5_f64, 0.1..0.4_f64, -3.5..-2.7_f64, 0.0..0.8_f64, -7.0..-4.0_f64).prop_map(
        |(material, stiffness, density, thickness, friction, bending)| {
            format!(
                "fabric = {{ density = {density:?}, thickness = {:?}, friction = {friction:?}, material.{material} = \
                 {{ stretch_stiffness = {:?}, poisson_ratio = 0.3, bending.flat.stiffness = {:?} }} }}\n",
                10_f64.powf(thickness),
                10_f64.powf(stiffness),
                10_f64.powf(bending)
            )
        },
    )
}

pub(super) fn sheet(name: &str, cells: usize, at: [f64; 3], rest: &str, fabric: &str) -> String {
    let size = 0.025 * cells as f64;
    format!(
        "[[garment]]\nname = \"{name}\"\nplacement.translate = {at:?}\n\
         mesh.sheet = {{ cells = [{cells}, {cells}], size = [{size:?}, {size:?}] }}\n{rest}{fabric}"
    )
}

/// A vector with components up to a size.
pub(super) fn vector(size: f64) -> impl Strategy<Value = [f64; 3]> {
    prop::array::uniform3(-size..size)
}

/// A spinning sheet flies onto another, which is held at its edge.
fn drop() -> impl Strategy<Value = String> {
    (fabric(), fabric(), vector(0.02), vector(1.0), vector(20.0), 0.0..10.0_f64).prop_map(
        |(net, cloth, offset, drift, spin, speed)| {
            let velocity = [drift[0], drift[1], -speed];
            let motion = format!("velocity = {velocity:?}\nspin = {spin:?}\n");
            let at = [offset[0], offset[1], 0.08];
            let held = "[[pins]]\nof = \"net\"\nboundary = true\n";
            sheet("net", 8, [0.0; 3], "", &net) + &sheet("cloth", 4, at, &motion, &cloth) + held
        },
    )
}

/// A spinning sheet flies onto a solid that turns, just above a floor or far above it. Just above it, a solid may push
/// cloth into a gap that is too narrow for it: then the scene demands the impossible.
fn drop_on_solids() -> impl Strategy<Value = (String, bool)> {
    let solid = prop_oneof![
        (0.005..0.03_f64).prop_map(|radius| format!("sphere = {{ radius = {radius:?} }}")),
        (vector(0.06), 0.003..0.02_f64).prop_map(|(to, radius)| {
            format!("capsule = {{ from = [0.0, 0.0, -0.01], to = {to:?}, radius = {radius:?} }}")
        }),
        prop::array::uniform3(0.005..0.06_f64).prop_map(|size| format!("box = {{ size = {size:?} }}")),
    ];
    let floor = prop::sample::select(vec![-0.03, -0.12]);
    (fabric(), solid, vector(1.0), vector(20.0), 0.0..10.0_f64, 0.0..0.8_f64, -300.0..300.0_f64, floor).prop_map(
        |(cloth, solid, drift, spin, speed, friction, angle, floor)| {
            let motion = format!("velocity = {:?}\nspin = {spin:?}\n", [drift[0], drift[1], -speed]);
            let turns = format!(
                "friction = {friction:?}\nmotion.keys = [{{ time = 0.0 }}, {{ time = 1.0, angle = {angle:?} }}]\n"
            );
            let plane = format!("[[obstacles]]\nplane = {{ point = [0.0, 0.0, {floor:?}] }}\nfriction = 0.3\n");
            let text = sheet("cloth", 5, [0.011, 0.007, 0.16], &motion, &cloth)
                + &format!("[[obstacles]]\n{solid}\nthickness = 0.002\n{turns}{plane}");
            (text, floor > -0.1)
        },
    )
}

/// The corners of a sheet are pulled to random places.
fn pull() -> impl Strategy<Value = String> {
    let corner = prop::option::weighted(0.7, vector(0.1));
    (fabric(), prop::array::uniform4(corner), 0.05..0.5_f64).prop_map(|(fabric, corners, time)| {
        let ends = [[-0.1, -0.1, 0.0], [0.1, -0.1, 0.0], [0.1, 0.1, 0.0], [-0.1, 0.1, 0.0]];
        let pins = ends.iter().zip(corners).filter_map(|(end, to)| {
            let to: [f64; 3] = std::array::from_fn(|axis| to.map_or(f64::NAN, |to| 0.8 * (to[axis] - end[axis])));
            let keys = format!("[{{ time = 0.0 }}, {{ time = {time:?}, translate = {to:?} }}]");
            to[0].is_finite().then(|| format!("[[pins]]\nnearest = {end:?}\nmotion.keys = {keys}\n"))
        });
        sheet("cloth", 8, [0.0; 3], "", &fabric) + &pins.collect::<String>()
    })
}

/// One edge of a sheet is laid over the opposite one, and beyond.
fn fold() -> impl Strategy<Value = String> {
    (fabric(), 0.1..0.3_f64, 0.01..0.05_f64, 0.1..0.5_f64).prop_map(|(fabric, way, height, time)| {
        let edge = |low: f64, high: f64| format!("box = {{ min = [{low:?}, -1.0, -1.0], max = [{high:?}, 1.0, 1.0] }}");
        let keys = format!(
            "[{{ time = 0.0 }}, {{ time = {:?}, translate = [{:?}, 0.0, {height:?}] }}, \
             {{ time = {time:?}, translate = [{way:?}, 0.0, {:?}] }}]",
            0.5 * time,
            0.5 * way,
            0.2 * height
        );
        let (fixed, moving) = (edge(0.099, 0.101), edge(-0.101, -0.099));
        sheet("cloth", 8, [0.0; 3], "", &fabric)
            + &format!("[[pins]]\n{fixed}\n[[pins]]\n{moving}\nmotion.keys = {keys}\n")
    })
}

/// A scene, and whether it may demand the impossible, as moving pins do.
fn scene() -> impl Strategy<Value = (String, bool)> {
    let drops = prop_oneof![drop().prop_map(|text| (text, false)), drop_on_solids()];
    let moving_pins = prop_oneof![pull(), fold()].prop_map(|text| (text, true));
    prop_oneof![drops, moving_pins]
}

/// The number of scenes to run.
pub(super) fn scenes() -> u32 {
    std::env::var("PROPTEST_CASES").ok().and_then(|cases| cases.parse().ok()).unwrap_or(SCENES)
}

/// Runs a scene, and checks it: nothing crosses, all positions are finite, and a step fails only if the scene may demand
/// the impossible.
pub(super) fn check_run(dt: f64, rest: &str, may_be_impossible: bool) -> Result<(), TestCaseError> {
    let text = format!(
        "dt = {dt:?}\nduration = 10.0\nintegrator = \"newton\"\ncontact = \"on\"\nadaptive = true\n\
         tolerances.velocity = 1e-3\ndrag = 0.5\n{rest}"
    );
    let beside_meshes = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes/random.toml");
    let parsed = Scene::parse(&text, &beside_meshes).unwrap_or_else(|error| panic!("{error}"));
    let mut simulation = Simulation::new(&parsed).unwrap_or_else(|error| panic!("{error}"));
    for step in 0..STEPS {
        if let Err(error) = simulation.step() {
            println!("step {step}: {error}");
            prop_assert!(may_be_impossible, "step {}: {}", step, error);
            break;
        }
        prop_assert_eq!(simulation.crossings(), []);
        prop_assert_eq!(simulation.obstacle_crossings(), 0, "step {}", step);
        prop_assert!(simulation.positions().as_flattened().iter().all(|coordinate| coordinate.is_finite()));
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: scenes(), ..ProptestConfig::default() })]

    #[test]
    fn no_random_scene_has_a_crossing_or_a_nan(
        dt in 0.001..0.033_f64,
        (text, may_be_impossible) in scene(),
    ) {
        check_run(dt, &text, may_be_impossible)?;
    }
}
