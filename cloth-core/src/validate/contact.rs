//! Contact of cloth with itself and with obstacles: friction on an incline by Coulomb's law, cloth that sticks without
//! creeping, the capstan, and impacts that conserve momentum. Further answers have files of their own.

use std::sync::Arc;

use energy_dsl::Vector3;

use super::{Finding, ValidateError, capstan, fold, impacts, linking, stack, stick_slip, thinner};
use crate::geometry::norm;
use crate::model::Model;
use crate::scene::Scene;
use crate::simulation::{Extension, Simulation};

pub(super) const GRAVITY: f64 = 9.81;

pub(super) fn ask(quick: bool, report: &mut dyn FnMut(Finding)) -> Result<(), ValidateError> {
    let slides: &[(f64, f64)] = if quick { &[(0.2, 0.5)] } else { &[(0.0, 0.3), (0.15, 0.3), (0.3, 0.5), (0.2, 0.5)] };
    for &(friction, slope) in slides {
        slide(friction, slope, report)?;
    }
    rest(quick, report)?;
    for friction in if quick { &[0.3][..] } else { &[0.2, 0.3, 0.5] } {
        capstan::ask(*friction, report)?;
    }
    impact(report)?;
    stack::ask(quick, report)?;
    linking::ask(quick, report)?;
    impacts::ask(quick, report)?;
    thinner::ask(quick, report)?;
    fold::ask(quick, report)?;
    stick_slip::ask(quick, report)
}

pub(super) fn simulation(text: &str) -> Result<Simulation, ValidateError> {
    let scene = Scene::parse(text, "validate.toml".as_ref())?;
    Ok(Simulation::new(&scene)?)
}

/// Creates a simulation that starts at other positions than its scene says. Rest shapes stay.
pub(super) fn placed(
    text: &str,
    place: impl Fn(usize, Vector3<f64>) -> Vector3<f64> + Send + Sync + 'static,
) -> Result<Simulation, ValidateError> {
    let scene = Scene::parse(text, "validate.toml".as_ref())?;
    let extension: Extension = Arc::new(move |model: &mut Model| {
        model.x.iter_mut().enumerate().for_each(|(vertex, x)| *x = place(vertex, *x));
        let Model { moving, x, .. } = model;
        moving.iter_mut().for_each(|pin| pin.initial = x[pin.vertex]);
    });
    Ok(Simulation::extended(&scene, Some(&extension))?)
}

/// Returns the forces of contact on all vertices, in N.
pub(super) fn contact_forces(simulation: &Simulation) -> Vec<Vector3<f64>> {
    let mut all = vec![[0.0; 3]; simulation.positions().len()];
    for island in simulation.islands() {
        let body = island.body();
        let mut forces = vec![[0.0; 3]; body.x.len()];
        body.system.add_contact_force(&body.x, &mut forces);
        // Vertices of obstacles follow those of the island.
        island.vertices().iter().zip(forces).for_each(|(&vertex, force)| all[vertex] = force);
    }
    all
}

/// A sheet at a place, with the friction of its fabric and further keys.
fn sheet(name: &str, [cells, size]: [f64; 2], at: [f64; 3], friction: f64, keys: &str) -> String {
    format!(
        "[[garment]]\nname = \"{name}\"\nplacement.translate = {at:?}\n{keys}\n\
         mesh.sheet = {{ cells = [{cells:.0}, {cells:.0}], size = [{size:?}, {size:?}] }}\n\
         fabric = {{ friction = {friction:?}, density = 0.2, thickness = 1e-3, material.stvk = \
         {{ stretch_stiffness = 40.0, poisson_ratio = 0.3, bending.flat.stiffness = 1e-5 }} }}\n"
    )
}

/// A sheet that lies on a pinned one. Gravity has the slope tan α along x.
fn incline(friction: f64, slope: f64) -> Result<Simulation, ValidateError> {
    let (sine, cosine) = slope.atan().sin_cos();
    let head = format!(
        "dt = 0.01\nduration = 2.0\nintegrator = \"newton\"\ncontact = \"on\"\ntolerances.velocity = 1e-5\n\
         gravity = [{:?}, 0.0, {:?}]\n",
        GRAVITY * sine,
        -GRAVITY * cosine
    );
    let ground = sheet("ground", [8.0, 0.8], [0.0; 3], friction, "");
    // At rest, the barriers carry the sheet at this height.
    let cloth = sheet("cloth", [5.0, 0.2], [-0.213, 0.02, 0.0027], friction, "");
    simulation(&format!("{head}{ground}{cloth}[[pins]]\nof = \"ground\"\nall = true\n"))
}

/// Returns the mean velocity of the upper sheet down the slope, in m/s.
fn speed(simulation: &Simulation) -> f64 {
    let cloth = simulation.parts()[1].vertices.clone();
    let count = cloth.len() as f64;
    simulation.velocities()[cloth].iter().map(|v| v[0]).sum::<f64>() / count
}

pub(super) fn advance(simulation: &mut Simulation, steps: u64) -> Result<(), ValidateError> {
    (0..steps).try_for_each(|_| simulation.step().map(drop).map_err(ValidateError::from))
}

/// A sliding sheet accelerates by g (sin α − μ cos α).
fn slide(friction: f64, slope: f64, report: &mut dyn FnMut(Finding)) -> Result<(), ValidateError> {
    let mut simulation = incline(friction, slope)?;
    advance(&mut simulation, 20)?;
    let before = speed(&simulation);
    advance(&mut simulation, 30)?;
    let measured = (speed(&simulation) - before) / 0.3;
    let (sine, cosine) = slope.atan().sin_cos();
    let case = format!("sheet on an incline, μ {friction}, tan α {slope}: m/s²");
    report(Finding::relative("contact", case, measured, GRAVITY * (sine - friction * cosine), 0.01));
    Ok(())
}

/// Returns the mean place of the cloth along x, in m.
fn place(simulation: &Simulation) -> f64 {
    let cloth = simulation.parts().last().map_or(0..0, |part| part.vertices.clone());
    let count = cloth.len() as f64;
    simulation.positions()[cloth].iter().map(|x| x[0]).sum::<f64>() / count
}

/// The length of a bristle of friction, in m.
const BRISTLE: f64 = 1e-4;

/// Below tan α = μ a sheet stays where it is: bristles bend, but do not creep. Above, it slides.
fn rest(quick: bool, report: &mut dyn FnMut(Finding)) -> Result<(), ValidateError> {
    let steps = if quick { 300 } else { 10_000 };
    let mut on_cloth = incline(0.5, 0.45)?;
    let mut on_plane = incline_of_obstacle(0.5, 0.45)?;
    for (name, simulation) in [("cloth", &mut on_cloth), ("a plane", &mut on_plane)] {
        // The sheet sinks to its height of rest first.
        advance(simulation, 30)?;
        let before = place(simulation);
        advance(simulation, steps)?;
        let case = format!("sheet at rest on {name}, tan α = 0.9 μ: way in {steps} steps, m");
        report(Finding::absolute("contact", case, place(simulation) - before, 0.0, BRISTLE));
    }
    for (ratio, sticks) in [(0.99, true), (1.01, false)] {
        let mut simulation = incline_of_obstacle(0.5, 0.5 * ratio)?;
        advance(&mut simulation, 30)?;
        let before = place(&simulation);
        advance(&mut simulation, 100)?;
        let stayed = if (place(&simulation) - before).abs() < BRISTLE { 1.0 } else { 0.0 };
        let case = format!("sheet on a plane, tan α = {ratio} μ: sticks");
        report(Finding::absolute("contact", case, stayed, f64::from(u8::from(sticks)), 0.0));
    }
    Ok(())
}

/// A sheet that lies on a plane. Gravity has the slope tan α along x.
fn incline_of_obstacle(friction: f64, slope: f64) -> Result<Simulation, ValidateError> {
    let (sine, cosine) = slope.atan().sin_cos();
    let cloth = sheet("cloth", [5.0, 0.2], [0.0, 0.0, 0.0044], 0.0, "");
    simulation(&format!(
        "dt = 0.01\nduration = 2.0\nintegrator = \"newton\"\ntolerances.velocity = 1e-5\n\
         gravity = [{:?}, 0.0, {:?}]\n{cloth}[[obstacles]]\nplane = {{}}\nfriction = {friction:?}\n",
        GRAVITY * sine,
        -GRAVITY * cosine
    ))
}

/// Two sheets meet in weightlessness: contact pushes them apart by opposite forces.
fn impact(report: &mut dyn FnMut(Finding)) -> Result<(), ValidateError> {
    let head = "dt = 0.01\nduration = 1.0\nintegrator = \"newton\"\ncontact = \"on\"\ngravity = [0.0, 0.0, 0.0]\n\
                tolerances.velocity = 1e-11\n";
    let left = sheet("left", [3.0, 0.1], [0.0; 3], 0.0, "velocity = [0.0, 0.0, 1.0]");
    let keys = "velocity = [0.1, 0.0, -1.0]\nspin = [0.0, 1.0, 0.0]";
    let right = sheet("right", [3.0, 0.1], [0.013, 0.021, 0.03], 0.0, keys);
    let mut simulation = simulation(&format!("{head}{left}{right}"))?;
    let momentum = |simulation: &Simulation| {
        let add = |sum: [f64; 3], (mass, v): (&f64, &[f64; 3])| [0, 1, 2].map(|axis| sum[axis] + mass * v[axis]);
        simulation.masses().iter().zip(simulation.velocities()).fold([0.0; 3], add)
    };
    let mass: f64 = simulation.masses().iter().sum();
    let (before, mut crossings) = (momentum(&simulation), 0);
    for _ in 0..12 {
        advance(&mut simulation, 1)?;
        crossings += simulation.crossings().len();
    }
    let after = momentum(&simulation);
    let change = norm([0, 1, 2].map(|axis| after[axis] - before[axis])) / mass;
    report(Finding::absolute("contact", "impact of two sheets at 2 m/s: ΔP/m".into(), change, 0.0, 1e-9));
    report(Finding::absolute("contact", "impact of two sheets: crossings".into(), crossings as f64, 0.0, 0.0));
    Ok(())
}
