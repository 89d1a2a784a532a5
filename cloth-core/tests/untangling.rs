//! Scenes that start with shallow crossings, and refusals of deep ones.

use cloth_core::scene::Scene;
use cloth_core::{Simulation, SimulationError};

/// A sheet near another or near an obstacle.
fn scene(untangle: bool, slope: f64, others: &str) -> Result<Simulation, SimulationError> {
    let text = format!(
        r#"
        dt = 0.01
        duration = 0.2
        integrator = "newton"
        adaptive = true
        untangle = {untangle}
        {others}
        [[garment]]
        mesh.sheet = {{ cells = [7, 7], size = [0.1, 0.1] }}
        placement.rotate = {{ axis = [0.0, 1.0, 0.0], angle = {slope:?} }}
        fabric = {FABRIC}
        "#
    );
    Simulation::new(&Scene::parse(&text, "s.toml".as_ref()).unwrap_or_else(|error| panic!("{error}")))
}

const FABRIC: &str = "{ density = 0.2, thickness = 1e-3, material.stvk = \
                      { stretch_stiffness = 40.0, poisson_ratio = 0.3, bending.flat.stiffness = 1e-6 } }";

fn ground() -> String {
    format!(
        "[[garment]]\nname = \"ground\"\nplacement.translate = [0.003, 0.002, 0.0]\n\
         mesh.sheet = {{ cells = [9, 9], size = [0.12, 0.12] }}\nfabric = {FABRIC}\n\
         [[pins]]\nof = \"ground\"\nall = true\n"
    )
}

#[test]
fn scenes_that_start_with_shallow_crossings_run() {
    let ball = "[[obstacles]]\nsphere = { centre = [0.0, 0.0, -0.1], radius = 0.1005 }\n";
    let plane = "[[obstacles]]\nplane = {}\n";
    for (slope, others) in [(1.5, &ground()[..]), (0.0, ball), (1.5, plane)] {
        let refused = scene(false, slope, others).unwrap_err();
        assert!(matches!(refused, SimulationError::Contact(_)), "{refused}");
        let mut simulation = scene(true, slope, others).unwrap_or_else(|error| panic!("{others}: {error}"));
        for _ in 0..20 {
            assert_eq!((simulation.crossings(), simulation.obstacle_crossings()), (vec![], 0), "{others}");
            simulation.step().unwrap_or_else(|error| panic!("{others}: {error}"));
        }
    }
}

/// The message names the deepest crossings, with their garments, and does not advise what was tried.
#[test]
fn deep_crossings_are_refused_by_name() {
    let message = scene(true, 70.0, &ground()).unwrap_err().to_string();
    let depths: Vec<f64> =
        message.split(" mm deep").filter_map(|before| before.rsplit(", ").next()?.parse().ok()).collect();
    assert!(depths.len() == 3 && depths.is_sorted_by(|one, other| one >= other), "{message}");
    for part in [" of garment 1 goes through the triangle ", " of ground, ", "`untangle` could not repair this"] {
        assert!(message.contains(part), "{message}");
    }
    assert!(!message.contains("untangle = true"), "{message}");
    let refused = scene(false, 70.0, &ground()).unwrap_err().to_string();
    assert!(refused.contains("`untangle = true`") && !refused.contains("could not repair"), "{refused}");
}
