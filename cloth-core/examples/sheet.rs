//! Builds a scene from a string and steps it: `cargo run -p cloth-core --example sheet`.

use cloth_core::{Simulation, scene::Scene};

const SCENE: &str = r#"
dt = 0.01                                                # s
duration = 0.2                                           # s
integrator = "newton"
mesh.sheet = { cells = [8, 8], size = [1.0, 1.0] }       # m

[fabric]
density = 0.15                                           # kg/m²
material.stvk = { stretch_stiffness = 50.0, poisson_ratio = 0.3, bending.flat.stiffness = 1e-5 }

[[pins]]
nearest = [-0.5, 0.5, 0.0]
[[pins]]
nearest = [0.5, 0.5, 0.0]
"#;

fn main() -> anyhow::Result<()> {
    let mut simulation = Simulation::new(&Scene::parse(SCENE, "sheet.toml".as_ref())?)?;
    while !simulation.is_finished() {
        simulation.step()?;
    }
    let lowest = simulation.positions().iter().map(|x| x[2]).fold(f64::INFINITY, f64::min);
    println!("after 0.2 s the lowest vertex is {:.0} mm below the pins", -1e3 * lowest);
    // In free fall it would be ½ g t² = 196 mm.
    assert!(lowest < -0.1 && lowest > -0.25);
    Ok(())
}
