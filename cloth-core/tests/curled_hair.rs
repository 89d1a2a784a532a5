//! Hair with a natural curl takes known shapes, and keeps them in checkpoints.

use cloth_core::Simulation;
use cloth_core::scene::Scene;

/// A strand of 0.1 m whose parts are set by each test.
fn strand(segments: usize, gravity: f64, rest: &str) -> Simulation {
    let text = format!(
        "dt = 0.01\nduration = 4.0\nintegrator = \"newton\"\nadaptive = true\ndrag = 6.0\n\
         gravity = [0.0, 0.0, {gravity}]\ntolerances.velocity = 1e-6\n\
         [[hair]]\ncount = 1\nsegments = {segments}\nlength = 0.1\ndensity = 1e-4\nstretch_stiffness = 5.0\n{rest}\n"
    );
    Simulation::new(&Scene::parse(&text, "scene.toml".as_ref()).unwrap_or_else(|error| panic!("{text}\n{error}")))
        .unwrap()
}

fn at_rest(mut simulation: Simulation) -> Vec<[f64; 3]> {
    while simulation.steps_done() < simulation.steps() {
        simulation.step().unwrap();
    }
    simulation.positions().to_vec()
}

/// B (θ′ − κ₀)′ = w (L − s) sin θ with w L³/B = 10 and κ₀ L = 1: the tip is at (0.2369775073, 0.9546744979) L. The first
/// segment is clamped, so half of it does not bend.
#[test]
fn a_hanging_curl_has_the_shape_of_its_equation() {
    let bend = 1e-4 * 9.81 * 1e-3 / 10.0;
    let curl = format!("bend_stiffness = {bend}\ncurl = {{ curvature = 10.0, axis = [1.0, 0.0, 0.3] }}");
    let shape = at_rest(strand(80, -9.81, &curl));
    let [x, y, z] = shape[80];
    assert!(x.abs() < 1e-9, "{shape:?}");
    assert!((y / 0.1 - 0.2369775073).abs() < 0.004 && (-z / 0.1 - 0.9546744979).abs() < 0.002, "{y} {z}");
}

/// Without loads, a free strand is a helix: its ends are as far apart as those of r, h and the angle L √(κ² + τ²).
#[test]
fn a_free_curl_is_a_helix() {
    let (curvature, torsion) = (40.0_f64, 25.0_f64);
    for twist in ["", ", twist_stiffness = 1e-7"] {
        let curl = format!(
            "bend_stiffness = 1e-7\nrooted = false\ndirection = [0.0, 1.0, 1.0]\n\
             curl = {{ curvature = {curvature}, torsion = {torsion}{twist} }}"
        );
        let shape = at_rest(strand(60, 0.0, &curl));
        let sum = curvature.powi(2) + torsion.powi(2);
        let (radius, rise, angle) = (curvature / sum, torsion / sum, 0.1 * sum.sqrt());
        let wanted = (2.0 * radius * (angle / 2.0).sin()).hypot(rise * angle);
        let found = (0..3).map(|axis| (shape[60][axis] - shape[0][axis]).powi(2)).sum::<f64>().sqrt();
        assert!((found / wanted - 1.0).abs() < 0.01, "{found} {wanted}");
        // The torsion has its sign: the triple product of three chords.
        let chord =
            |from: usize| -> [f64; 3] { std::array::from_fn(|axis| shape[from + 20][axis] - shape[from][axis]) };
        let [a, b, c] = [0, 20, 40].map(chord);
        let triple = a[0] * (b[1] * c[2] - b[2] * c[1])
            + a[1] * (b[2] * c[0] - b[0] * c[2])
            + a[2] * (b[0] * c[1] - b[1] * c[0]);
        assert!(triple > 0.0, "{triple}");
    }
}

#[test]
fn curls_that_cannot_be_are_refused() {
    for (curl, message) in [
        ("curl = { curvature = 400.0 }", "give at least 26 segments"),
        ("curl = { curvature = 10.0, axis = [0.0, 0.0, 2.0] }", "is along the strand"),
    ] {
        let text = format!(
            "dt = 0.01\nduration = 1.0\nintegrator = \"newton\"\n[[hair]]\ncount = 1\nsegments = 10\nlength = 0.1\n\
             density = 1e-4\nstretch_stiffness = 5.0\nbend_stiffness = 1e-7\n{curl}\n"
        );
        let scene = Scene::parse(&text, "scene.toml".as_ref()).unwrap();
        let error = Simulation::new(&scene).unwrap_err();
        let mut text = error.to_string();
        let mut source = std::error::Error::source(&error);
        while let Some(cause) = source {
            text.push_str(&format!(": {cause}"));
            source = cause.source();
        }
        assert!(text.contains(message), "{text}");
    }
}
