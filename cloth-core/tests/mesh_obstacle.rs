//! Obstacles made of triangles: no vertex passes through them, and invalid meshes are rejected.

use std::path::Path;

use cloth_core::Simulation;
use cloth_core::scene::Scene;
use tempfile::TempDir;

const TORUS: &str = include_str!("../../scenes/torus.obj");
const SCENE: &str = r#"
dt = 0.01
duration = 0.8
integrator = "newton"
adaptive = true
tolerances.velocity = 1e-3
[[garment]]
fabric = "cotton-shirting"
placement = { translate = [0.01, 0.02, 0.09] }
mesh.disc = { radius = 0.38, rings = 10 }
[[obstacles]]
mesh = { path = "body.obj", rounding = 0.0 }
friction = 0.4
"#;

fn with_body(obj: &str) -> TempDir {
    let folder = TempDir::new().unwrap();
    std::fs::write(folder.path().join("body.obj"), obj).unwrap();
    folder
}

fn simulation(folder: &Path, scene: &str) -> Result<Simulation, String> {
    let scene = Scene::parse(scene, &folder.join("scene.toml")).map_err(|error| error.to_string())?;
    Simulation::new(&scene).map_err(|error| error.to_string())
}

/// Simulates a scene. Returns the smallest signed distance of any vertex at any time, and the final height of the
/// cloth.
fn drape(scene: &str) -> (f64, f64) {
    let folder = with_body(TORUS);
    let mut simulation = simulation(folder.path(), scene).unwrap();
    let mut deepest = f64::INFINITY;
    while !simulation.is_finished() {
        simulation.step().unwrap();
        let solid = simulation.obstacles()[0].at(simulation.time());
        deepest = simulation.positions().iter().map(|&x| solid.signed_distance(x)).fold(deepest, f64::min);
    }
    let x = simulation.positions();
    (deepest, x.iter().map(|p| p[2]).sum::<f64>() / x.len() as f64)
}

#[test]
fn no_vertex_passes_through() {
    let (deepest, height) = drape(SCENE);
    assert!(deepest > 0.0, "{deepest}");
    assert!(height > -0.25, "it hangs on the torus: {height}");
    // With rounding the torus is larger. Another torus lifts the cloth and turns under it.
    let rounded = SCENE.replace("rounding = 0.0", "rounding = 0.01").replace("0.09]", "0.1]");
    let (deepest, _) = drape(&rounded);
    assert!(deepest > 0.0, "{deepest}");
    let moving = format!(
        "{SCENE}\n[obstacles.motion]\n\
         keys = [{{ time = 0.3 }}, {{ time = 0.7, angle = 30.0, translate = [0.0, 0.1, 0.1] }}]\n"
    );
    let (deepest, lifted) = drape(&moving);
    assert!(deepest > 0.0 && lifted > height + 0.05, "{deepest} {lifted}");
}

/// A faceted torus acts like a smooth one: friction alone keeps a cloth balanced that slides off without it.
#[test]
fn friction_holds_on_a_mesh() {
    let turned = SCENE
        .replace("rounding = 0.0", "placement.rotate = { axis = [0.0, 1.0, 0.0], angle = 20.0 }")
        .replace("0.09]", "0.16]");
    let ends = |friction: &str| {
        let folder = with_body(TORUS);
        let mut simulation = simulation(folder.path(), &turned.replace("friction = 0.4", friction)).unwrap();
        while !simulation.is_finished() {
            simulation.step().unwrap();
        }
        let x = simulation.positions();
        x.iter().map(|p| p[0]).sum::<f64>() / x.len() as f64
    };
    let (held, slid) = (ends("friction = 0.8"), ends("friction = 0.0"));
    assert!(slid > held + 0.01, "{held} {slid}");
}

#[test]
fn invalid_meshes_are_rejected_with_file_and_remedy() {
    let tetrahedron = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
    let message = |obj: &str, scene: &str| {
        let folder = with_body(obj);
        simulation(folder.path(), scene).unwrap_err()
    };
    let expect = |obj: &str, parts: &[&str]| {
        let text = message(obj, SCENE);
        assert!(text.starts_with("mesh 0: ") && parts.iter().all(|part| text.contains(part)), "{text}");
    };
    let aside = SCENE.replace("rounding = 0.0", "placement.translate = [0.0, 0.0, -2.0]");
    assert!(simulation(with_body(tetrahedron).path(), &aside).is_ok());
    expect(&tetrahedron.replace("f 1 2 4", "f 1 2 9"), &["body.obj:6: the face refers to a vertex"]);
    expect(&tetrahedron.replace("v 0 0 1", "v 0 0 one"), &["body.obj:4: "]);
    expect(
        &format!("{tetrahedron}v 0 0 -1\nf 1 2 5\n"),
        &["body.obj:10: edge 0–1 is shared by 3 triangles", "at most two"],
    );
    expect(&tetrahedron.replace("f 1 2 4", "f 2 1 4"), &["body.obj: triangles", "make the normals consistent"]);
    let inwards = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 4 2\nf 1 3 4\nf 2 4 3\n";
    expect(inwards, &["body.obj: the surface is inside out", "flip its normals"]);
    expect("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", &["body.obj: the surface is open (3 edges", "`rounding`"]);
    let text = message(tetrahedron, &SCENE.replace("body.obj", "missing.obj"));
    assert!(text.contains("cannot read") && text.contains("missing.obj"), "{text}");
    let text = message(tetrahedron, &SCENE.replace("rounding = 0.0", "rouding = 0.0"));
    assert!(text.contains("unknown field `rouding`") && text.contains("did you mean `rounding`?"), "{text}");
    let text = message(tetrahedron, &SCENE.replace("[[obstacles]]", "[[obstacles]]\nsphere = { radius = 1.0 }"));
    assert!(text.contains("exactly one of `plane`, `sphere`, `capsule`, `box` and `mesh`"), "{text}");
}
