//! Damping of strains, with every kind of integrator.

use cloth_core::{Simulation, scene::Scene};

/// A sheet that spins and oscillates.
fn finished(integrator: &str, damping: &str) -> Simulation {
    let text = format!(
        "dt = 0.005\nduration = 0.2\nintegrator = \"{integrator}\"\ncontact = \"off\"\ngravity = [0.0, 0.0, 0.0]\n\
         [[garment]]\nmesh.sheet = {{ cells = [3, 3], size = [0.3, 0.3] }}\nspin = [0.0, 0.0, 3.0]\n\
         fabric = {{ density = 0.2{damping}, material.stvk = {{ stretch_stiffness = 20.0, poisson_ratio = 0.3, \
         bending.bridson.stiffness = 1e-4 }} }}\nrest_scale = [{{ warp = 1.1, weft = 1.1 }}]\n"
    );
    let scene = Scene::parse(&text, "s.toml".as_ref()).unwrap();
    let mut simulation = Simulation::new(&scene).unwrap();
    simulation.keep_ledger().unwrap();
    while !simulation.is_finished() {
        simulation.step().unwrap_or_else(|error| panic!("{error}"));
    }
    simulation
}

#[test]
fn damping_calms_strains_but_not_rotations_with_every_kind_of_integrator() {
    for integrator in ["newton", "implicit-midpoint", "implicit-euler"] {
        let [free, damped] =
            ["", ", rayleigh = { stretching = 0.02, bending = 0.02 }"].map(|damping| finished(integrator, damping));
        let momentum =
            |simulation: &Simulation| simulation.ledger().unwrap().entries().last().unwrap().angular_momentum[2];
        // Implicit Euler loses angular momentum, too, in proportion to the oscillation of the sheet.
        let limit = if integrator == "implicit-midpoint" { 0.01 } else { 0.2 };
        assert!((momentum(&damped) / momentum(&free) - 1.0).abs() < limit, "{integrator}");
        let ledger = damped.ledger().unwrap();
        let at = ledger.works().iter().position(|name| name == "membrane damping").unwrap();
        assert!(ledger.entries().last().unwrap().work[at] < -1e-4, "{integrator}");
    }
}
