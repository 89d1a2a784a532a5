//! Pins that let go. The scene is assembled again without them, and its state is carried over.

use std::fmt;
use std::sync::Arc;

use super::{Island, Simulation, SimulationError};
use crate::model::{Model, ModelError};
use crate::scene::Scene;

/// Adds to a model something that its scene does not have, such as the pull of the mouse.
pub type Extension = Arc<dyn Fn(&mut Model) + Send + Sync>;

/// The times at which pins of a scene let go, and the means to assemble the scene again.
pub(super) struct Releases {
    scene: Scene,
    extension: Option<Extension>,
    /// In s, ascending.
    times: Vec<f64>,
}

impl fmt::Debug for Releases {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Releases").field("times", &self.times).finish_non_exhaustive()
    }
}

impl Releases {
    /// Returns the releases of a scene; `None` if no pin that holds exactly lets go. Soft pins need no new model.
    pub(super) fn of(scene: &Scene, extension: Option<&Extension>) -> Option<Arc<Self>> {
        let exact = scene.pins.iter().filter(|pin| pin.soft.is_none());
        let mut times: Vec<f64> = exact.filter_map(|pin| pin.release).collect();
        times.sort_by(f64::total_cmp);
        (!times.is_empty()).then(|| Arc::new(Self { scene: scene.clone(), extension: extension.cloned(), times }))
    }

    /// Returns the number of releases by a time, in s.
    pub(super) fn done_by(&self, time: f64) -> usize {
        self.times.partition_point(|release| *release <= time)
    }

    /// Assembles the scene as it is at a time, in s.
    fn model(&self, time: f64) -> Result<Model, ModelError> {
        let mut model = Model::at(&self.scene, time)?;
        self.extension.iter().for_each(|extend| extend(&mut model));
        Ok(model)
    }
}

impl Simulation {
    /// Lets go of pins that are due when the step that starts at `time`, in s, begins. Files of the scene are read
    /// again.
    pub(super) fn release_pins(&mut self, time: f64) -> Result<(), SimulationError> {
        let time = self.just_after(time);
        if self.is_assembled_for(time) {
            return Ok(());
        }
        let failed = |source| SimulationError::Release { time, source: Box::new(source) };
        let saved = self.save();
        self.assemble_for(time).map_err(failed)?;
        self.restore_state(saved).map_err(|source| failed(source.into()))?;
        self.islands.iter_mut().for_each(Island::wake);
        let bodies = self.islands.iter().map(Island::body);
        self.ledger.iter_mut().try_for_each(|ledger| ledger.reopen(bodies.clone()))?;
        Ok(())
    }

    /// A time a little later, so that rounding does not delay a release by a step.
    pub(super) fn just_after(&self, time: f64) -> f64 {
        time + 1e-6 * self.dt
    }

    /// Whether the scene is assembled with the pins that hold at a time, in s.
    pub(super) fn is_assembled_for(&self, time: f64) -> bool {
        self.releases.as_ref().is_none_or(|releases| releases.done_by(time) == self.released)
    }

    /// Assembles the scene again, at its start, with the pins that hold at a time, in s. Keeps the summary, the ledger
    /// and the number of threads.
    pub(super) fn assemble_for(&mut self, time: f64) -> Result<(), SimulationError> {
        let Some(releases) = self.releases.clone() else { return Ok(()) };
        let mut fresh = Self::assembled(&releases.scene, releases.model(time)?)?;
        fresh.released = releases.done_by(time);
        fresh.releases = Some(releases);
        std::mem::swap(&mut fresh.summary, &mut self.summary);
        std::mem::swap(&mut fresh.ledger, &mut self.ledger);
        fresh.controlled = std::mem::take(&mut self.controlled);
        fresh.hand_out_targets();
        if let Some(threads) = self.threads {
            fresh.set_threads(threads);
        }
        *self = fresh;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A sheet that is held by two pins, lifted, and let go in two steps, above a moving ball with contact.
    const SCENE: &str = r#"
dt = 0.01
duration = 0.3
integrator = "newton"
contact = "on"
[mesh.sheet]
cells = [4, 4]
size = [0.3, 0.3]
[fabric]
density = 0.2
thickness = 1e-3
plasticity.curvature = 3.0
[fabric.material.stvk]
stretch_stiffness = 40.0
poisson_ratio = 0.3
bending.plate.flexural = { rigidity = 1e-4, poisson_ratio = 0.2 }
[[pins]]
box = { min = [-0.2, -0.2, -0.1], max = [-0.1, 0.2, 0.1] }
motion.keys = [{ time = 0.0 }, { time = 0.1, translate = [0.0, 0.0, 0.05] }]
release = 0.1
[[pins]]
box = { min = [0.1, -0.2, -0.1], max = [0.2, 0.2, 0.1] }
release = 0.2
[[obstacles]]
sphere = { centre = [0.0, 0.0, -0.12], radius = 0.1 }
"#;

    fn started() -> Simulation {
        let mut simulation = Simulation::new(&Scene::parse(SCENE, "s.toml".as_ref()).unwrap()).unwrap();
        simulation.keep_ledger().unwrap();
        simulation
    }

    fn stepped(simulation: &mut Simulation, steps: usize) {
        for _ in 0..steps {
            simulation.step().unwrap_or_else(|error| panic!("{error}"));
        }
    }

    #[test]
    fn pins_let_go_at_their_times_and_their_vertices_keep_their_velocity() {
        let mut simulation = started();
        let pinned = |simulation: &Simulation| (0..25).filter(|&vertex| simulation.is_pinned(vertex)).count();
        assert_eq!(pinned(&simulation), 10);
        stepped(&mut simulation, 10);
        let thrown = simulation.positions()[0];
        assert!((thrown[2] - 0.05).abs() < 1e-12 && pinned(&simulation) == 10);
        stepped(&mut simulation, 1);
        assert_eq!(pinned(&simulation), 5);
        assert!(simulation.positions()[0][2] > thrown[2], "it flies on upwards");
        stepped(&mut simulation, 10);
        assert_eq!(pinned(&simulation), 0);
        stepped(&mut simulation, 9);
        assert_eq!(simulation.crossings(), []);
        assert_eq!(simulation.obstacle_crossings(), 0);
        let ledger = simulation.ledger().unwrap();
        assert_eq!(ledger.entries().len(), 31);
        let [held, freed, last] = [10, 11, 30].map(|entry| &ledger.entries()[entry]);
        // The pins have set their vertices in motion, with a speed of 0.5 m/s.
        let mass: f64 = (0..25).step_by(5).map(|vertex| simulation.masses()[vertex]).sum();
        assert!(freed.pins - held.pins > 0.4 * mass * 0.5 * 0.5, "{} J", freed.pins - held.pins);
        let flow = ledger.works().iter().position(|name| name == "bending").unwrap();
        assert!(last.work[flow] < 0.0, "folds that yield dissipate: {} J", last.work[flow]);
    }

    #[test]
    fn a_restored_simulation_goes_on_with_the_same_bits_across_releases() {
        let mut whole = started();
        let mut saved = Vec::new();
        for step in 0..30 {
            if [8, 10, 11, 25].contains(&step) {
                saved.push((step, whole.save()));
            }
            stepped(&mut whole, 1);
        }
        for (step, state) in saved {
            let mut resumed = started();
            resumed.restore(state).unwrap();
            stepped(&mut resumed, 30 - step);
            assert_eq!(whole.positions(), resumed.positions(), "from step {step}");
            assert_eq!(whole.ledger(), resumed.ledger(), "from step {step}");
        }
    }
}
