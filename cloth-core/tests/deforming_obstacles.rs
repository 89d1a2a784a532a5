//! Obstacles that deform, from a sequence of OBJ files.

use std::path::Path;
use std::process::Command;

use cloth_core::Simulation;
use cloth_core::scene::Scene;
use tempfile::TempDir;

/// A block of 0.2 × 0.2 × 0.1 m around a place, with its upper corners moved.
fn block(at: [f64; 3], lifted: f64) -> String {
    let corner = |number: usize| {
        let side = |bit: usize| if number >> bit & 1 == 1 { 1.0 } else { -1.0 };
        let z = 0.05 * side(2) + if number == 7 { lifted } else { 0.0 };
        format!("v {:.9} {:.9} {:.9}\n", at[0] + 0.1 * side(0), at[1] + 0.1 * side(1), at[2] + z)
    };
    let faces = "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n";
    (0..8).map(corner).collect::<String>() + faces
}

/// The path of the block: up, then aside.
const PATH: [[f64; 3]; 4] = [[0.0, 0.0, 0.0], [0.0, 0.0, 0.02], [0.01, 0.0, 0.03], [0.03, 0.0, 0.03]];

fn write_frames(folder: &Path, lifted: f64) {
    for (number, at) in PATH.iter().enumerate() {
        let text = block(*at, lifted * number as f64 / 3.0);
        std::fs::write(folder.join(format!("body_{number}.obj")), text).unwrap();
    }
}

fn scene(mesh: &str, rest: &str) -> String {
    format!(
        r#"
        dt = 0.01
        duration = 0.5
        integrator = "newton"
        adaptive = true
        tolerances.velocity = 1e-6
        {rest}
        [[garment]]
        name = "cloth"
        placement.translate = [0.004, 0.003, 0.0545]
        mesh.sheet = {{ cells = [7, 6], size = [0.16, 0.14] }}
        fabric = {{ density = 0.2, material.stvk = {{ stretch_stiffness = 40.0, poisson_ratio = 0.3 }} }}
        [[obstacles]]
        name = "body"
        friction = 0.6
        {mesh}
        "#
    )
}

const FRAMES: &str = "mesh = { path = \"body_*.obj\", frames_per_second = 10.0 }";

fn simulate(text: &str, folder: &Path, steps: usize) -> Simulation {
    let scene = Scene::parse(text, &folder.join("scene.toml")).unwrap_or_else(|error| panic!("{error}"));
    let mut simulation = Simulation::new(&scene).unwrap_or_else(|error| panic!("{error}"));
    for _ in 0..steps {
        simulation.step().unwrap_or_else(|error| panic!("{error}"));
        assert_eq!((simulation.crossings(), simulation.obstacle_crossings()), (vec![], 0));
    }
    simulation
}

#[test]
fn frames_of_a_rigid_body_are_its_motion() {
    let folder = TempDir::new().unwrap();
    write_frames(folder.path(), 0.0);
    let keys: Vec<String> =
        (0..4).map(|n| format!("{{ time = {:.1}, translate = {:?} }}", 0.1 * n as f64, PATH[n])).collect();
    let rigid = format!("mesh.path = \"body_0.obj\"\nmotion.keys = [{}]", keys.join(", "));
    let [moved, framed] = [&rigid[..], FRAMES].map(|mesh| simulate(&scene(mesh, ""), folder.path(), 45));
    let far = |a: &[f64; 3], b: &[f64; 3]| (0..3).map(|axis| (a[axis] - b[axis]).abs()).fold(0.0, f64::max);
    let apart = moved.positions().iter().zip(framed.positions()).map(|(a, b)| far(a, b)).fold(0.0, f64::max);
    assert!(apart < 1e-5, "{apart} m");
    let middle = framed.positions().iter().map(|x| x[0]).sum::<f64>() / 56.0;
    // When the body stops at once, the cloth slides on by at most v²/(2 μ g) = 3.4 mm.
    assert!((0.033..0.0375).contains(&middle), "friction carries the cloth along, to {middle} m");
}

#[test]
fn cloth_follows_a_body_that_deforms() {
    let folder = TempDir::new().unwrap();
    write_frames(folder.path(), 0.06);
    let pin = "[[pins]]\nof = \"cloth\"\nobstacle = \"body\"\nnearest = [0.08, 0.07, 0.05]";
    let simulation = simulate(&(scene(FRAMES, "") + pin), folder.path(), 40);
    let highest = simulation.positions().iter().map(|x| x[2]).fold(0.0, f64::max);
    assert!(highest > 0.11, "the corner of the body lifts the cloth to {highest} m");
    let pinned = (0..56).find(|&vertex| simulation.is_pinned(vertex)).unwrap();
    let height = simulation.positions()[pinned][2];
    assert!(height > 0.1, "the pin follows the surface to {height} m");
}

#[test]
fn files_and_pictures_show_the_deformation_and_a_resumed_run_repeats_it() {
    let folder = TempDir::new().unwrap();
    write_frames(folder.path(), 0.06);
    std::fs::write(folder.path().join("scene.toml"), scene(FRAMES, "").replace("duration = 0.5", "duration = 0.16"))
        .unwrap();
    let cloth = |arguments: &[&str]| {
        let run =
            Command::new(env!("CARGO_BIN_EXE_cloth")).args(arguments).current_dir(folder.path()).output().unwrap();
        (
            run.status.success(),
            String::from_utf8_lossy(&run.stdout).into_owned() + &String::from_utf8_lossy(&run.stderr),
        )
    };
    let (succeeded, told) = cloth(&["run", "scene.toml", "-o", "out", "--checkpoint", "7"]);
    assert!(succeeded, "{told}");
    let usd = std::fs::read_to_string(folder.path().join("out/cloth.usda")).unwrap();
    let body = usd.split("def Mesh \"body\"").nth(1).unwrap();
    assert!(body.contains("point3f[] points.timeSamples"), "the body moves");
    std::fs::remove_file(folder.path().join("out/cloth.usda")).unwrap();
    let (succeeded, told) = cloth(&["resume", "out"]);
    assert!(succeeded, "{told}");
    assert_eq!(std::fs::read_to_string(folder.path().join("out/cloth.usda")).unwrap(), usd);
    // An edited frame is noticed.
    std::fs::write(folder.path().join("body_2.obj"), block(PATH[2], 0.05)).unwrap();
    let (succeeded, told) = cloth(&["resume", "out"]);
    assert!(!succeeded && told.contains("body_2.obj"), "{told}");
}

#[test]
fn wrong_frames_are_refused_with_the_reason() {
    let folder = TempDir::new().unwrap();
    write_frames(folder.path(), 0.0);
    let refused = |text: &str| {
        let scene = Scene::parse(text, &folder.path().join("scene.toml"));
        let simulation = scene
            .map_err(|error| error.to_string())
            .and_then(|scene| Simulation::new(&scene).map_err(|error| error.to_string()));
        simulation.map(|_| ()).unwrap_err()
    };
    let message = refused(&scene(&FRAMES.replace("body_*", "figure_*"), ""));
    assert!(message.contains("no file matches") && message.contains("figure_*.obj"), "{message}");
    let message = refused(&scene(&FRAMES.replace(", frames_per_second = 10.0", ""), ""));
    assert!(
        message.contains("body_*.obj has a `*`") && message.contains("`frames_per_second` is missing"),
        "{message}"
    );
    let message = refused(&scene(FRAMES, "contact = \"off\""));
    assert!(message.contains("frames_per_second") && message.contains("newton"), "{message}");
    let message = refused(&scene(&format!("{FRAMES}\nmotion.keys = [{{ time = 0.0 }}]"), ""));
    assert!(message.contains("leave out `motion`"), "{message}");
    let soft = "[[pins]]\nof = \"cloth\"\nobstacle = \"body\"\nnearest = [0.0, 0.0, 0.05]\nstiffness = 3.0";
    let message = refused(&(scene(FRAMES, "") + soft));
    assert!(message.contains("which deforms"), "{message}");
    std::fs::write(folder.path().join("body_3.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    let message = refused(&scene(FRAMES, ""));
    assert!(message.contains("body_3.obj has other vertices or faces than"), "{message}");
    std::fs::rename(folder.path().join("body_3.obj"), folder.path().join("body_5.obj")).unwrap();
    let message = refused(&scene(FRAMES, ""));
    assert!(message.contains("body: no file has the number 3: "), "{message}");
}
