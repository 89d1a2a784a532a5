//! Readings of a simulation: forces on pins, and strain of garments.

use std::collections::BTreeMap;

use energy_dsl::Vector3;
use energy_solve::State;

use super::{Island, Simulation};
use crate::geometry::add_scaled;
use crate::measure::{Measurements, PinReading, Reading, Strain, StrainGauge};
use crate::model::{Model, PartKind, PinnedVertices};
use crate::scene::Scene;

/// Creates the strain gauge of each garment.
pub(super) fn gauges(scene: &Scene, model: &Model) -> Vec<StrainGauge> {
    let parts = scene.garments.iter().zip(&model.parts);
    let gauge = |(garment, part): (&crate::scene::Garment, &crate::model::Part)| match &part.kind {
        PartKind::Cloth(mesh) => Some(StrainGauge::new(mesh, garment.warp.unwrap_or(garment.fabric.warp))),
        PartKind::Hair { .. } => None,
    };
    parts.filter_map(gauge).collect()
}

impl Simulation {
    /// Returns the force of the cloth on what holds each vertex, in N: its exact pin, or the root of a hair. It is zero
    /// for free vertices, also for those that springs pull.
    ///
    /// It is the residual of the held row, f(x, v) + m (g − c v − a). f are the forces, at the end of the last step, of
    /// all elements that have a free vertex, damping and certified contact included. The rest are weight, drag c and
    /// inertia of the vertex itself, with the acceleration a of the pin in the last step. With `implicit-euler` and
    /// `newton` that is the equation that the step solved. With other integrators it is the force of the state at its
    /// end.
    ///
    /// Elements between held vertices only are not computed. Their forces cancel within one rigid pin.
    #[must_use]
    pub fn pin_forces(&self) -> Vec<Vector3<f64>> {
        let mut forces = vec![[0.0; 3]; self.x.len()];
        for island in &self.islands {
            self.add_pin_forces(island, &mut forces);
        }
        forces
    }

    fn add_pin_forces(&self, island: &Island, forces: &mut [Vector3<f64>]) {
        let body = island.body();
        let is_held = |local: &usize| body.system.dofs().row(*local).is_none();
        let held: Vec<usize> = (0..island.vertices().len()).filter(is_held).collect();
        if held.is_empty() {
            return;
        }
        let mut on = vec![[0.0; 3]; body.x.len()];
        for (term, _) in body.system.terms() {
            term.add_force(State { x: &body.x, v: &body.v }, &mut on);
        }
        body.system.add_contact_force(&body.x, &mut on);
        for local in held {
            let vertex = island.vertices()[local];
            let own =
                add_scaled(add_scaled(self.gravity, -self.drag, self.v[vertex]), -1.0, self.accelerations[vertex]);
            forces[vertex] = add_scaled(on[local], self.masses[vertex], own);
        }
    }

    /// Returns the forces of the cloth on the springs of each pin, in N, by vertex.
    fn spring_forces(&self) -> Vec<BTreeMap<usize, Vector3<f64>>> {
        let mut forces = vec![BTreeMap::new(); self.pins.len()];
        let numbered = self.pins.iter().enumerate();
        let pins: BTreeMap<usize, usize> =
            numbered.flat_map(|(number, pin)| pin.springs.iter().map(move |&label| (label, number))).collect();
        if pins.is_empty() {
            return forces;
        }
        for island in &self.islands {
            let body = island.body();
            let mut on = vec![[0.0; 3]; body.x.len()];
            for ((term, _), label) in body.system.terms().zip(island.labels()) {
                let Some(&pin) = pins.get(label) else { continue };
                term.add_force(State { x: &body.x, v: &body.v }, &mut on);
                for local in term.stencils().iter().flatten().map(|local| local as usize) {
                    // A vertex that a pin chose twice has both forces already.
                    let force = std::mem::take(&mut on[local]).map(|component| -component);
                    let sum = forces[pin].entry(island.vertices()[local]).or_insert([0.0; 3]);
                    *sum = add_scaled(*sum, 1.0, force);
                }
            }
        }
        forces
    }

    /// Returns the load on each pin, and the strain of each garment, now. The force of an exact pin is the sum of
    /// [`Self::pin_forces`] over the vertices that it holds, that of a pin with springs the sum of their forces.
    ///
    /// ```
    /// use cloth_core::{Simulation, scene::Scene};
    /// let scene = Scene::parse(
    ///     r#"
    ///     dt = 0.01
    ///     duration = 0.1
    ///     gravity = [0.0, 0.0, -9.81]
    ///     mesh.sheet = { cells = [2, 2], size = [0.2, 0.2], plane = "vertical" }
    ///     fabric = { density = 0.5, material.stvk = { stretch_stiffness = 100.0, poisson_ratio = 0.3 } }
    ///     pins = [{ all = true, name = "frame" }]
    ///     "#,
    ///     "scene.toml".as_ref(),
    /// )?;
    /// let reading = Simulation::new(&scene)?.reading();
    /// // The frame carries the weight of 0.02 kg.
    /// assert!((reading.pins[0].force[2] + 0.02 * 9.81).abs() < 1e-12);
    /// assert!(reading.strains[0].unwrap().warp.largest.abs() < 1e-12);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn reading(&self) -> Reading {
        let held = if self.pins.is_empty() { Vec::new() } else { self.pin_forces() };
        let load = |(pin, on_springs): (&PinnedVertices, BTreeMap<usize, Vector3<f64>>)| {
            let force = |vertex: &usize| match pin.held.binary_search(vertex) {
                Ok(_) => held[*vertex],
                Err(_) => on_springs.get(vertex).copied().unwrap_or_default(),
            };
            let forces: Vec<Vector3<f64>> = pin.chosen.iter().map(force).collect();
            let x: Vec<Vector3<f64>> = pin.chosen.iter().map(|&vertex| self.x[vertex]).collect();
            PinReading::of(&forces, &x)
        };
        let pins = self.pins.iter().zip(self.spring_forces()).map(load).collect();
        Reading { time: self.time(), pins, strains: self.strains_at(&self.x) }
    }

    /// Returns the strain of each garment at other positions of all vertices, in m; `None` if no triangle of a garment
    /// has a warp direction.
    ///
    /// # Panics
    /// Panics if there are fewer positions than vertices.
    #[must_use]
    pub fn strains_at(&self, x: &[Vector3<f64>]) -> Vec<Option<Strain>> {
        let of_part = self.gauges.iter().zip(&self.parts);
        of_part.map(|(gauge, part)| gauge.strain(&x[part.vertices.clone()])).collect()
    }

    /// Returns the names of pins and garments, without readings.
    #[must_use]
    pub fn measurements(&self) -> Measurements {
        let garments = self.gauges.iter().zip(&self.parts).map(|(_, part)| part.name.clone()).collect();
        Measurements { pins: self.pins.iter().map(|pin| pin.name.clone()).collect(), garments, readings: Vec::new() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{dot, norm, subtract};

    /// A sheet of 0.04 kg, 20 cm wide and 10 cm high.
    const SHEET: &str = r#"
dt = 0.01
integrator = "newton"
contact = "off"
tolerances.velocity = 1e-8
mesh.sheet = { cells = [8, 4], size = [0.2, 0.1], plane = "vertical" }
[fabric]
density = 2.0
rayleigh.stretching = 0.01
material.stvk = { stretch_stiffness = 80.0, poisson_ratio = 0.2 }
"#;

    fn stepped(scene: &str, mut after_step: impl FnMut(&Simulation)) -> Simulation {
        let scene = Scene::parse(&format!("{scene}{SHEET}"), "sheet.toml".as_ref()).unwrap();
        let mut simulation = Simulation::new(&scene).unwrap();
        simulation.keep_ledger().unwrap();
        while !simulation.is_finished() {
            simulation.step().unwrap();
            after_step(&simulation);
        }
        simulation
    }

    #[test]
    fn pins_carry_the_weight_and_what_they_accelerate() {
        let hung = "duration = 3.0\ndrag = 20.0\npins = [{ vertex = 36 }, { vertices = [44, 44] }]\n";
        let reading = stepped(hung, |_| ()).reading();
        let [one, other] = [reading.pins[0].force, reading.pins[1].force];
        assert!((one[2] + other[2] + 0.04 * 9.81).abs() < 1e-5, "{one:?} {other:?}");
        assert!((one[0] + other[0]).abs() < 1e-6 && one[0] > 0.05, "{one:?} {other:?}");
        // The momentum of the cloth changes by the forces on it: weight, and the pins'.
        let lifted = "duration = 0.5\npins = [{ all = true, motion = { interpolation = \"smoothstep\", keys = \
                      [{ time = 0.0 }, { time = 0.5, angle = 40.0, translate = [0.0, 0.0, 0.3] }] } }]\n";
        let mut before = [0.0; 3];
        stepped(lifted, |simulation| {
            let parts = simulation.velocities().iter().zip(simulation.masses());
            let momentum = parts.fold([0.0; 3], |sum, (v, mass)| add_scaled(sum, *mass, *v));
            let rate = subtract(momentum, before).map(|change| change / 0.01);
            let expected = subtract([0.0, 0.0, -0.04 * 9.81], rate);
            let force = simulation.reading().pins[0].force;
            assert!(norm(subtract(force, expected)) < 1e-10, "{force:?} {expected:?}");
            before = momentum;
        });
    }

    #[test]
    fn the_work_of_a_slow_pull_is_that_of_the_ledger() {
        let pull = "duration = 2.0\ngravity = [0.0, 0.0, 0.0]\n\
                    [[pins]]\nname = \"jaws\"\nbox = { min = [-0.11, -1.0, -1.0], max = [-0.09, 1.0, 1.0] }\n\
                    [[pins]]\nname = \"jaws\"\nbox = { min = [0.09, -1.0, -1.0], max = [0.11, 1.0, 1.0] }\n\
                    motion.keys = [{ time = 0.0 }, { time = 2.0, translate = [0.02, 0.0, 0.0] }]\n";
        // TOML wants the keys of the scene first.
        let (keys, tables) = pull.split_once("[[pins]]").unwrap();
        let scene = format!("{keys}{SHEET}[[pins]]{tables}");
        let mut simulation = Simulation::new(&Scene::parse(&scene, "s.toml".as_ref()).unwrap()).unwrap();
        simulation.keep_ledger().unwrap();
        let (mut work, mut last) = (0.0, simulation.reading().pins[1]);
        while !simulation.is_finished() {
            simulation.step().unwrap();
            let now = simulation.reading().pins[1];
            let mean = add_scaled(last.force.map(|part| 0.5 * part), 0.5, now.force);
            work -= dot(mean, subtract(now.position, last.position));
            last = now;
        }
        let expected = simulation.ledger().unwrap().entries().last().unwrap().pins;
        assert!(expected > 1e-3 && (work / expected - 1.0).abs() < 0.02, "{work} {expected}");
        let all = simulation.measurements();
        let loads = all.loads(&simulation.reading());
        assert_eq!(loads[2].0, "group jaws");
        assert!(norm(loads[2].1.force) < 1e-2 * norm(loads[1].1.force), "{loads:?}");
        let warp = simulation.reading().strains[0].unwrap().warp;
        assert!((warp.mean - 0.1).abs() < 1e-3 && warp.low <= warp.mean && warp.mean <= warp.high, "{warp:?}");
    }

    #[test]
    fn springs_carry_what_they_are_stretched_by_until_they_let_go() {
        let hung = |release: &str| {
            format!("duration = 3.0\ndrag = 20.0\npins = [{{ vertices = [36, 36, 44], stiffness = 50.0{release} }}]\n")
        };
        let start =
            Simulation::new(&Scene::parse(&format!("{}{SHEET}", hung("")), "s.toml".as_ref()).unwrap()).unwrap();
        let simulation = stepped(&hung(""), |_| ());
        let load = simulation.reading().pins[0];
        let sag = |vertex: usize| simulation.positions()[vertex][2] - start.positions()[vertex][2];
        let expected = 50.0 * (2.0 * sag(36) + sag(44));
        assert!((load.force[2] - expected).abs() < 1e-9 && (expected + 0.04 * 9.81).abs() < 1e-4, "{load:?}");
        assert_eq!(load.vertices, 2);
        for pin in [hung(", release = 0.5"), hung(", release = 0.5").replace(", stiffness = 50.0", "")] {
            let mut forces = Vec::new();
            stepped(&pin, |simulation| forces.push(norm(simulation.reading().pins[0].force)));
            assert!(forces[48] > 0.1 && forces[50..].iter().all(|force| *force == 0.0), "{pin}: {:?}", &forces[45..55]);
        }
    }
}
